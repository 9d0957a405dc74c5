//! Light from emissive surfaces: Lambert's polygon formula near, a few points per polygon further away, one far.

use super::{Emitter, Receiver, ShadowRay};
use crate::transport::form_factors::polygon::point_to_polygon_shaded;
use crate::transport::{Shaft, segment_to_surface};
use crate::units::Irradiance;
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

/// Beyond this many diameters a polygon counts as its centroid: the next term of the expansion of cosθ cosθ'/d² about
/// the centroid is of order (radius/distance)², with a factor of about two: under 0.1 % of what arrives from overhead.
const FAR_DIAMETERS: f32 = 24.0;

/// Beyond this many radii a Gauss rule replaces the closed form, where the whole polygon is above the horizon: two by
/// two points of a quad, six of a triangle (Strang & Fix 1973). What it leaves out is of the fourth order in radius
/// over distance: below 0.1 % of what a receiver that faces the polygon gets, for sides up to 1 : 4.
const GAUSS_RADII: f32 = 6.0;

/// A flat, convex, evenly bright piece of an emissive surface with three or four corners.
#[derive(Clone, Debug)]
pub struct Polygon {
    corners: [DVec3; 4],
    count: usize,
    centre: Vec3,
    normal: Vec3,
    area: f32,
    far_squared: f32,
    gauss_squared: f32,
    /// Points of the Gauss rule with the area each stands for; unused ones stand for none.
    gauss: [(Vec3, f32); 6],
    radiance: Vec3,
    /// Corners of the box around the triangles it is a part of: what a ray that ends on it must stay clear of.
    support: [Vec3; 3],
}

impl Polygon {
    /// Three or four corners, counter-clockwise from the lit side; `None` when it has no area.
    pub fn new(corners: &[Vec3], radiance: Vec3) -> Option<Self> {
        let count = corners.len();
        debug_assert!((3..=4).contains(&count));
        let fixed: [DVec3; 4] = std::array::from_fn(|i| corners[i.min(count - 1)].as_dvec3());
        let first = (fixed[1] - fixed[0]).cross(fixed[2] - fixed[0]);
        let second = (fixed[2] - fixed[0]).cross(fixed[3] - fixed[0]);
        let twice = first + second;
        let normal = twice.try_normalize()?;
        let centre = {
            let (a, b) = (first.length(), second.length());
            let middle = |i: usize, j: usize, k: usize| (fixed[i] + fixed[j] + fixed[k]) / 3.0;
            (middle(0, 1, 2) * a + middle(0, 2, 3) * b) / (a + b)
        };
        let radius_squared = fixed.iter().map(|c| c.distance_squared(centre)).fold(0.0, f64::max) as f32;
        Some(Self {
            corners: fixed,
            count,
            centre: centre.as_vec3(),
            normal: normal.as_vec3(),
            area: (twice.length() / 2.0) as f32,
            far_squared: 4.0 * FAR_DIAMETERS * FAR_DIAMETERS * radius_squared,
            gauss_squared: GAUSS_RADII * GAUSS_RADII * radius_squared,
            gauss: gauss(&fixed[..count]),
            radiance,
            support: support(corners),
        })
    }

    /// The same polygon as a part of a larger triangle.
    pub fn part_of(self, triangle: &[Vec3; 3]) -> Self {
        Self { support: support(triangle), ..self }
    }

    /// Configuration factor seen from the receiver, unoccluded: E = πL·F.
    fn factor(&self, receiver: &Receiver) -> f32 {
        let to = self.centre - receiver.position_world;
        let facing = -to.dot(self.normal);
        let distance_squared = to.length_squared();
        if distance_squared > self.far_squared {
            let cosine = to.dot(receiver.normal_shading);
            if facing <= 0.0 || cosine <= 0.0 {
                return 0.0;
            }
            return cosine * facing * self.area / (PI * distance_squared * distance_squared);
        }
        let corners = &self.corners[..self.count];
        if distance_squared > self.gauss_squared && self.is_above_horizon(receiver) {
            let terms = self.gauss.iter().map(|&(point, area)| {
                let to = point - receiver.position_world;
                let distance_squared = to.length_squared();
                let cosines = to.dot(receiver.normal_shading) * -to.dot(self.normal);
                cosines * area / (distance_squared * distance_squared)
            });
            return terms.sum::<f32>().max(0.0) / PI;
        }
        point_to_polygon_shaded(
            receiver.position_world.as_dvec3(),
            receiver.normal_geometric.as_dvec3(),
            receiver.normal_shading.as_dvec3(),
            corners,
        ) as f32
    }

    /// Whether a receiver sees all of it, as far as its own two planes go.
    fn is_above_horizon(&self, receiver: &Receiver) -> bool {
        self.corners[..self.count].iter().all(|corner| {
            let to = corner.as_vec3() - receiver.position_world;
            to.dot(receiver.normal_geometric) > 0.0 && to.dot(receiver.normal_shading) > 0.0
        })
    }

    /// Power sent out per channel mean, up to a factor π.
    pub fn strength(&self) -> f32 {
        self.radiance.element_sum() * self.area
    }

    /// The same polygon, lit on the other side.
    pub fn flipped(&self) -> Option<Self> {
        let mut corners: Vec<Vec3> = self.corners[..self.count].iter().map(|c| c.as_vec3()).collect();
        corners.reverse();
        Self::new(&corners, self.radiance).map(|p| Self { support: self.support, ..p })
    }

    /// Middle of the polygon.
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    /// Unit normal of the lit side.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    fn point(&self, u: f32, v: f32) -> Vec3 {
        let [a, b, c, d] = self.corners;
        let (u, v) = (f64::from(u), f64::from(v));
        if self.count == 4 && (a + c - b - d).length_squared() <= 1e-10 * (c - a).length_squared() {
            return (a + (b - a) * u + (d - a) * v).as_vec3();
        }
        let triangle = |p: DVec3, q: DVec3, r: DVec3, u: f64| {
            let root = u.sqrt();
            (p * (1.0 - root) + q * (root * (1.0 - v)) + r * (root * v)).as_vec3()
        };
        if self.count == 3 {
            return triangle(a, b, c, u);
        }
        let first = (b - a).cross(c - a).length();
        let share = first / (first + (c - a).cross(d - a).length());
        if u < share { triangle(a, b, c, u / share) } else { triangle(a, c, d, (u - share) / (1.0 - share)) }
    }
}

fn gauss(corners: &[DVec3]) -> [(Vec3, f32); 6] {
    if let &[a, b, c] = corners {
        let area = (b - a).cross(c - a).length() / 2.0;
        // Abscissa of two corners and weight.
        let rule =
            [(0.445_948_490_915_965, 0.223_381_589_678_011), (0.091_576_213_509_771, 0.109_951_743_655_322)];
        return std::array::from_fn(|i| {
            let (side, weight) = rule[i / 3];
            let apex = [a, b, c][i % 3];
            ((apex * (1.0 - 3.0 * side) + (a + b + c) * side).as_vec3(), (area * weight) as f32)
        });
    }
    let &[a, b, c, d] = corners else { return [(Vec3::ZERO, 0.0); 6] };
    let near = 0.5 - 0.5 / 3f64.sqrt();
    std::array::from_fn(|i| {
        if i >= 4 {
            return (a.as_vec3(), 0.0);
        }
        let (s, t) = ([near, 1.0 - near][i % 2], [near, 1.0 - near][i / 2]);
        let (along, across) = ((b - a).lerp(c - d, t), (d - a).lerp(c - b, s));
        let point = (a + (b - a) * s) * (1.0 - t) + (d + (c - d) * s) * t;
        (point.as_vec3(), (along.cross(across).length() / 4.0) as f32)
    })
}

fn support(corners: &[Vec3]) -> [Vec3; 3] {
    let (low, high) =
        corners.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
    [low, high, low]
}

/// Neighbouring polygons of one surface that share their shadow rays.
pub struct AreaEmitter {
    polygons: Vec<Polygon>,
    /// Running share of the strength, ends with 1.
    cumulative: Vec<f32>,
    /// Lowest and highest corner.
    bounds: [Vec3; 2],
    /// Where all polygons face one way: their normal, and the height along it of the lowest.
    facing: Option<(Vec3, f64)>,
}

impl AreaEmitter {
    /// `None` when nothing shines.
    pub fn new(polygons: Vec<Polygon>) -> Option<Self> {
        let total: f64 = polygons.iter().map(|p| f64::from(p.strength())).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut sum = 0.0;
        let cumulative = polygons
            .iter()
            .map(|p| {
                sum += f64::from(p.strength());
                (sum / total) as f32
            })
            .collect();
        Some(Self::of(polygons, cumulative))
    }

    fn of(polygons: Vec<Polygon>, cumulative: Vec<f32>) -> Self {
        let corners = polygons.iter().flat_map(|p| &p.corners[..p.count]);
        let (low, high) = corners
            .map(|c| c.as_vec3())
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        let normal = polygons[0].normal;
        // Of one polygon the highest corner, as its own triangles are at most that high; of all the lowest one.
        let height_of = |p: &Polygon| {
            let heights = p.corners[..p.count].iter().map(|c| c.dot(normal.as_dvec3()));
            heights.fold(f64::NEG_INFINITY, f64::max)
        };
        let height = || polygons.iter().map(height_of).fold(f64::INFINITY, f64::min);
        let facing = polygons.iter().all(|p| p.normal == normal).then(|| (normal, height()));
        Self { polygons, cumulative, bounds: [low, high], facing }
    }

    /// One polygon that sends nothing; `None` when it has no area.
    pub fn black(corners: &[Vec3]) -> Option<Self> {
        Some(Self::of(vec![Polygon::new(corners, Vec3::ZERO)?], vec![1.0]))
    }

    /// A point amid the polygons.
    pub fn centre(&self) -> Vec3 {
        self.polygons.iter().map(Polygon::centre).sum::<Vec3>() / self.polygons.len() as f32
    }
}

impl Emitter for AreaEmitter {
    fn unoccluded(&self, receiver: &Receiver) -> Irradiance {
        let mut sum = Vec3::ZERO;
        for polygon in &self.polygons {
            // Behind the polygon, or wholly below the receiver's plane: nothing.
            let to = polygon.centre - receiver.position_world;
            if to.dot(polygon.normal) < 0.0 {
                sum += polygon.radiance * polygon.factor(receiver);
            }
        }
        Irradiance(sum * PI)
    }

    fn shadow_ray(&self, receiver: &Receiver, [u, v]: [f32; 2]) -> Option<ShadowRay> {
        let last = self.polygons.len() - 1;
        let i = self.cumulative.partition_point(|&c| c <= u).min(last);
        let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        let u = ((u - before) / (self.cumulative[i] - before).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let polygon = &self.polygons[i];
        let target = polygon.point(u, v);
        let origin = receiver.origin_world;
        let to = target - origin;
        let (facing, cosine) = (-to.dot(polygon.normal), to.dot(receiver.normal_shading));
        if facing <= 0.0 || cosine <= 0.0 || to.dot(receiver.normal_geometric) <= 0.0 {
            return None;
        }
        let distance_squared = to.length_squared();
        let per_strength = polygon.radiance / polygon.radiance.element_sum();
        let weight = per_strength * (cosine * facing / (distance_squared * distance_squared));
        Some(ShadowRay { ray: segment_to_surface(origin, target, polygon.normal, &polygon.support), weight })
    }

    fn is_sharp(&self) -> bool {
        false
    }

    fn shaft(&self, from: [Vec3; 2], _: [Vec3; 2]) -> Shaft {
        // Rays end raised above the emitter by more than its own corners are off its plane.
        let shaft = Shaft::new(from, self.bounds);
        match self.facing {
            Some((normal, height)) => shaft.above(normal, height),
            None => shaft,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::sobol4;
    use crate::transport::form_factors::polygon::point_to_polygon;

    #[test]
    fn few_points_do_where_the_polygon_is_far() {
        let quad = [Vec3::ZERO, Vec3::X * 4.0, Vec3::new(4.0, 1.0, 0.0), Vec3::Y];
        let uneven = [Vec3::ZERO, Vec3::X * 3.0, Vec3::new(2.0, 1.0, 0.0), Vec3::Y];
        let triangle = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y];
        for corners in [&quad[..], &uneven, &triangle] {
            let polygon = Polygon::new(corners, Vec3::ONE).expect("it has an area");
            let exact: Vec<DVec3> = corners.iter().map(|c| c.as_dvec3()).collect();
            let radius = polygon.gauss_squared.sqrt() / GAUSS_RADII;
            for [a, b, c, d] in sobol4(4096, 0, 17) {
                let sphere = |a: f32, b: f32| {
                    let (z, (sin, cos)) = (2.0 * a - 1.0, (2.0 * PI * b).sin_cos());
                    Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
                };
                let away = sphere(a * 0.5 + 0.5, b);
                let distance = radius * (GAUSS_RADII * 1.0001 + 30.0 * c * a * 2.0);
                let position_world = polygon.centre + away * distance;
                let normal = sphere(c, d);
                let receiver = Receiver {
                    position_world,
                    origin_world: position_world,
                    normal_shading: normal,
                    normal_geometric: normal,
                };
                let truth = point_to_polygon(position_world.as_dvec3(), normal.as_dvec3(), &exact) as f32;
                let error = (polygon.factor(&receiver) - truth).abs();
                assert!(error <= 1e-3 * polygon.area / (PI * distance * distance), "{error} at {distance}");
            }
        }
    }
}
