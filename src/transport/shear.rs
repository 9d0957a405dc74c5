//! A ray as the triangles and the tree want it.

use super::Ray;
use super::tree::{Block, Tree};
use glam::{BVec3A, Vec3A};

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
        let size = d.map(f32::abs);
        let z = if size[0] > size[1] && size[0] > size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
        let axis = AXES[z];
        if size[z].is_nan() || size[z] == 0.0 {
            return None;
        }
        Some(Self {
            axis,
            origin: axis.map(|k| o[k]),
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
        let corner = |c: usize| {
            let at = |k: usize| block.coordinate(self.axis[k], c, lane) - self.origin[k];
            let (x, y, z) = (at(0), at(1), at(2));
            (f64::from(x - self.shear[0] * z), f64::from(y - self.shear[1] * z), f64::from(z))
        };
        let (ax, ay, az) = corner(0);
        let (bx, by, bz) = corner(1);
        let (cx, cy, cz) = corner(2);
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
/// origin and |S| ≤ 1 the shear, `fl(A_x − fl(S fl(A_z)))` is off by at most 2u|A_x| + 4u|A_z| (first order: u for
/// A_x, the last difference, A_z, S and the product). So where the test hits, the exact triangle has a point no farther
/// than that from the exact ray, along x and y only. Let it be at distance t and let the triangle's box measure at
/// most e along any axis: |A_k| ≤ t|d_k| + e, and the bound becomes 6ut|d_z| + 6ue.
/// - The second term is built into the boxes: [`BOX_PAD`].
/// - The first grows with t: it is a change of direction. The ray becomes a cone of directions d_k ± δ with
///   δ = 8u|d_z|, entering boxes as if it were faster and leaving them as if it were slower. Rounding in the slab
///   distances is in the reciprocals too.
/// - Along an axis where |d_k| < 4δ the cone would spread to both sides. There the origin is widened to o ± 48u r
///   instead, r being the reach of the world along z, and the ray is taken as parallel.
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

/// Boxes of triangles are larger on every side by this share of their longest side, see [`Slabs`].
pub(super) const BOX_PAD: f32 = 8.0 * UNIT;

/// Stands for the reciprocal of a direction component that is as good as zero: over any lawful distance (see
/// [`super::world::FARTHEST`]) products with it are finite.
const PARALLEL: f32 = 1e18;

impl Slabs {
    #[inline(always)]
    pub fn new(ray: &Ray, sheared: &Sheared, tree: &Tree) -> Self {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let size = direction.abs();
        // The largest component is the one along z: no need to wait for the choice of axes.
        let cone = 8.0 * UNIT * size.max_element();
        let mut enter = ((1.0 - 6.0 * UNIT) / (size + cone)).copysign(direction);
        let mut leave = ((1.0 + 6.0 * UNIT) / (size - cone)).copysign(direction);
        let rounding = 4.0 * UNIT * origin.abs();
        let mut near = rounding.copysign(direction);
        let parallel: BVec3A = size.cmplt(Vec3A::splat(4.0 * cone));
        if parallel.any() {
            let z = sheared.axis[2];
            let reach = (tree.low[z] - ray.origin[z]).abs().max((tree.high[z] - ray.origin[z]).abs());
            let wide = (rounding + 48.0 * UNIT * reach).copysign(direction);
            let along = Vec3A::splat(PARALLEL).copysign(direction);
            near = Vec3A::select(parallel, wide, near);
            enter = Vec3A::select(parallel, along, enter);
            leave = Vec3A::select(parallel, along, leave);
        }
        Self {
            enter: enter.to_array(),
            enter_offset: ((origin + near) * enter).to_array(),
            leave: leave.to_array(),
            leave_offset: ((origin - near) * leave).to_array(),
            negative: ray.direction.to_array().map(f32::is_sign_negative),
        }
    }
}
