//! The charts of all placed sides, and their triangles in texture space and in the world.

use crate::atlas::{Atlas, Placement};
use crate::scene::Scene;
use glam::{DVec2, DVec3};

/// One chart of one side of one surface.
#[derive(Clone, Copy)]
pub(super) struct ChartPlan<'a> {
    pub scene: &'a Scene,
    pub placement: &'a Placement,
    pub surface: u32,
    pub back: bool,
    /// Which of the side's charts.
    pub chart: u32,
    pub exported: bool,
    /// Size of the page.
    pub size_texels: u32,
    /// Triangles of the geometry, ascending.
    pub triangles: &'a [u32],
}

/// Triangles of every placement, grouped by chart: the storage that [`ChartPlan`]s point into.
pub(super) struct Grouped<'a> {
    sides: Vec<GroupedSide<'a>>,
}

struct GroupedSide<'a> {
    placement: &'a Placement,
    surface: u32,
    back: bool,
    start: Vec<u32>,
    triangles: Vec<u32>,
}

/// A triangle where it lies on the page and in the world. Corners are ordered as the world's: counter-clockwise from
/// the front.
pub(super) struct Mapped {
    pub uv: [DVec2; 3],
    pub world: [DVec3; 3],
    /// World area, m²; 0 when a corner is not finite.
    pub area: f64,
}

impl<'a> Grouped<'a> {
    /// Sides in the order of the atlas: all fronts, then all backs.
    pub(super) fn new(scene: &Scene, atlas: &'a Atlas) -> Self {
        let side = |back| {
            move |(surface, placement): (u32, &'a Option<Placement>)| {
                let placement = placement.as_ref()?;
                Some((surface, back, placement))
            }
        };
        let fronts = (0..).zip(&atlas.fronts).filter_map(side(false));
        let backs = (0..).zip(&atlas.backs).filter_map(side(true));
        let group = |(surface, back, placement): (u32, bool, &'a Placement)| {
            debug_assert!((surface as usize) < scene.surfaces.len());
            let chart_of = &placement.unwrap.chart_of_triangle;
            let mut start = vec![0_u32; placement.unwrap.chart_count as usize + 1];
            for &chart in chart_of {
                start[chart as usize + 1] += 1;
            }
            for i in 1..start.len() {
                start[i] += start[i - 1];
            }
            let mut next = start.clone();
            let mut triangles = vec![0; chart_of.len()];
            for (t, &chart) in (0..).zip(chart_of) {
                triangles[next[chart as usize] as usize] = t;
                next[chart as usize] += 1;
            }
            GroupedSide { placement, surface, back, start, triangles }
        };
        Self { sides: fronts.chain(backs).map(group).collect() }
    }

    pub(super) fn charts<'b>(&'b self, scene: &'b Scene, atlas: &'b Atlas) -> Vec<ChartPlan<'b>> {
        let mut charts = Vec::new();
        for side in &self.sides {
            let page = &atlas.pages[side.placement.page as usize];
            charts.extend((0..).zip(side.start.windows(2)).map(|(chart, range)| ChartPlan {
                scene,
                placement: side.placement,
                surface: side.surface,
                back: side.back,
                chart,
                exported: page.exported,
                size_texels: page.size_texels,
                triangles: &side.triangles[range[0] as usize..range[1] as usize],
            }));
        }
        charts
    }
}

impl ChartPlan<'_> {
    /// The triangle with the given index of the geometry.
    pub(super) fn mapped(&self, triangle: u32) -> Mapped {
        let surface = &self.scene.surfaces[self.surface as usize];
        let world = self.scene.corners_world(surface, triangle).map(|p| p.as_dvec3());
        let uv = corners_texels(self.placement, surface.mirrored, triangle).map(|p| p.as_dvec2());
        let area = 0.5 * (world[1] - world[0]).cross(world[2] - world[0]).length();
        Mapped { uv, world, area: if area.is_finite() { area } else { 0.0 } }
    }

    /// Texel rectangle `[min, max)` that holds all its triangles; `None` when it has none on the page.
    pub(super) fn rectangle(&self) -> Option<[[i32; 2]; 2]> {
        let surface = &self.scene.surfaces[self.surface as usize];
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &t in self.triangles {
            let uv = corners_texels(self.placement, surface.mirrored, t);
            if uv.iter().all(|p| p.is_finite()) {
                for p in uv {
                    (min, max) = (min.min(p.as_dvec2()), max.max(p.as_dvec2()));
                }
            }
        }
        let size = self.size_texels as i32;
        let lo = [min.x, min.y].map(|v| (v.floor() as i32).clamp(0, size));
        // A border exactly on a texel's edge can still own a degenerate triangle of the next texel.
        let hi = [max.x, max.y].map(|v| (v.floor() as i32 + 1).clamp(0, size));
        (min.is_finite() && lo[0] < hi[0] && lo[1] < hi[1]).then_some([lo, hi])
    }
}

/// Corners of a triangle on the page, in the order of [`Scene::corner_indices`].
pub(super) fn corners_texels(placement: &Placement, mirrored: bool, triangle: u32) -> [glam::Vec2; 3] {
    let [a, b, c] = placement.unwrap.triangles[triangle as usize];
    let corners = if mirrored { [a, c, b] } else { [a, b, c] };
    corners.map(|v| placement.uv_texels[v as usize])
}

impl Mapped {
    /// Weights of the three corners at a point of the page; `None` when the triangle has no area there.
    pub(super) fn weights(&self, p: DVec2) -> Option<DVec3> {
        let [a, b, c] = self.uv;
        let doubled = (b - a).perp_dot(c - a);
        let w =
            DVec3::new((c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)) / doubled;
        w.is_finite().then_some(w)
    }

    /// World point of corner weights.
    pub(super) fn point(&self, w: DVec3) -> DVec3 {
        self.world[0] * w.x + self.world[1] * w.y + self.world[2] * w.z
    }

    /// Unit normal of the front; zero when the triangle has no area.
    pub(super) fn normal(&self) -> DVec3 {
        let [a, b, c] = self.world;
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// World metres per texel along u and v. Where the map has no inverse: two tangents of the triangle's size.
    pub(super) fn per_texel(&self) -> [DVec3; 2] {
        let (e1, e2) = (self.world[1] - self.world[0], self.world[2] - self.world[0]);
        let (d1, d2) = (self.uv[1] - self.uv[0], self.uv[2] - self.uv[0]);
        let doubled = d1.perp_dot(d2);
        let along = [(e1 * d2.y - e2 * d1.y) / doubled, (e2 * d1.x - e1 * d2.x) / doubled];
        if along.iter().all(|v| v.is_finite()) {
            return along;
        }
        let normal = self.normal();
        let u = normal.any_orthogonal_vector().normalize_or_zero() * self.area.sqrt();
        [u, normal.cross(u)]
    }
}
