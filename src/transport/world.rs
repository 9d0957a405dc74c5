//! The triangles of a scene in one dense list, with their tree.

use super::build::Binary;
use super::tracer::AnyTracer;
use super::tree::Tree;
use super::{Hit, offset_origin};
use crate::scene::{Opacity, Scene, SurfacePoint};
use glam::{DVec3, Vec2, Vec3};

/// Triangles with a coordinate beyond this (metres) block nothing, as those that are not finite: products of
/// coordinates must stay inside f32.
pub(super) const FARTHEST: f32 = 1e15;

/// The least a tracer must know to be right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Blocking {
    /// Every triangle stops all light.
    Opaque,
    /// Some have holes.
    Cutout,
    /// Some let a share of the light pass.
    Tinted,
}

/// All triangles of a scene.
///
/// World triangle indices are dense over all surfaces in order, triangles of no area included: triangle j of surface
/// i is `first_triangle_of_surface(i) + j`. Triangles of no area, with a coordinate that is not finite or beyond
/// 1e15 m, and those of surfaces that are nowhere opaque enough for their mask are never met by a ray.
///
/// Memory: 40 bytes a triangle and 4 bytes a surface, and the tree's about 60 bytes a triangle.
#[derive(Clone)]
pub struct World {
    corners: Vec<[Vec3; 3]>,
    surface: Vec<u32>,
    first: Vec<u32>,
    blocking: Blocking,
    pub(super) tree: Tree,
}

impl World {
    /// Gathers the scene's triangles and builds the tree.
    pub fn new(scene: &Scene) -> Self {
        let mut corners = Vec::new();
        let mut surface_of = Vec::new();
        let mut first = vec![0];
        let mut opacity = Vec::with_capacity(scene.surfaces.len());
        for (index, surface) in scene.surfaces.iter().enumerate() {
            let count = scene.geometry(surface).triangles.len();
            corners.extend((0..count as u32).map(|t| scene.corners_world(surface, t)));
            surface_of.resize(corners.len(), index as u32);
            first.push(corners.len() as u32);
            opacity.push(scene.opacity_of(surface));
        }
        let of = |triangle: u32| opacity[surface_of[triangle as usize] as usize];
        let blocking = opacity.iter().map(|&o| blocking(o)).max().unwrap_or(Blocking::Opaque);
        let blockers = blockers(&corners, |t| of(t) != Opacity::Clear);
        let tree = Tree::new(&Binary::new(&corners, &blockers), &corners, |t| must_be_asked(of(t)));
        Self { corners, surface: surface_of, first, blocking, tree }
    }

    /// A world of opaque triangles that belong to one surface; the corners wind counter-clockwise from the front.
    pub fn opaque(corners: Vec<[Vec3; 3]>) -> Self {
        let blockers = blockers(&corners, |_| true);
        let tree = Tree::new(&Binary::new(&corners, &blockers), &corners, |_| false);
        let first = vec![0, corners.len() as u32];
        Self { surface: vec![0; corners.len()], first, blocking: Blocking::Opaque, corners, tree }
    }

    /// Number of triangles, those of no area included.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// World corner positions, counter-clockwise from the front, metres relative to the scene's origin.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.corners[triangle as usize]
    }

    /// Index into the scene's surfaces.
    #[inline]
    pub fn surface_of(&self, triangle: u32) -> u32 {
        self.surface[triangle as usize]
    }

    /// Index into the triangles of the surface's geometry.
    #[inline]
    pub fn local_triangle(&self, triangle: u32) -> u32 {
        triangle - self.first[self.surface_of(triangle) as usize]
    }

    /// World triangle of a surface's first triangle; for the number of surfaces, the number of triangles.
    pub fn first_triangle_of_surface(&self, surface: u32) -> u32 {
        self.first[surface as usize]
    }

    /// World triangle of a surface's triangle.
    #[inline]
    pub fn triangle_of(&self, surface: u32, local_triangle: u32) -> u32 {
        self.first[surface as usize] + local_triangle
    }

    /// The point hit, as the scene's materials are asked.
    #[inline]
    pub fn surface_point(&self, hit: &Hit) -> SurfacePoint {
        SurfacePoint {
            surface: self.surface_of(hit.triangle),
            triangle: self.local_triangle(hit.triangle),
            barycentric: Vec2::new(hit.u, hit.v),
        }
    }

    /// Unit normal of the plane on the front side; zero when the triangle has no area.
    #[inline]
    pub fn normal(&self, triangle: u32) -> Vec3 {
        twice_area_normal(&self.corners(triangle)).normalize_or_zero().as_vec3()
    }

    /// Area, m².
    pub fn area(&self, triangle: u32) -> f32 {
        (0.5 * twice_area_normal(&self.corners(triangle)).length()) as f32
    }

    /// Start of a ray that leaves the triangle on the side of `normal_geometric`: see [`offset_origin`].
    #[inline]
    pub fn offset_origin(&self, triangle: u32, position: Vec3, normal_geometric: Vec3) -> Vec3 {
        offset_origin(position, normal_geometric, &self.corners(triangle))
    }

    /// Lowest and highest corner of all triangles that rays can meet, metres; zero when there are none.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.tree.low.into(), self.tree.high.into()]
    }

    /// What a tracer must know.
    pub fn blocking(&self) -> Blocking {
        self.blocking
    }

    /// The least tracer that is right for this world; `scene` must be the one it was built from.
    pub fn tracer<'a>(&'a self, scene: &'a Scene) -> AnyTracer<'a> {
        AnyTracer::new(self.blocking, self, scene)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.corners[..])
            + size_of_val(&self.surface[..])
            + size_of_val(&self.first[..])
            + self.tree.bytes()
    }
}

/// (b − a) × (c − a) in f64.
fn twice_area_normal([a, b, c]: &[Vec3; 3]) -> DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

fn blockers(corners: &[[Vec3; 3]], blocks: impl Fn(u32) -> bool) -> Vec<u32> {
    let lawful = |corners: &[Vec3; 3]| {
        corners.iter().all(|c| c.abs().max_element() <= FARTHEST && c.is_finite())
            && twice_area_normal(corners) != DVec3::ZERO
    };
    (0..corners.len() as u32).filter(|&t| lawful(&corners[t as usize]) && blocks(t)).collect()
}

/// Whether hits must ask how much is stopped there.
fn must_be_asked(opacity: Opacity) -> bool {
    matches!(opacity, Opacity::Holes | Opacity::Partial)
}

/// What a tracer must know to meet it.
fn blocking(opacity: Opacity) -> Blocking {
    match opacity {
        Opacity::Full | Opacity::Clear => Blocking::Opaque,
        Opacity::Holes => Blocking::Cutout,
        Opacity::Partial => Blocking::Tinted,
    }
}
