//! Small worlds with closed answers, traced by looking at every surface: what the tests of form factors and solvers
//! share. Not every test binary uses all of it.
#![allow(dead_code)]

use glam::{DVec3, dvec3};
use lightkiln::solve::{Made, RowSource, Rows};
use lightkiln::transport::Ray;
use lightkiln::transport::form_factors::area::{Polygon, polygon_row};
use lightkiln::transport::form_factors::hemicube::Hemicube;
use lightkiln::transport::form_factors::polygon::point_to_polygon;
use lightkiln::transport::form_factors::rays::ray_row;
use lightkiln::transport::form_factors::{Landings, Row, SurfacePoint};

/// A parallelogram cut into columns × rows patches, or a triangle, which is one.
#[derive(Clone)]
pub struct Surface {
    pub origin: DVec3,
    pub u: DVec3,
    pub v: DVec3,
    pub grid: Option<[u32; 2]>,
    first_patch: u32,
}

/// Surfaces that face their normal, u × v, with patches numbered through.
#[derive(Clone, Default)]
pub struct World {
    pub surfaces: Vec<Surface>,
    pub polygons: Vec<Polygon>,
    owner: Vec<u32>,
}

impl World {
    pub fn add_quad(&mut self, origin: DVec3, u: DVec3, v: DVec3, grid: [u32; 2]) {
        let first_patch = self.polygons.len() as u32;
        let at = |x: u32, y: u32| {
            origin + u * (f64::from(x) / f64::from(grid[0])) + v * (f64::from(y) / f64::from(grid[1]))
        };
        for y in 0..grid[1] {
            for x in 0..grid[0] {
                self.polygons.push(
                    Polygon::new(vec![at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]).unwrap(),
                );
                self.owner.push(self.surfaces.len() as u32);
            }
        }
        self.surfaces.push(Surface { origin, u, v, grid: Some(grid), first_patch });
    }

    pub fn add_triangle(&mut self, corners: [DVec3; 3]) {
        let first_patch = self.polygons.len() as u32;
        self.polygons.push(Polygon::new(corners.to_vec()).unwrap());
        self.owner.push(self.surfaces.len() as u32);
        let [origin, b, c] = corners;
        self.surfaces.push(Surface { origin, u: b - origin, v: c - origin, grid: None, first_patch });
    }

    pub fn len(&self) -> usize {
        self.polygons.len()
    }

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
    Rays(u32),
    Hemicube { resolution: u32, points: u32 },
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

    pub fn rows(self, world: &World) -> Rows {
        Rows::collect(&self.source(world)).unwrap()
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
    /// * Hemicube: midpoints of n × n places miss at most the variation of the point factor over 2n, along both axes;
    ///   a polygon's edge cuts a chain of pixels, which holds at most 1/resolution of the hemisphere, half of it on
    ///   the wrong side.
    /// * Analytic: the tolerance it was asked for.
    pub fn error(self, world: &World, from: u32, to: u32, factor: f64) -> f64 {
        match self {
            Self::Rays(rays) => 4.0 * (factor * (1.0 - factor)).sqrt() * f64::from(rays).powf(-0.625),
            Self::Hemicube { resolution, points } => {
                let polygon = &world.polygons[from as usize];
                let target = world.polygons[to as usize].corners();
                // Borders are seen from just inside: on them the other polygon may be edge on.
                let inner = |i: u8| (f32::from(i) / 8.0).clamp(1e-4, 1.0 - 1e-4);
                let values: Vec<f64> = (0..=8)
                    .flat_map(|x| (0..=8).map(move |y| [inner(x), inner(y)]))
                    .map(|at| world.sample(from, at).position_world.as_dvec3())
                    .map(|at| point_to_polygon(at, polygon.normal(), target))
                    .collect();
                let variation = values.iter().copied().fold(0.0, f64::max)
                    - values.iter().copied().fold(f64::INFINITY, f64::min);
                2.0 * variation / (2.0 * f64::from(points)) + 0.5 / f64::from(resolution) * factor.sqrt()
            }
            Self::Analytic => 1e-9 * factor,
        }
    }
}

/// The cube [0, size]³ seen from inside, each face cut into n × n: floor, ceiling, then the four walls.
pub fn cube(n: u32, size: f64) -> World {
    box_room(n, DVec3::splat(size))
}

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
pub fn sphere(world: &mut World, radius: f64, n: u32, inside: bool) {
    for octant in 0..8 {
        let sign = dvec3(
            if octant & 1 == 0 { 1.0 } else { -1.0 },
            if octant & 2 == 0 { 1.0 } else { -1.0 },
            if octant & 4 == 0 { 1.0 } else { -1.0 },
        );
        let at = |i: u32, j: u32| {
            let k = n - i - j;
            (dvec3(f64::from(i), f64::from(j), f64::from(k)) * sign).normalize() * radius
        };
        let mut add = |a: DVec3, b: DVec3, c: DVec3| {
            let outward = (b - a).cross(c - a).dot(a) > 0.0;
            world.add_triangle(if outward == inside { [a, c, b] } else { [a, b, c] });
        };
        for i in 0..n {
            for j in 0..n - i {
                add(at(i, j), at(i + 1, j), at(i, j + 1));
                if i + j + 1 < n {
                    add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                }
            }
        }
    }
}

/// The same in all channels.
pub fn grey(value: f64) -> DVec3 {
    DVec3::splat(value)
}
