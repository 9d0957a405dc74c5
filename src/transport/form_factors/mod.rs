//! Form factors: the fraction of the power leaving one surface that arrives at another.
//!
//! [`polygon`] and [`area`] are closed forms for what nothing stands between; [`rays`] and [`hemicube`] sample a
//! patch's whole row at once and learn from the caller's tracer where each ray lands. They know patches by number.

pub mod area;
pub mod hemicube;
pub mod polygon;
pub mod rays;

mod contour;
mod lambert;
mod sobol;

use glam::Vec3;

/// A point of a patch that rays leave from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// World metres, already lifted off the surface as far as its rounding demands.
    pub position_world: Vec3,
    /// Unit normal of the plane, on the side the patch lies on.
    pub normal: Vec3,
}

/// One patch's form factors: what its rays met, by patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// The patches that were met, ascending.
    pub column: Vec<u32>,
    /// The form factor to each of them.
    pub weight: Vec<f64>,
    /// The share that escapes from the scene. What is missing to 1 after the factors and this was lost on surfaces
    /// that are no patch: back faces, the unlit.
    pub miss: f64,
    /// Mean radiance that came from beyond the scene along the rays, W/(m² sr): the patch receives π times it.
    pub beyond: [f64; 3],
}

impl Row {
    /// Forgets everything, keeps the memory.
    pub fn clear(&mut self) {
        self.column.clear();
        self.weight.clear();
        self.miss = 0.0;
        self.beyond = [0.0; 3];
    }
}

/// Collects where the rays of one patch land.
#[derive(Clone, Debug, Default)]
pub struct Landings {
    /// Share of the patch's power that the current ray stands for.
    ray: f64,
    hits: Vec<(u32, f64)>,
    miss: f64,
    beyond: [f64; 3],
}

impl Landings {
    /// Room for as many rays.
    pub fn for_rays(rays: u32) -> Self {
        Self { hits: Vec::with_capacity(rays as usize), ..Self::default() }
    }

    /// `share` of the current ray arrives at the lit side of `patch`. Shares of a ray add up to 1 at most; what is
    /// told to nobody counts as lost.
    pub fn hit(&mut self, patch: u32, share: f32) {
        self.hits.push((patch, self.ray * f64::from(share)));
    }

    /// `share` of the current ray leaves the scene, from where `radiance` arrives, W/(m² sr).
    pub fn miss(&mut self, share: f32, radiance: [f32; 3]) {
        let share = self.ray * f64::from(share);
        self.miss += share;
        for (sum, radiance) in self.beyond.iter_mut().zip(radiance) {
            *sum += share * f64::from(radiance);
        }
    }

    /// Begins the row of another patch.
    fn clear(&mut self) {
        self.hits.clear();
        self.miss = 0.0;
        self.beyond = [0.0; 3];
    }

    /// Adds up what landed on the same patch. The order of equal patches stays, so sums repeat to the bit.
    fn write(&mut self, row: &mut Row) {
        row.clear();
        self.hits.sort_by_key(|hit| hit.0);
        for same in self.hits.chunk_by(|a, b| a.0 == b.0) {
            row.column.push(same[0].0);
            row.weight.push(same.iter().map(|hit| hit.1).sum());
        }
        row.miss = self.miss;
        row.beyond = self.beyond;
    }
}

/// Two unit vectors that make a right-handed frame with the unit `normal` (Duff et al. 2017, *Building an orthonormal
/// basis, revisited*).
fn tangents(normal: Vec3) -> (Vec3, Vec3) {
    let sign = 1f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}
