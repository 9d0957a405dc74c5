//! Small worlds of patches with closed answers, traced by looking at every surface.

use super::sphere::sphere;
use crate::error::Result;
use crate::solve::{Made, RowSource, Rows};
use crate::transport::Ray;
use crate::transport::form_factors::area::{Polygon, polygon_row};
use crate::transport::form_factors::hemicube::Hemicube;
use crate::transport::form_factors::polygon::point_to_polygon;
use crate::transport::form_factors::rays::ray_row;
use crate::transport::form_factors::{Landings, Row, SurfacePoint};
use glam::{DVec3, dvec3};

/// A parallelogram cut into columns × rows patches, or a triangle, which is one.
#[derive(Clone)]
struct Surface {
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    grid: Option<[u32; 2]>,
    first_patch: u32,
}

/// Surfaces that face their normal, u × v, with patches numbered through.
#[derive(Clone, Default)]
pub struct World {
    surfaces: Vec<Surface>,
    /// The patches.
    pub polygons: Vec<Polygon>,
    owner: Vec<u32>,
}

impl World {
    /// Adds a parallelogram of columns × rows patches; nothing where it has no area.
    pub fn add_quad(&mut self, origin: DVec3, u: DVec3, v: DVec3, grid: [u32; 2]) {
        let at = |x: u32, y: u32| {
            origin + u * (f64::from(x) / f64::from(grid[0])) + v * (f64::from(y) / f64::from(grid[1]))
        };
        let cells = (0..grid[1]).flat_map(|y| (0..grid[0]).map(move |x| (x, y)));
        let polygons =
            cells.map(|(x, y)| Polygon::new(vec![at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]));
        self.add(polygons.collect(), Surface { origin, u, v, grid: Some(grid), first_patch: 0 });
    }

    /// Adds a triangle; nothing where it has no area.
    pub fn add_triangle(&mut self, corners: [DVec3; 3]) {
        let [origin, b, c] = corners;
        let polygon = Polygon::new(corners.to_vec());
        let surface = Surface { origin, u: b - origin, v: c - origin, grid: None, first_patch: 0 };
        self.add(polygon.map(|polygon| vec![polygon]), surface);
    }

    fn add(&mut self, polygons: Option<Vec<Polygon>>, surface: Surface) {
        let Some(polygons) = polygons else { return };
        let (first_patch, owner) = (self.polygons.len() as u32, self.surfaces.len() as u32);
        self.owner.resize(self.owner.len() + polygons.len(), owner);
        self.polygons.extend(polygons);
        self.surfaces.push(Surface { first_patch, ..surface });
    }

    /// Takes all surfaces but the first few away.
    pub fn truncate(&mut self, surfaces: usize) {
        if let Some(first) = self.surfaces.get(surfaces) {
            self.polygons.truncate(first.first_patch as usize);
            self.owner.truncate(first.first_patch as usize);
            self.surfaces.truncate(surfaces);
        }
    }

    /// The same world, every length multiplied by `scale` and then moved.
    pub fn placed(&self, scale: f64, by: DVec3) -> Self {
        let mut placed = Self::default();
        for surface in &self.surfaces {
            let (origin, u, v) = (surface.origin * scale + by, surface.u * scale, surface.v * scale);
            match surface.grid {
                Some(grid) => placed.add_quad(origin, u, v, grid),
                None => placed.add_triangle([origin, origin + u, origin + v]),
            }
        }
        placed
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.polygons.len()
    }

    /// Whether there is no patch.
    pub fn is_empty(&self) -> bool {
        self.polygons.is_empty()
    }

    /// Area of every patch.
    pub fn area(&self) -> Vec<f64> {
        self.polygons.iter().map(Polygon::area).collect()
    }

    /// The nearest surface along a ray, but for the one it starts on: its patch, and whether its front was met.
    fn nearest(&self, ray: &Ray, from: u32) -> Option<(u32, bool)> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut nearest = (f64::INFINITY, None);
        for (index, surface) in self.surfaces.iter().enumerate() {
            if index as u32 == from {
                continue;
            }
            let normal = surface.u.cross(surface.v);
            let slope = normal.dot(direction);
            let t = normal.dot(surface.origin - origin) / slope;
            if !(t > 0.0 && t < nearest.0) {
                continue;
            }
            let at = origin + direction * t - surface.origin;
            let a = at.cross(surface.v).dot(normal) / normal.length_squared();
            let b = surface.u.cross(at).dot(normal) / normal.length_squared();
            // Rays start on f32 positions: edges are closed as far as those are rounded.
            const CLOSED: f64 = 1e-6;
            let inside = a > -CLOSED && b > -CLOSED;
            let patch = match surface.grid {
                Some([columns, rows]) if inside && a < 1.0 + CLOSED && b < 1.0 + CLOSED => {
                    let cell = |x: f64, count: u32| ((x * f64::from(count)) as u32).min(count - 1);
                    surface.first_patch + cell(a, columns) + columns * cell(b, rows)
                }
                None if inside && a + b < 1.0 + CLOSED => surface.first_patch,
                _ => continue,
            };
            nearest = (t, Some((patch, slope < 0.0)));
        }
        nearest.1
    }

    fn land(&self, patch: u32, ray: &Ray, landings: &mut Landings) {
        match self.nearest(ray, self.owner[patch as usize]) {
            Some((patch, true)) => landings.hit(patch, 1.0),
            Some((_, false)) => {}
            None => landings.miss(1.0, [0.0; 3]),
        }
    }

    fn sample(&self, patch: u32, [x, y]: [f32; 2]) -> SurfacePoint {
        let polygon = &self.polygons[patch as usize];
        let corners = polygon.corners();
        let (x, y) = (f64::from(x), f64::from(y));
        let position = if corners.len() == 4 {
            corners[0] + (corners[1] - corners[0]) * x + (corners[3] - corners[0]) * y
        } else {
            // Uniform by area.
            let root = x.sqrt();
            corners[0] * (1.0 - root) + corners[1] * (root * (1.0 - y)) + corners[2] * (root * y)
        };
        SurfacePoint { position_world: position.as_vec3(), normal: polygon.normal().as_vec3() }
    }
}

/// One way to form factors.
#[derive(Clone, Copy, Debug)]
pub enum Method {
    /// This many cosine-distributed rays from all over the patch, a power of two.
    Rays(u32),
    /// Hemicubes over the middles of points × points cells of the patch.
    Hemicube {
        /// Pixels along the edge of the top.
        resolution: u32,
        /// Along each axis.
        points: u32,
    },
    /// Closed forms.
    Analytic,
}

impl Method {
    /// The row of one patch.
    pub fn row(self, world: &World, patch: u32) -> Row {
        let mut row = Row::default();
        let (sample, land) =
            (|at| world.sample(patch, at), |ray: &Ray, to: &mut Landings| world.land(patch, ray, to));
        match self {
            Self::Rays(rays) => ray_row(patch, rays, sample, land, &mut Landings::default(), &mut row),
            Self::Hemicube { resolution, points } => {
                let middle = |i: u32| (i as f32 + 0.5) / points as f32;
                let places: Vec<_> =
                    (0..points * points).map(|i| sample([middle(i % points), middle(i / points)])).collect();
                Hemicube::new(resolution).row(patch, &places, land, &mut Landings::default(), &mut row);
            }
            Self::Analytic => polygon_row(&world.polygons, patch as usize, 1e-10, &mut row),
        }
        row
    }

    /// Rows of all patches, as a source.
    pub fn source(self, world: &World) -> impl RowSource {
        Made::new(world.len(), move |patch, row: &mut Row| *row = self.row(world, patch as u32))
    }

    /// Rows of all patches, kept.
    pub fn rows(self, world: &World) -> Result<Rows> {
        Rows::collect(&self.source(world))
    }

    /// What bounds the error, in words; see [`Method::error`].
    pub fn why(self) -> &'static str {
        match self {
            Self::Rays(_) => {
                "4 standard deviations of a scrambled net's share, √(F(1 − F)) N^(−5/8): the indicator of a \
                 region of the 4-dimensional cube"
            }
            Self::Hemicube { .. } => {
                "the mean over a cell lies between its middle, where the cube stands, and its corners; edges cut a \
                 chain of pixels, half a pixel of √F"
            }
            Self::Analytic => "the tolerance asked for, 1e-9 of the factor",
        }
    }

    /// What tables call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rays(_) => "rays",
            Self::Hemicube { .. } => "hemicube",
            Self::Analytic => "analytic",
        }
    }

    /// F_ij, with row i alone.
    pub fn factor(self, world: &World, from: u32, to: u32) -> f64 {
        let row = self.row(world, from);
        row.column.binary_search(&to).map_or(0.0, |at| row.weight[at])
    }

    /// What the method states for a factor's error; `from` and `to` say where contact and variation are.
    ///
    /// * Rays: hits are the indicator of a region of the four-dimensional cube. For those, the standard deviation of
    ///   scrambled nets falls as N^(−1/2 − 1/(2·4)), from √(F(1 − F)) at one ray on. Four of them.
    /// * Hemicube: where the point factor bends one way over a cell, its mean lies between its middle and the mean of
    ///   its corners; a polygon's edge cuts a chain of pixels, which holds at most 1/resolution of the hemisphere, half
    ///   of it on the wrong side.
    /// * Analytic: the tolerance it was asked for.
    pub fn error(self, world: &World, from: u32, to: u32, factor: f64) -> f64 {
        match self {
            Self::Rays(rays) => 4.0 * (factor * (1.0 - factor)).sqrt() * f64::from(rays).powf(-0.625),
            Self::Hemicube { resolution, points } => {
                let polygon = &world.polygons[from as usize];
                let target = world.polygons[to as usize].corners();
                // Borders are seen from just inside: on them the other polygon may be edge on.
                let at = |i: u32, shift: f32| ((i as f32 + shift) / points as f32).clamp(1e-4, 1.0 - 1e-4);
                let seen = |x: f32, y: f32| {
                    let place = world.sample(from, [x, y]).position_world.as_dvec3();
                    point_to_polygon(place, polygon.normal(), target)
                };
                let cells = (0..points).flat_map(|y| (0..points).map(move |x| (x, y)));
                let apart = cells.map(|(x, y)| {
                    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
                    let mean = corners.iter().map(|&(u, v)| seen(at(x, u), at(y, v))).sum::<f64>() / 4.0;
                    (mean - seen(at(x, 0.5), at(y, 0.5))).abs()
                });
                let quadrature = apart.sum::<f64>() / f64::from(points * points);
                quadrature + 0.5 / f64::from(resolution) * factor.sqrt()
            }
            Self::Analytic => 1e-9 * factor,
        }
    }
}

/// The cube [0, size]³ seen from inside, each face cut into n × n: floor, ceiling, then the four walls.
pub fn cube(n: u32, size: f64) -> World {
    box_room(n, DVec3::splat(size))
}

/// The same with three different sides.
pub fn box_room(n: u32, size: DVec3) -> World {
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let mut world = World::default();
    let far = x + y + z;
    for (origin, u, v) in [
        (DVec3::ZERO, x, y),
        (far, -y, -x),
        (DVec3::ZERO, y, z),
        (far, -z, -y),
        (DVec3::ZERO, z, x),
        (far, -x, -z),
    ] {
        world.add_quad(origin, u, v, [n, n]);
    }
    world
}

/// Two parallel rectangles a × b at distance c, facing each other, the second shifted.
pub fn parallel(a: f64, b: f64, c: f64, shift: [f64; 2]) -> World {
    let mut world = World::default();
    world.add_quad(DVec3::ZERO, DVec3::X * a, DVec3::Y * b, [1, 1]);
    world.add_quad(dvec3(shift[0], shift[1], c), DVec3::Y * b, DVec3::X * a, [1, 1]);
    world
}

/// A floor of width w and length l, and a wall of height h on its edge of length l, moved `gap` beyond the edge and
/// `along` it.
pub fn perpendicular(h: f64, w: f64, l: f64, gap: f64, along: f64) -> World {
    let mut world = World::default();
    world.add_quad(DVec3::ZERO, DVec3::X * w, DVec3::Y * l, [1, 1]);
    world.add_quad(dvec3(-gap, along, 0.0), DVec3::Y * l, DVec3::Z * h, [1, 1]);
    world
}

/// A sphere seen from inside, or from outside: an octahedron, each face cut into n² triangles.
pub fn add_sphere(world: &mut World, radius: f64, n: u32, inside: bool) {
    let (position, triangles) = sphere(n, radius, inside, None);
    for corners in triangles {
        world.add_triangle(corners.map(|corner| position[corner as usize]));
    }
}

/// The same in all channels.
pub fn grey(value: f64) -> DVec3 {
    DVec3::splat(value)
}

/// n patches of equal area on a ring, each of which sees its neighbours in shares of 1/64: reciprocal, closed, and
/// exact in f32.
pub fn ring(patches: u32) -> Result<Rows> {
    let counts = [0u32, 20, 9, 3];
    let hits: Vec<Vec<(u32, u32)>> = (0..patches)
        .map(|i| {
            let neighbour =
                |step: u32, count| [((i + step) % patches, count), ((i + patches - step) % patches, count)];
            (1..4).flat_map(|step| neighbour(step, counts[step as usize])).collect()
        })
        .collect();
    Rows::from_counts(64, &hits, &vec![0; patches as usize])
}

/// Numbers in `[0, 1)`, the same at every run.
pub struct Numbers(pub u64);

impl Numbers {
    /// The next.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Three of them.
    pub fn colour(&mut self) -> DVec3 {
        dvec3(self.next(), self.next(), self.next())
    }
}
