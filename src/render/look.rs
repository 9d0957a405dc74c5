//! What a point of a surface sends to the eye.

use crate::baked::Baked;
use crate::export::mean_over_triangle;
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
        let bare = baked.bare_surfaces().next().is_some();
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

/// The mean E/π of all lightmapped surfaces, weighted by area.
pub(crate) fn mean_white_radiance(baked: &Baked) -> Vec3 {
    let scene = &baked.scene;
    let (mut sum, mut area) = (glam::DVec3::ZERO, 0.0_f64);
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let Some(lightmap) = baked.lightmaps[index] else { continue };
        let page = &baked.pages[lightmap.page];
        let (Some(scale), Ok(image)) = (page.white_radiance_scale(), &page.image) else { continue };
        let geometry = scene.geometry(surface);
        let Some(uv) = geometry.texcoords.get(lightmap.texcoord) else { continue };
        let size = image.size.map(|side| side as f32);
        for triangle in 0..geometry.triangles.len() as u32 {
            let corners = scene.corner_indices(surface, triangle).map(|i| uv[i] * Vec2::from(size));
            let [a, b, c] = scene.corners_world(surface, triangle).map(Vec3::as_dvec3);
            let weight = (b - a).cross(c - a).length() / 2.0;
            if !weight.is_finite()
                || corners.iter().any(|corner| !corner.is_finite())
                || image.value.is_empty()
            {
                continue;
            }
            let value = mean_over_triangle(&image.value, image.size, corners);
            if value.is_finite() {
                sum += value.as_dvec3() * (f64::from(scale) * weight);
                area += weight;
            }
        }
    }
    if area > 0.0 { (sum / area).as_vec3() } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Alpha, Geometry, GeometryId, Material, MaterialId, Origin, Role, Surface};
    use crate::transport::World;
    use crate::with_tracer;
    use glam::{DAffine3, Vec4};

    /// Square sheets across the z axis that face +z, one material each.
    fn sheets(sheets: &[(f32, Material)]) -> Scene {
        let mut scene = Scene::default();
        for (number, (z, material)) in sheets.iter().enumerate() {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let position: Vec<Vec3> = corners.iter().map(|&(x, y)| Vec3::new(x, y, *z)).collect();
            scene.geometries.push(Geometry {
                position_local: position.clone(),
                normal_local: vec![Vec3::Z; 4],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Geometry::default()
            });
            scene.materials.push(material.clone());
            scene.surfaces.push(Surface {
                origin: Origin { node: number, ..Origin::default() },
                geometry: GeometryId(number as u32),
                material: MaterialId(number as u32),
                world_from_local: DAffine3::IDENTITY,
                position_world: position,
                normal_world: vec![Vec3::Z; 4],
                mirrored: false,
                role: Role::Lightmapped,
                density_factor: 1.0,
            });
        }
        scene
    }

    /// Every surface sends its own number plus one.
    struct Numbers;

    impl Look for Numbers {
        fn radiance(&self, at: SurfacePoint, _: Vec3) -> Vec3 {
            Vec3::splat(at.surface as f32 + 1.0)
        }

        fn background(&self, _: Vec3) -> Vec3 {
            Vec3::splat(100.0)
        }
    }

    fn along_z(scene: &Scene, from: f32, towards: f32) -> Seen {
        let world = World::new(scene);
        let ray = Ray::unbounded(Vec3::new(0.3, 0.2, from), Vec3::new(0.0, 0.0, towards));
        with_tracer!(world.tracer(scene), tracer => look(scene, tracer, &Numbers, ray))
    }

    fn alpha(alpha: Alpha, opacity: f32) -> Material {
        Material { alpha, base_color: Vec4::new(0.5, 0.5, 0.5, opacity), ..Material::default() }
    }

    #[test]
    fn backs_of_single_sided_surfaces_are_not_seen() {
        let both = Material { double_sided: true, ..Material::default() };
        let scene = sheets(&[(1.0, Material::default()), (2.0, both), (3.0, Material::default())]);
        assert_eq!(along_z(&scene, 9.0, -1.0).radiance.x, 3.0);
        assert_eq!(along_z(&scene, -9.0, 1.0).radiance.x, 2.0);
        let open = along_z(&sheets(&[(1.0, Material::default())]), -9.0, 1.0);
        assert_eq!((open.radiance.x, open.surface), (100.0, false));
    }

    #[test]
    fn blended_surfaces_cover_their_alpha_and_holes_nothing() {
        let scene = sheets(&[
            (1.0, Material::default()),
            (2.0, alpha(Alpha::Blend, 0.25)),
            (3.0, alpha(Alpha::Mask { cutoff: 0.5 }, 0.4)),
            (4.0, alpha(Alpha::Blend, 0.5)),
        ]);
        // Half of the fourth, a quarter of the rest from the second, nothing of the third, then the first.
        let seen = along_z(&scene, 9.0, -1.0);
        assert!((seen.radiance.x - (0.5 * 4.0 + 0.125 * 2.0 + 0.375)).abs() < 1e-6 && seen.surface);
        let glass = along_z(&sheets(&[(2.0, alpha(Alpha::Blend, 0.25))]), 9.0, -1.0);
        assert!((glass.radiance.x - (0.25 + 75.0)).abs() < 1e-5);
    }

    #[test]
    fn a_ray_ends_where_the_eye_s_clip_says() {
        let scene = sheets(&[(0.0, Material { double_sided: true, ..Material::default() })]);
        let world = World::new(&scene);
        let ray = |t_max| Ray { origin: Vec3::Z * 2.0, direction: Vec3::NEG_Z, t_max };
        let seen =
            |t_max| with_tracer!(world.tracer(&scene), t => look(&scene, t, &Numbers, ray(t_max)).surface);
        assert_eq!([seen(1.9), seen(2.1)], [false, true]);
    }
}
