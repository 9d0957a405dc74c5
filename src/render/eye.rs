//! From a point of the picture to a ray.

use crate::error::{Error, Result};
use crate::options::View;
use crate::scene::{Camera, Projection, Scene};
use crate::transport::Ray;
use glam::{DVec3, Vec2, Vec3};

/// Height of a picture when nobody says, pixels.
const HEIGHT: f32 = 720.0;
/// Width over height when nobody says.
const ASPECT: f32 = 16.0 / 9.0;
/// Largest side of a picture, pixels.
pub(crate) const MAX_SIDE: u32 = 16_384;
/// From outside, the scene is seen from this far above the horizon and through this lens.
const ORBIT_ELEVATION_DEG: f32 = 28.0;
const ORBIT_YFOV_RAD: f32 = 0.6;

/// A camera with the shape of its picture.
#[derive(Clone, Debug)]
pub(crate) struct Eye {
    /// Where it is, metres relative to the scene's origin.
    position: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Half of what is seen: at distance 1, or everywhere when `parallel`.
    half: Vec2,
    parallel: bool,
    clip_m: [f32; 2],
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// What it is called.
    pub name: String,
}

impl Eye {
    /// The eye that `view` asks for; `bounds` is the box around what can be seen.
    pub fn new(scene: &Scene, bounds: [Vec3; 2], view: &View, size: Option<[u32; 2]>) -> Result<Self> {
        let size = match size {
            Some([w, h]) if !(1..=MAX_SIDE).contains(&w) || !(1..=MAX_SIDE).contains(&h) => {
                let what = format!("a picture must have from 1 to {MAX_SIDE} pixels a side, not {w} × {h}");
                return Err(Error::invalid("--size", what));
            }
            size => size,
        };
        match view {
            View::First => Ok(match scene.cameras.first() {
                Some(camera) => Self::of(camera, scene.origin_world, size),
                None => Self::orbit(bounds, View::AZIMUTH_DEG, size),
            }),
            View::Orbit { azimuth_deg } => Ok(Self::orbit(bounds, *azimuth_deg, size)),
            View::Camera(name) => match scene.cameras.iter().find(|camera| camera.name == *name) {
                Some(camera) => Ok(Self::of(camera, scene.origin_world, size)),
                None => Err(no_camera(scene, name)),
            },
        }
    }

    fn of(camera: &Camera, origin_world: DVec3, size: Option<[u32; 2]>) -> Self {
        let axes = camera.world_from_camera.matrix3;
        let unit = |axis: DVec3| axis.normalize_or_zero().as_vec3();
        let aspect = match camera.projection {
            Projection::Perspective { aspect, .. } => aspect.unwrap_or(ASPECT),
            Projection::Orthographic { half_width_m, half_height_m } => half_width_m / half_height_m,
        };
        let size = size.unwrap_or_else(|| default_size(aspect));
        let shape = size[0] as f32 / size[1] as f32;
        let (half, parallel) = match camera.projection {
            Projection::Perspective { yfov_rad, .. } => ((yfov_rad / 2.0).tan(), false),
            Projection::Orthographic { half_height_m, .. } => (half_height_m, true),
        };
        Self {
            position: (camera.world_from_camera.translation - origin_world).as_vec3(),
            right: unit(axes.x_axis),
            up: unit(axes.y_axis),
            forward: -unit(axes.z_axis),
            half: Vec2::new(half * shape, half),
            parallel,
            clip_m: camera.clip_m,
            size,
            name: camera.name.clone(),
        }
    }

    /// Looks at the middle of the box from so far away that all its corners are inside the picture.
    fn orbit([low, high]: [Vec3; 2], azimuth_deg: f32, size: Option<[u32; 2]>) -> Self {
        let size = size.unwrap_or_else(|| default_size(ASPECT));
        let (azimuth, elevation) = (azimuth_deg.to_radians(), ORBIT_ELEVATION_DEG.to_radians());
        let back =
            Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let right = Vec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let half_y = (ORBIT_YFOV_RAD / 2.0).tan();
        let half = Vec2::new(half_y * size[0] as f32 / size[1] as f32, half_y);
        let middle = (low + high) / 2.0;
        let needed = (0..8).map(|corner: u32| {
            let far = |bit: u32, axis: usize| if corner >> bit & 1 == 1 { high[axis] } else { low[axis] };
            let c = Vec3::new(far(0, 0), far(1, 1), far(2, 2)) - middle;
            c.dot(back) + (c.dot(right).abs() / half.x).max(c.dot(up).abs() / half.y)
        });
        let distance = needed.fold(f32::MIN_POSITIVE, f32::max) * 1.02;
        Self {
            position: middle + back * distance,
            right,
            up,
            forward: -back,
            half,
            parallel: false,
            clip_m: [0.0, f32::INFINITY],
            size,
            name: format!("orbit {azimuth_deg}°"),
        }
    }

    /// The ray through a point of the picture, in pixels from its top left corner. It begins where the eye sees nearest.
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let [w, h] = self.size;
        let across = (2.0 * x / w as f32 - 1.0) * self.half.x;
        let above = (1.0 - 2.0 * y / h as f32) * self.half.y;
        let aside = self.right * across + self.up * above;
        let (from, along) = if self.parallel {
            (self.position + aside, self.forward)
        } else {
            (self.position, self.forward + aside)
        };
        // `along` reaches a depth of 1 m.
        let [near, far] = self.clip_m;
        let length = along.length();
        Ray { origin: from + along * near, direction: along / length, t_max: (far - near) * length }
    }
}

fn default_size(aspect: f32) -> [u32; 2] {
    [((HEIGHT * aspect).round() as u32).clamp(1, MAX_SIDE), HEIGHT as u32]
}

fn no_camera(scene: &Scene, name: &str) -> Error {
    let names: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
    let what = match names.as_slice() {
        [] => "the file has no cameras: export them with Include > Data > Cameras, or use --orbit".to_owned(),
        names => format!("there is no camera of this name; there are: {}", names.join(", ")),
    };
    Error::invalid(format!("camera '{name}'"), what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn scene(projection: Projection) -> Scene {
        let camera = Camera {
            name: "Eye".into(),
            // A quarter turn about y: it looks along −x; the scale must not matter.
            world_from_camera: DAffine3::from_translation(DVec3::new(5.0, 1.0, 0.0))
                * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2)
                * DAffine3::from_scale(DVec3::splat(3.0)),
            projection,
            clip_m: [0.5, 10.0],
        };
        Scene { cameras: vec![camera], ..Scene::default() }
    }

    #[test]
    fn a_camera_looks_along_its_own_axis_with_its_angle() {
        let scene = scene(Projection::Perspective { yfov_rad: 2.0 * 0.5_f32.atan(), aspect: Some(2.0) });
        let eye = Eye::new(&scene, [Vec3::ZERO; 2], &View::First, None).unwrap();
        assert_eq!(eye.size, [1440, 720]);
        let middle = eye.ray(720.0, 360.0);
        assert!((middle.direction - Vec3::NEG_X).length() < 1e-6, "{middle:?}");
        // Begins half a metre before the eye, ends 10 m before it.
        assert!((middle.origin - Vec3::new(4.5, 1.0, 0.0)).length() < 1e-6 && middle.t_max == 9.5);
        // The top of the picture is half a metre up per metre, the right border a whole one, towards −z.
        let corner = eye.ray(1440.0, 0.0).direction;
        assert!((corner / -corner.x - Vec3::new(-1.0, 0.5, -1.0)).length() < 1e-6, "{corner}");
        assert_eq!(Eye::new(&scene, [Vec3::ZERO; 2], &View::First, Some([10, 20])).unwrap().size, [10, 20]);
    }

    #[test]
    fn parallel_rays_start_side_by_side() {
        let scene = scene(Projection::Orthographic { half_width_m: 2.0, half_height_m: 1.0 });
        let eye = Eye::new(&scene, [Vec3::ZERO; 2], &View::Camera("Eye".into()), None).unwrap();
        let ray = eye.ray(0.0, 0.0);
        assert!((ray.direction - Vec3::NEG_X).length() < 1e-6);
        assert!((ray.origin - Vec3::new(4.5, 2.0, 2.0)).length() < 1e-5, "{ray:?}");
    }

    #[test]
    fn from_outside_every_corner_is_in_the_picture() {
        let bounds = [Vec3::new(-3.0, 0.0, 1.0), Vec3::new(9.0, 2.0, 4.0)];
        for azimuth_deg in [0.0, 35.0, 100.0, 250.0] {
            let eye = Eye::new(&Scene::default(), bounds, &View::Orbit { azimuth_deg }, None).unwrap();
            let mut reach = 0.0_f32;
            for corner in 0..8 {
                let pick = |axis: usize| bounds[corner >> axis & 1][axis];
                let to = Vec3::new(pick(0), pick(1), pick(2)) - eye.position;
                let depth = to.dot(eye.forward);
                assert!(depth > 0.0);
                let (x, y) = (to.dot(eye.right) / depth / eye.half.x, to.dot(eye.up) / depth / eye.half.y);
                reach = reach.max(x.abs()).max(y.abs());
            }
            assert!(reach < 1.0 && reach > 0.9, "{reach} at {azimuth_deg}");
        }
    }

    #[test]
    fn a_camera_that_is_not_there_is_named_with_those_that_are() {
        let scene = scene(Projection::Orthographic { half_width_m: 1.0, half_height_m: 1.0 });
        let wanted = View::Camera("Ear".into());
        let said = Eye::new(&scene, [Vec3::ZERO; 2], &wanted, None).unwrap_err().to_string();
        assert!(said.contains("Ear") && said.contains("Eye"), "{said}");
        let said = Eye::new(&Scene::default(), [Vec3::ZERO; 2], &wanted, None).unwrap_err().to_string();
        assert!(said.contains("--orbit"), "{said}");
        assert!(Eye::new(&scene, [Vec3::ZERO; 2], &View::First, Some([0, 5])).is_err());
    }
}
