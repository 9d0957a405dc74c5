//! What a point of a surface sends to the eye.

use crate::baked::Baked;
use crate::scene::{Scene, SurfacePoint};
use crate::transport::{Hit, Ray, Tracer};
use glam::{Vec2, Vec3};

/// Transparent or turned-away surfaces that a look passes, at the most.
const MOST_LAYERS: usize = 64;

/// How surfaces look.
pub(crate) trait Look: Sync {
    /// Radiance towards the eye.
    fn radiance(&self, at: SurfacePoint, direction: Vec3) -> Vec3;

    /// What is seen where nothing is.
    fn background(&self, direction: Vec3) -> Vec3;
}

/// What a ray saw.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Radiance.
    pub radiance: Vec3,
    /// Whether a surface had a part in it.
    pub surface: bool,
}

/// Follows a ray through everything that lets the eye pass: the backs of single-sided surfaces, as glTF says, holes,
/// and blended surfaces, which cover the share of their alpha.
pub(crate) fn look<T: Tracer, L: Look>(scene: &Scene, tracer: &T, look: &L, ray: Ray) -> Seen {
    let world = tracer.world();
    let mut seen = Seen::default();
    let (mut left, mut ray) = (1.0_f32, ray);
    for _ in 0..MOST_LAYERS {
        let Some(hit) = tracer.closest(&ray) else { break };
        let at = world.surface_point(&hit);
        let surface = &scene.surfaces[at.surface as usize];
        if hit.front || scene.material(surface).double_sided {
            let opacity = scene.opacity(at).0;
            seen.radiance += look.radiance(at, ray.direction) * (left * opacity);
            seen.surface = true;
            left *= 1.0 - opacity;
            if left <= 0.0 {
                return seen;
            }
        }
        let Some(beyond) = beyond(scene, tracer, &ray, &hit, at) else { return seen };
        ray = beyond;
    }
    seen.radiance += look.background(ray.direction) * left;
    seen
}

/// The rest of a ray behind a surface; `None` where it has ended.
fn beyond<T: Tracer>(scene: &Scene, tracer: &T, ray: &Ray, hit: &Hit, at: SurfacePoint) -> Option<Ray> {
    let world = tracer.world();
    let normal = world.normal(hit.triangle);
    let away = if hit.front { -normal } else { normal };
    let origin = world.offset_origin(hit.triangle, scene.position(at), away);
    let t_max = ray.t_max - hit.t;
    (t_max > 0.0).then_some(Ray { origin, direction: ray.direction, t_max })
}

/// The lit scene: reflectance × lightmap + own emission.
pub(crate) struct Lit<'a> {
    baked: &'a Baked,
    /// What surfaces without a lightmap are lit with: the mean of all others' light, E/π.
    elsewhere: Vec3,
}

impl<'a> Lit<'a> {
    /// The light of a baked file.
    pub fn new(baked: &'a Baked) -> Self {
        let bare = baked.lightmaps.iter().any(Option::is_none);
        Self { baked, elsewhere: if bare { mean_white_radiance(baked) } else { Vec3::ZERO } }
    }
}

impl Look for Lit<'_> {
    fn radiance(&self, at: SurfacePoint, _: Vec3) -> Vec3 {
        let scene = &self.baked.scene;
        let index = at.surface as usize;
        if scene.material(&scene.surfaces[index]).unlit {
            return scene.color(at).truncate();
        }
        let stored = self.baked.lightmaps[index].and_then(|lightmap| {
            let page = &self.baked.pages[lightmap.page];
            Some((page.sample(scene.texcoord(at, lightmap.texcoord)?), page.white_radiance_scale()))
        });
        let white = match stored {
            // b = ρE + e: colour and emission are in it.
            Some((radiosity, None)) => return radiosity / std::f32::consts::PI,
            Some((value, Some(scale))) => value * scale,
            None => self.elsewhere,
        };
        scene.reflectance(at).0 * white + scene.emission(at).0
    }

    fn background(&self, direction: Vec3) -> Vec3 {
        self.baked.scene.sky.radiance(direction).0
    }
}

/// The mean E/π of all lightmapped surfaces, weighted by area, from the middle of every triangle.
pub(crate) fn mean_white_radiance(baked: &Baked) -> Vec3 {
    let scene = &baked.scene;
    let (mut sum, mut area) = (glam::DVec3::ZERO, 0.0_f64);
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let Some(lightmap) = baked.lightmaps[index] else { continue };
        let page = &baked.pages[lightmap.page];
        let Some(scale) = page.white_radiance_scale() else { continue };
        for triangle in 0..scene.geometry(surface).triangles.len() as u32 {
            let at = SurfacePoint { surface: index as u32, triangle, barycentric: Vec2::splat(1.0 / 3.0) };
            let Some(uv) = scene.texcoord(at, lightmap.texcoord) else { continue };
            let [a, b, c] = scene.corners_world(surface, triangle).map(Vec3::as_dvec3);
            let weight = (b - a).cross(c - a).length() / 2.0;
            let value = page.sample(uv);
            if value.is_finite() && weight.is_finite() {
                sum += value.as_dvec3() * (f64::from(scale) * weight);
                area += weight;
            }
        }
    }
    if area > 0.0 { (sum / area).as_vec3() } else { Vec3::ZERO }
}
