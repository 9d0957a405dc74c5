//! What is there and does nothing: lights that send none or shine the other way, images that are black or have no hole.

use crate::common::Builder;
use crate::scenes::{CHECKS, Shine, block, hull, lamp, like, room, texture, transparent};
use crate::twins::{Make, lit_room, make, twins};
use crate::{changes_nothing, draft, finding, planned};
use glam::{Vec3, Vec4};
use lightkiln::options::Effect;
use lightkiln::scene::Alpha;
use lightkiln::units::Intensity;

const BLACK: [[u8; 4]; 4] = [[0, 0, 0, 255]; 4];
const HOLES: [[u8; 4]; 4] =
    [[255, 255, 255, 255], [255, 255, 255, 0], [255, 255, 255, 0], [255, 255, 255, 255]];

#[test]
fn lamps_without_power() {
    fn with_power(b: &mut Builder, power: f32) {
        room(b);
        lamp(b, Vec3::ZERO, Shine { intensity: Intensity::grey(power), ..Shine::default() });
    }
    twins(Effect::PointLamps, |b| with_power(b, 0.0), |b| with_power(b, 1.0));
    let plan = planned(&make(|b| with_power(b, 0.0)));
    let reason = &finding(&plan, Effect::FarLamps).reason;
    assert_eq!(reason, "1 lamp without power: 'lamp'");
    let plan = planned(&make(|b| {
        room(b);
    }));
    assert_eq!(finding(&plan, Effect::FarLamps).reason, "the scene has no lamps");
}

#[test]
fn lamps_behind_everything() {
    fn ground(b: &mut Builder) {
        let grey = b.material(0.5, 0.0);
        b.quad(Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 4.0, grey);
    }
    fn lit_from(b: &mut Builder, height: f32) {
        ground(b);
        lamp(b, Vec3::new(2.0, height, 2.0), Shine { radius_m: 0.1, ..Shine::default() });
    }
    twins(Effect::PointLamps, |b| lit_from(b, -0.2), |b| lit_from(b, 0.2));
    // Half of it is still above the ground.
    twins(Effect::PointLamps, |b| lit_from(b, -0.2), |b| lit_from(b, -0.05));
    fn sunlit(b: &mut Builder, height: f32) {
        ground(b);
        b.sun(Vec3::new(1.0, height, 0.3), 1.0, 0.1);
    }
    twins(Effect::Suns, |b| sunlit(b, -0.2), |b| sunlit(b, 0.2));
    twins(Effect::Suns, |b| sunlit(b, -0.2), |b| sunlit(b, -0.02));
    // A back that takes light, and a thing below.
    for also in [
        (|b| {
            let both = crate::scenes::double_sided(b, 0.5, 0.0);
            b.quad(Vec3::Y, Vec3::Z * 4.0, Vec3::X * 4.0, both);
        }) as Make,
        |b| {
            let grey = b.material(0.5, 0.0);
            block(b, Vec3::Y, 0.3, grey);
        },
    ] {
        let scene = make(|b| {
            sunlit(b, -0.2);
            also(b);
        });
        assert!(finding(&planned(&scene), Effect::Suns).on);
        changes_nothing("lit from below", &scene, &draft());
    }
}

#[test]
fn black_images() {
    fn glowing_through(b: &mut Builder, image: [[u8; 4]; 4]) {
        room(b);
        let glowing = b.material(0.2, 3.0);
        let block = block(b, Vec3::new(0.3, -0.2, 0.1), 0.1, glowing);
        let slot = texture(b, image);
        b.scene.surfaces[block].material = like(b, glowing, |m| m.emission_texture = Some(slot));
    }
    for effect in [Effect::AreaLights, Effect::TexturedEmission, Effect::Bounces] {
        twins(effect, |b| glowing_through(b, BLACK), |b| glowing_through(b, CHECKS));
    }
    fn painted(b: &mut Builder, image: [[u8; 4]; 4]) {
        lit_room(b);
        let slot = texture(b, image);
        let grey = b.scene.surfaces[0].material;
        b.scene.surfaces[0].material = like(b, grey, |m| m.base_color_texture = Some(slot));
    }
    twins(Effect::Bounces, |b| painted(b, BLACK), |b| painted(b, CHECKS));
    fn vertices(b: &mut Builder, brightness: f32) {
        lit_room(b);
        let colour = Vec4::new(brightness, brightness, brightness, 1.0);
        for geometry in &mut b.scene.geometries {
            geometry.color = vec![colour; geometry.position_local.len()];
        }
    }
    twins(Effect::Bounces, |b| vertices(b, 0.0), |b| vertices(b, 0.7));
}

#[test]
fn masks_without_holes_and_veils_without_any_light_through() {
    fn curtain(b: &mut Builder, alpha: Alpha, image: [[u8; 4]; 4]) {
        lit_room(b);
        let cloth = transparent(b, alpha, 1.0);
        let curtain = b.quad(Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y, cloth);
        let slot = texture(b, image);
        b.scene.surfaces[curtain].material = like(b, cloth, |m| m.base_color_texture = Some(slot));
    }
    let mask = Alpha::Mask { cutoff: 0.5 };
    twins(
        Effect::AlphaTest,
        |b| curtain(b, Alpha::Mask { cutoff: 0.5 }, CHECKS),
        |b| curtain(b, Alpha::Mask { cutoff: 0.5 }, HOLES),
    );
    twins(Effect::TintedShadows, |b| curtain(b, Alpha::Blend, CHECKS), |b| curtain(b, Alpha::Blend, HOLES));
    let plan = planned(&make(|b| curtain(b, mask, CHECKS)));
    let reason = &finding(&plan, Effect::AlphaTest).reason;
    assert_eq!(reason, "no image of a material with alphaMode MASK has a hole");
}

#[test]
fn black_skies() {
    fn under(b: &mut Builder, radiance: f32) {
        let grey = b.material(0.5, 0.0);
        hull(b, Vec3::splat(-1.0), Vec3::splat(1.0), true, 0b1000, grey);
        b.point(Vec3::ZERO, 1.0);
        b.sky(radiance);
    }
    twins(Effect::Sky, |b| under(b, 0.0), |b| under(b, 0.3));
}
