//! What a plan says is what a person sees who opens the scene.

use crate::common::Builder;
use crate::scenes::{Shine, block, lamp};
use crate::{finding, planned};
use glam::Vec3;
use lightkiln::options::Effect;
use lightkiln::scene::{Alpha, Role};

fn reason(b: &Builder, effect: Effect) -> String {
    finding(&planned(&b.scene), effect).reason.clone()
}

/// Two walls that face each other, and a lamp between them.
fn walls() -> Builder {
    let mut b = Builder::new();
    let grey = b.material(0.5, 0.0);
    b.quad(Vec3::ZERO, Vec3::Y, Vec3::Z, grey);
    b.quad(Vec3::X, Vec3::Z, Vec3::Y, grey);
    lamp(&mut b, Vec3::splat(0.5), Shine::default());
    b
}

#[test]
fn an_object_of_several_materials_is_one() {
    let mut b = walls();
    assert_eq!(reason(&b, Effect::Bounces), "2 reflecting objects: 'object 0', 'object 1'");
    let other = b.scene.surfaces[0].origin.clone();
    b.scene.surfaces[1].origin = lightkiln::scene::Origin { primitive: 1, ..other };
    assert_eq!(reason(&b, Effect::Bounces), "1 reflecting object: 'object 0'");
    // Instances are objects of their own.
    for (k, surface) in b.scene.surfaces.iter_mut().enumerate() {
        surface.origin.instance = Some(k);
    }
    assert_eq!(reason(&b, Effect::Bounces), "2 reflecting objects: 'object 0'");
}

#[test]
fn a_mesh_of_several_materials_is_one() {
    let mut b = walls();
    for k in 0..2 {
        let mut again = b.scene.surfaces[k].clone();
        again.origin.node = 2;
        b.scene.surfaces.push(again);
    }
    assert!(reason(&b, Effect::Instancing).starts_with("2 meshes in several places"));
    for (k, surface) in b.scene.surfaces.iter_mut().enumerate() {
        (surface.origin.mesh, surface.origin.primitive) = (0, k % 2);
    }
    assert!(reason(&b, Effect::Instancing).starts_with("1 mesh in several places"));
}

#[test]
fn the_inside_of_a_solid_is_no_room() {
    const NONE: &str = "nothing was found that is sealed off: all counts as one room";
    let mut b = walls();
    assert_eq!(reason(&b, Effect::LightBetweenRooms), NONE);
    let grey = b.material(0.5, 0.0);
    let corners = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z].map(|v| 4.0 * v + 9.0 * Vec3::Z);
    let faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    let solid = b.mesh(corners.to_vec(), faces.to_vec(), grey);
    // In the box around the solid, and outside of it.
    block(&mut b, Vec3::new(3.5, 3.5, 12.5), 0.2, grey);
    assert_eq!(reason(&b, Effect::LightBetweenRooms), NONE);
    block(&mut b, Vec3::new(0.0, 0.0, 9.0), 0.2, grey);
    let sealed = format!("1 room sealed off inside 'object {solid}'");
    assert_eq!(reason(&b, Effect::LightBetweenRooms), sealed);
}

#[test]
fn area_lamps_are_lamps_and_no_masks() {
    let mut b = walls();
    b.scene.lamps.clear();
    assert_eq!(reason(&b, Effect::FarLamps), "the scene has no lamps");
    let glow = b.material(0.0, 1.0);
    b.scene.materials[glow.0 as usize].alpha = Alpha::Mask { cutoff: 0.5 };
    let area = b.quad(Vec3::Y * 2.0, Vec3::X, Vec3::Z, glow);
    b.scene.surfaces[area].role = Role::Emits;
    assert_eq!(reason(&b, Effect::FarLamps), "the scene has no lamps but area lamps");
    assert_eq!(reason(&b, Effect::AlphaTest), "no material uses alphaMode MASK");
    assert_eq!(reason(&walls(), Effect::FarLamps), "no lamp was found that lights nothing");
}

#[test]
fn masks_at_their_ends() {
    let masked = |alpha: f32, cutoff: f32| {
        let mut b = walls();
        let material = b.scene.surfaces[0].material.0 as usize;
        b.scene.materials[material].alpha = Alpha::Mask { cutoff };
        b.scene.materials[material].base_color.w = alpha;
        let plan = planned(&b.scene);
        let finding = finding(&plan, Effect::AlphaTest);
        (finding.on, finding.reason.clone())
    };
    let none = (false, "no image of a material with alphaMode MASK has a hole".to_owned());
    assert_eq!(masked(0.0, 0.0), none);
    assert_eq!(masked(1.0, 0.5), none);
    let whole = (false, "what uses alphaMode MASK is a hole as a whole, or has none".to_owned());
    assert_eq!(masked(1.0, 1.1), whole);
}
