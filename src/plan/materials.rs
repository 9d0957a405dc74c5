//! What materials, lamps and images tell about light.

use crate::scene::{Alpha, LampKind, Role, Scene, Sky, TextureSlot};
use glam::Vec3;

/// Whether a surface sends light.
pub(super) fn emits(scene: &Scene, surface: usize) -> bool {
    let surface = &scene.surfaces[surface];
    surface.role != Role::Blocks && scene.emits(surface)
}

/// Whether a surface may reflect anything.
pub(super) fn reflects(scene: &Scene, surface: usize) -> bool {
    let surface = &scene.surfaces[surface];
    let material = scene.material(surface);
    let vertex = &scene.geometry(surface).color;
    let metal = if material.metallic_texture.is_none() { material.metallic } else { 0.0 };
    !material.unlit
        && material.base_color.truncate().max_element() > 0.0
        && metal < 1.0
        && material.transmission < 1.0
        && (vertex.is_empty() || vertex.iter().any(|colour| colour.truncate().max_element() > 0.0))
        && !scene.is_black(&material.base_color_texture)
}

/// Whether red, green and blue are the same in everything that sends, reflects or tints light.
pub(super) fn all_grey(scene: &Scene) -> bool {
    let grey = |colour: Vec3| colour.x == colour.y && colour.y == colour.z;
    let lamps = scene.lamps.iter().all(|lamp| match lamp.kind {
        LampKind::Point { intensity, .. } => grey(intensity.0),
        LampKind::Sun { irradiance, .. } => grey(irradiance.0),
    });
    let sky = match &scene.sky {
        Sky::None => true,
        Sky::Constant(radiance) => grey(radiance.0),
        Sky::Image(image) => image.is_grey(),
    };
    let factors = |index: usize| {
        let surface = &scene.surfaces[index];
        let material = scene.material(surface);
        let vertex = scene.geometry(surface).color.iter().all(|colour| grey(colour.truncate()));
        grey(material.emission.0)
            && vertex
            && (grey(material.base_color.truncate())
                || !reflects(scene, index) && material.alpha != Alpha::Blend)
    };
    let images = |index: usize| {
        let material = scene.material(&scene.surfaces[index]);
        let slots = [&material.base_color_texture, &material.emission_texture];
        let image = |slot: &TextureSlot| scene.textures[slot.texture.0 as usize].is_grey();
        slots.into_iter().flatten().all(image)
    };
    let all = 0..scene.surfaces.len();
    // Images last: they take the longest to look through.
    lamps && all.clone().all(factors) && sky && all.clone().all(images)
}
