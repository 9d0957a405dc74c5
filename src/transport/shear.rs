//! A ray as the triangles and the tree want it.

use super::Ray;
use super::tree::Block;
use glam::Vec3A;

/// Unit roundoff of f32: the relative error of one rounded operation.
pub(super) const UNIT: f32 = f32::EPSILON / 2.0;

/// A ray prepared once for all the triangles it may meet.
///
/// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The axis of the largest direction
/// component becomes z; a shear turns the ray into the z axis, so that the hit test is a 2D point-in-triangle test on
/// corners that every triangle around a vertex computes alike.
#[derive(Clone, Copy)]
pub(super) struct Sheared {
    /// Axis numbers: the first two span the projection, the third is the largest of the direction.
    pub axis: [usize; 3],
    /// Origin, ordered as `axis`.
    pub origin: [f32; 3],
    /// Direction over its largest component, along the first two axes.
    pub shear: [f32; 2],
    /// The largest component of the direction.
    pub z: f32,
}

/// A triangle met: what the hit test knows before anything is divided that may not be needed.
#[derive(Clone, Copy)]
pub(super) struct Meeting {
    /// Distance.
    pub t: f32,
    /// World triangle, with [`super::tree::ASK_BIT`].
    pub id: u32,
    /// Weight of the second corner, times `area`.
    pub v: f64,
    /// Weight of the third corner, times `area`.
    pub w: f64,
    /// Twice the signed area of the triangle in the projection.
    pub area: f64,
}

/// The distances a ray asks for, as the lanes see them: coordinates of the origin minus a corner along [`Sheared`]'s z.
///
/// A triangle's distance lies between those of its corners but for the rounding of a few operations in f64 and one
/// to f32, so 4u more or less of an end is on the safe side of it.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    /// No triangle beyond these can be met at a distance in `(0, t_max]`.
    pub widest: [f32; 2],
    /// Every triangle strictly within these is met at a distance in `(0, t_max)` if at all.
    pub surest: [f32; 2],
}

/// Axis numbers in the order of [`Sheared::axis`], by the last of them: a table is faster than choosing.
static AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

impl Sheared {
    /// `None` when the ray cannot meet anything: no direction, or a component that is not a number.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<Self> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let size = [d[0].abs(), d[1].abs(), d[2].abs()];
        let z = if size[0] > size[1] && size[0] > size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
        let axis = AXES[z];
        if size[z].is_nan() || size[z] == 0.0 {
            return None;
        }
        Some(Self {
            axis,
            origin: [o[axis[0]], o[axis[1]], o[axis[2]]],
            shear: [d[axis[0]] / d[z], d[axis[1]] / d[z]],
            z: d[z],
        })
    }

    /// What distances up to `t_max` are.
    #[inline(always)]
    pub fn reach(&self, t_max: f32) -> Reach {
        let end = -self.z * t_max;
        let (wide, sure) = (end * (1.0 + 4.0 * UNIT), end * (1.0 - 4.0 * UNIT));
        if self.z < 0.0 {
            Reach { widest: [0.0, wide], surest: [0.0, sure] }
        } else {
            Reach { widest: [wide, 0.0], surest: [sure, 0.0] }
        }
    }

    /// The exact hit test of one triangle of a block.
    ///
    /// The products of the projected corners are exact in f64 and so is the sign of their differences: a ray on a
    /// shared edge meets both triangles, never neither, and the weights have no cancellation error.
    #[inline(always)]
    pub fn meet(&self, block: Block, lane: usize) -> Option<Meeting> {
        let [az, bz, cz] = block.corners(self.axis[2], lane);
        let (az, bz, cz) = (az - self.origin[2], bz - self.origin[2], cz - self.origin[2]);
        let [ax, bx, cx] = block.corners(self.axis[0], lane);
        let [ay, by, cy] = block.corners(self.axis[1], lane);
        let sheared = |k: usize, at: f32, z: f32| f64::from((at - self.origin[k]) - self.shear[k] * z);
        let (ax, ay, az) = (sheared(0, ax, az), sheared(1, ay, az), f64::from(az));
        let (bx, by, bz) = (sheared(0, bx, bz), sheared(1, by, bz), f64::from(bz));
        let (cx, cy, cz) = (sheared(0, cx, cz), sheared(1, cy, cz), f64::from(cz));
        let u = bx * cy - by * cx;
        let v = cx * ay - cy * ax;
        let w = ax * by - ay * bx;
        let area = u + v + w;
        let t = ((u * az + v * bz + w * cz) / (area * f64::from(self.z))) as f32;
        let (least, most) = (least(least(u, v), w), most(most(u, v), w));
        let outside = (least < 0.0) & (most > 0.0);
        // The distance is not a number where the area is zero.
        (!outside && t > 0.0).then(|| Meeting { t, id: block.id(lane), v, w, area })
    }
}

/// One instruction where `f64::min`, which makes up for what is not a number, takes several.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A ray prepared for the boxes of a tree.
///
/// No box may be missed that holds a triangle the hit test meets. With u the unit roundoff, A a corner minus the
/// origin, S = d_x/d_z the shear and e_k the extents of the triangle, `fl(A_x − fl(S fl(A_z)))` is off, to first
/// order, by u|A_x| for the first difference, 3u|S A_z| for the second, the shear and the product, and u times the
/// result, which is at most e_x + |S|e_z where the test meets, since the origin is then inside the projection. A point
/// of the triangle at distance t along the ray has |A_x| ≤ t|d_x| + e_x and |S A_z| ≤ t|d_x| + |S|e_z. So the ray as
/// the test sees it passes the exact triangle no farther than 4ut|d_x| + 2ue_x + 4u|S|e_z from where it is, along x,
/// and likewise along y.
/// - The first term is a relative error of the distance, as is the rounding of the slab distances, 4u: boxes are
///   entered 9u earlier and left 10u later, which is what f32 can say.
/// - The others are built into the boxes: [`super::build::padded`].
/// - A slab distance is b/d − o/d with o/d made beforehand. Its rounding is at most that of b/d, which is
///   u|b − o|/|d| + u|o|/|d|, and that of o/d, as if the origin were off by 2u|o|; the origin is moved by 4u|o|.
#[derive(Clone, Copy)]
pub(super) struct Slabs {
    /// Reciprocal direction for the planes where the ray enters boxes, per world axis.
    pub enter: [f32; 3],
    /// Origin times `enter`, less its rounding.
    pub enter_offset: [f32; 3],
    /// The same for the planes where it leaves boxes.
    pub leave: [f32; 3],
    /// Origin times `leave`, plus its rounding.
    pub leave_offset: [f32; 3],
    /// Whether the direction is negative, per world axis.
    pub negative: [bool; 3],
}

/// Direction components below this are taken as this: their reciprocal stays finite and over any lawful distance
/// (see [`super::world::FARTHEST`]) they move a ray by less than the padding.
const SMALLEST: f32 = 1e-18;

impl Slabs {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let inverse = (1.0 / direction.abs().max(Vec3A::splat(SMALLEST))).copysign(direction);
        let (enter, leave) = (inverse * (1.0 - 9.0 * UNIT), inverse * (1.0 + 10.0 * UNIT));
        let rounding = (origin.abs() * (4.0 * UNIT)).copysign(direction);
        Self {
            enter: enter.to_array(),
            enter_offset: ((origin + rounding) * enter).to_array(),
            leave: leave.to_array(),
            leave_offset: ((origin - rounding) * leave).to_array(),
            negative: [
                ray.direction.x.is_sign_negative(),
                ray.direction.y.is_sign_negative(),
                ray.direction.z.is_sign_negative(),
            ],
        }
    }
}
