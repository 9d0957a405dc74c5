//! A ray as the tree and the triangles want it.

use super::Ray;
use super::tree::{Block, Tree};

/// Unit roundoff of f32: the relative error of one rounded operation.
pub(super) const UNIT: f32 = f32::EPSILON / 2.0;

/// A ray prepared once for all the boxes and triangles it may meet.
///
/// Triangles: Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The axis of the
/// largest direction component becomes z; a shear turns the ray into the z axis, so that the hit test is a 2D
/// point-in-triangle test on corners that every triangle around a vertex computes alike.
///
/// Boxes: a triangle that the test hits may lie beside the exact ray by the rounding of the sheared corners. With u
/// the unit roundoff, A a corner minus the origin and |S| ≤ 1 the shear, fl(A_x − fl(S fl(A_z))) is off by at most
/// 2u|A_x| + 4u|A_z| (first order: u each for A_x, the final difference, A_z, S and the product). The slab distances
/// (b − o)/d are off by 3u|b − o| more, seen along the axis. Moving the near planes' origin up and the far planes'
/// origin down the ray by 8u(M_k + M_z), with M the largest distance from the origin to the world's bounds per axis,
/// covers both at no cost inside the loop. 2u|o| is added because the moved origin is itself rounded.
pub(super) struct Sheared {
    /// Axis numbers: the first two span the projection, the third is the largest of the direction.
    pub axis: [usize; 3],
    /// Origin, ordered as `axis`.
    pub origin: [f32; 3],
    /// Direction over its largest component, along the first two axes.
    pub shear: [f32; 2],
    /// The largest component of the direction.
    pub z: f32,
    /// Origin for the planes where the ray enters boxes, per world axis.
    pub near_origin: [f32; 3],
    /// Origin for the planes where the ray leaves boxes, per world axis.
    pub far_origin: [f32; 3],
    /// 1 / direction per world axis, finite.
    pub inverse: [f32; 3],
    /// Whether the direction is negative, per world axis.
    pub negative: [bool; 3],
}

/// A triangle met: what the hit test knows before the triangle is named.
#[derive(Clone, Copy)]
pub(super) struct Meeting {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub front: bool,
}

impl Sheared {
    /// `None` when the ray cannot meet anything: no direction, or a component that is not a number.
    #[inline(always)]
    pub fn new(ray: &Ray, tree: &Tree) -> Option<Self> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let size = d.map(f32::abs);
        let z = if size[0] > size[1] && size[0] > size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
        let axis = [(z + 1) % 3, (z + 2) % 3, z];
        if size[z] == 0.0 || size[z].is_nan() {
            return None;
        }
        let reach: [f32; 3] =
            std::array::from_fn(|k| (tree.low[k] - o[k]).abs().max((tree.high[k] - o[k]).abs()));
        let pad: [f32; 3] =
            std::array::from_fn(|k| 8.0 * UNIT * (reach[k] + reach[z]) + 2.0 * UNIT * o[k].abs());
        let negative = d.map(|d| d < 0.0);
        let toward = |k: usize, sign: f32| if negative[k] { -sign * pad[k] } else { sign * pad[k] };
        Some(Self {
            axis,
            origin: axis.map(|k| o[k]),
            shear: [d[axis[0]] / d[z], d[axis[1]] / d[z]],
            z: d[z],
            near_origin: std::array::from_fn(|k| o[k] + toward(k, 1.0)),
            far_origin: std::array::from_fn(|k| o[k] + toward(k, -1.0)),
            inverse: d.map(|d| if d.abs() < SMALLEST { 1.0 / SMALLEST.copysign(d) } else { 1.0 / d }),
            negative,
        })
    }

    /// The exact hit test of one triangle of a block that the lanes could not rule out.
    ///
    /// The products of the projected corners are exact in f64 and so is the sign of their differences: a ray on a
    /// shared edge meets both triangles, never neither, and the weights have no cancellation error.
    #[inline(always)]
    pub fn meet(&self, block: &Block, lane: usize) -> Option<Meeting> {
        let corner = |c: usize| {
            let at = |k: usize| block.corner[self.axis[k]][c][lane] - self.origin[k];
            let (x, y, z) = (at(0), at(1), at(2));
            (f64::from(x - self.shear[0] * z), f64::from(y - self.shear[1] * z), f64::from(z))
        };
        let (ax, ay, az) = corner(0);
        let (bx, by, bz) = corner(1);
        let (cx, cy, cz) = corner(2);
        let u = bx * cy - by * cx;
        let v = cx * ay - cy * ax;
        let w = ax * by - ay * bx;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let area = u + v + w;
        if area == 0.0 {
            return None;
        }
        let z = f64::from(self.z);
        let t = ((u * az + v * bz + w * cz) / (area * z)) as f32;
        (t > 0.0).then(|| Meeting {
            t,
            u: (v / area) as f32,
            v: (w / area) as f32,
            front: (area > 0.0) == (z < 0.0),
        })
    }
}

/// Direction components below this are taken as this: their reciprocal stays finite and over any lawful distance
/// (see [`super::world::FARTHEST`]) they move a ray by less than the padding.
const SMALLEST: f32 = 1e-18;
