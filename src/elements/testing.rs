//! Small scenes with texture space laid out by hand, for the tests of this stage and of later ones.

use super::{Elements, Noticed, rasterise};
use crate::atlas::{Atlas, Page, Placement, Unwrap};
use crate::progress::{Progress, Silent, Stage};
use crate::scene::{Geometry, GeometryId, Material, MaterialId, Origin, Role, Scene, Surface};
use crate::transport::World;
use crate::with_tracer;
use glam::{DAffine3, Vec2, Vec3};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A scene under construction.
pub(crate) struct Stand {
    pub scene: Scene,
    pub atlas: Atlas,
}

/// A mesh with texture space per vertex and a chart per triangle.
#[derive(Clone, Default)]
pub(crate) struct Piece {
    pub position: Vec<Vec3>,
    /// Flat normals when empty.
    pub normal: Vec<Vec3>,
    pub uv_texels: Vec<Vec2>,
    pub triangles: Vec<[u32; 3]>,
    pub chart: Vec<u32>,
}

impl Piece {
    /// A rectangle `a`, `a + u`, `a + v` (front: u × v) of `cells` quads, its first corner at `at` on the page, a
    /// texel per `metres`.
    pub fn rectangle(a: Vec3, u: Vec3, v: Vec3, cells: u32, at: Vec2, metres: f32) -> Self {
        let mut piece = Self::default();
        let size = Vec2::new(u.length(), v.length()) / metres;
        for j in 0..=cells {
            for i in 0..=cells {
                let share = Vec2::new(i as f32, j as f32) / cells as f32;
                piece.position.push(a + u * share.x + v * share.y);
                piece.uv_texels.push(at + size * share);
            }
        }
        for j in 0..cells {
            for i in 0..cells {
                let k = j * (cells + 1) + i;
                piece.triangles.extend([[k, k + 1, k + cells + 2], [k, k + cells + 2, k + cells + 1]]);
            }
        }
        piece.chart = vec![0; piece.triangles.len()];
        piece
    }

    /// Adds the triangles of another piece as further charts.
    pub fn and(mut self, other: Self) -> Self {
        let first = self.position.len() as u32;
        let charts = self.chart.iter().max().map_or(0, |c| c + 1);
        self.position.extend(other.position);
        self.normal.extend(other.normal);
        self.uv_texels.extend(other.uv_texels);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
        self.chart.extend(other.chart.iter().map(|c| c + charts));
        self
    }

    /// An outward box, six charts in a row from `at` on, each `wide` texels apart.
    pub fn closed_box(min: Vec3, max: Vec3, at: Vec2, wide: f32, metres: f32) -> Self {
        let d = max - min;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        let faces =
            [(min, y, x), (min + z, x, y), (min, x, z), (min + y, z, x), (min, z, y), (min + x, y, z)];
        (0..).zip(faces).fold(Self::default(), |all, (i, (a, u, v))| {
            all.and(Self::rectangle(a, u, v, 1, at + Vec2::new(wide * i as f32, 0.0), metres))
        })
    }

    /// The same with every triangle turned.
    pub fn turned(mut self) -> Self {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self
    }

    pub fn flat_normals(&self) -> Vec<Vec3> {
        let mut normal = vec![Vec3::ZERO; self.position.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.position[i as usize]);
            t.iter().for_each(|&i| normal[i as usize] += (b - a).cross(c - a));
        }
        normal.into_iter().map(Vec3::normalize_or_zero).collect()
    }
}

impl Stand {
    pub fn new(size_texels: u32) -> Self {
        let atlas = Atlas { pages: vec![Page { size_texels, exported: true }], ..Atlas::default() };
        Self { scene: Scene { materials: vec![Material::default()], ..Scene::default() }, atlas }
    }

    pub fn page(&mut self, size_texels: u32, exported: bool) -> u32 {
        self.atlas.pages.push(Page { size_texels, exported });
        self.atlas.pages.len() as u32 - 1
    }

    pub fn material(&mut self, material: Material) -> MaterialId {
        self.scene.materials.push(material);
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    /// Adds a surface whose front is lightmapped; returns its index.
    pub fn add(&mut self, piece: Piece, pose: DAffine3, material: MaterialId) -> usize {
        let surface = self.add_dark(&piece, pose, material);
        self.atlas.fronts[surface] = Some(placement(piece, 0));
        surface
    }

    /// Places the back of a surface on a page of its own layout.
    pub fn add_back(&mut self, surface: usize, piece: Piece, page: u32) {
        self.atlas.backs[surface] = Some(placement(piece, page));
    }

    /// Adds a surface that takes no light.
    pub fn add_dark(&mut self, piece: &Piece, pose: DAffine3, material: MaterialId) -> usize {
        let smooth = !piece.normal.is_empty();
        let normal_local = if smooth { piece.normal.clone() } else { piece.flat_normals() };
        let to_normal = pose.matrix3.inverse().transpose();
        let surface = self.scene.surfaces.len();
        self.scene.surfaces.push(Surface {
            origin: Origin { name: format!("s{surface}"), node: surface, ..Origin::default() },
            geometry: GeometryId(self.scene.geometries.len() as u32),
            material,
            world_from_local: pose,
            position_world: piece
                .position
                .iter()
                .map(|p| pose.transform_point3(p.as_dvec3()).as_vec3())
                .collect(),
            normal_world: normal_local
                .iter()
                .map(|n| (to_normal * n.as_dvec3()).normalize().as_vec3())
                .collect(),
            mirrored: pose.matrix3.determinant() < 0.0,
            role: Role::Lightmapped,
            density_factor: 1.0,
        });
        self.scene.geometries.push(Geometry {
            position_local: piece.position.clone(),
            normal_local,
            triangles: piece.triangles.clone(),
            smooth,
            ..Geometry::default()
        });
        self.atlas.fronts.push(None);
        self.atlas.backs.push(None);
        surface
    }

    pub fn world(&self) -> World {
        World::new(&self.scene)
    }

    pub fn elements(&self) -> Elements {
        self.noticed().0
    }

    pub fn noticed(&self) -> (Elements, Noticed) {
        let cancel = AtomicBool::new(false);
        let mut progress = Progress::begin(&Silent, &cancel, Stage::Elements, 0);
        let world = self.world();
        with_tracer!(world.tracer(&self.scene), tracer => {
            rasterise(&self.scene, &self.atlas, &|_| true, tracer, &mut progress).unwrap()
        })
    }
}

fn placement(piece: Piece, page: u32) -> Placement {
    let min = piece.uv_texels.iter().fold(Vec2::INFINITY, |m, &p| m.min(p));
    let max = piece.uv_texels.iter().fold(Vec2::NEG_INFINITY, |m, &p| m.max(p));
    let unwrap = Unwrap {
        source_vertex: (0..piece.uv_texels.len() as u32).collect(),
        triangles: piece.triangles,
        chart_count: piece.chart.iter().max().map_or(0, |c| c + 1),
        chart_of_triangle: piece.chart,
    };
    Placement { page, unwrap: Arc::new(unwrap), uv_texels: piece.uv_texels, rect_texels: [min, max] }
}

/// Evenly spread numbers in `[0, 1)`, the same every time.
pub(crate) fn scatter(seed: u32) -> impl Iterator<Item = f32> {
    let mut state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        ((word >> 22) ^ word) as f32 / (1_u64 << 32) as f32
    })
}
