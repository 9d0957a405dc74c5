//! Insides of solid things, where nobody can look.

use super::bodies::Bodies;
use super::columns::Place;
use super::solid::Skin;
use crate::scene::{Opacity, Scene};
use glam::{DAffine3, Vec3};

/// The double-sided solids of a scene: closed, outward, opaque.
pub struct Solids {
    bodies: Bodies,
    /// Components, and from the world to the space of their shape.
    items: Vec<(usize, DAffine3)>,
}

impl Solids {
    /// Finds them by geometry alone, whatever a plan says.
    pub fn of(scene: &Scene) -> Self {
        let bodies = Bodies::new(scene);
        let opaque = |surface: u32| {
            let surface = &scene.surfaces[surface as usize];
            scene.material(surface).transmission <= 0.0 && scene.opacity_of(surface) == Opacity::Full
        };
        let solid = |&item: &usize| {
            let component = bodies.component(item);
            component.skin == Skin::Closed
                && component.columns.is_some()
                && bodies.surfaces(item).into_iter().all(opaque)
        };
        let inverse = |item: usize| {
            let frame = bodies.bodies[bodies.placed[item].body].world_from_shape;
            let linear = frame.matrix3;
            let cube = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
            (linear.determinant().abs() > 1e-9 * cube).then(|| (item, frame.inverse()))
        };
        let items = (0..bodies.placed.len()).filter(solid).filter_map(inverse).collect();
        Self { bodies, items }
    }

    /// Whether a point (world metres relative to the scene's origin) is inside one of them, off its skin.
    pub fn hold(&self, position_world: Vec3) -> bool {
        let p = position_world.as_dvec3();
        self.items.iter().any(|&(item, shape_from_world)| {
            let placed = &self.bodies.placed[item];
            let columns = self.bodies.component(item).columns.as_ref();
            p.cmpge(placed.min).all()
                && p.cmple(placed.max).all()
                && columns.is_some_and(|columns| {
                    columns.place(shape_from_world.transform_point3(p)) == Place::Inside
                })
        })
    }
}
