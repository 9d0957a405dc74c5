//! For every effect a scene that does not call for it, and its twin that does.

use crate::common::Builder;
use crate::scenes::{
    CHECKS, Shine, block, coloured, double_sided, hull, lamp, like, room, texture, transparent,
};
use crate::{changes_nothing, draft, finding, planned};
use glam::{DAffine3, Vec3};
use lightkiln::options::Effect;
use lightkiln::plan::Side;
use lightkiln::scene::{Alpha, Cone, Scene, SpotFalloff};
use lightkiln::units::Intensity;

pub type Make = fn(&mut Builder);

pub fn make(make: impl Fn(&mut Builder)) -> Scene {
    let mut b = Builder::new();
    make(&mut b);
    b.scene
}

/// Checks that the effect is off in one scene and on in the other, and that neither changes when it is forced.
#[track_caller]
pub fn twins(effect: Effect, off: Make, on: Make) {
    for (make_it, expected) in [(off, false), (on, true)] {
        let scene = make(make_it);
        let plan = planned(&scene);
        let found = finding(&plan, effect);
        assert_eq!(found.on, expected, "{}: {}", effect.name(), found.reason);
        changes_nothing(effect.name(), &scene, &draft());
    }
}

pub fn lit_room(b: &mut Builder) {
    room(b);
    b.point(Vec3::new(0.2, 0.1, 0.3), 1.0);
}

pub fn spot(b: &mut Builder, position_world: Vec3, direction_world: Vec3) {
    let falloff = SpotFalloff::Blender;
    let cone = Some(Cone { direction_world, inner_rad: 0.3, outer_rad: 0.4, falloff });
    lamp(b, position_world, Shine { cone, ..Shine::default() });
}

fn soft(b: &mut Builder, position_world: Vec3) {
    lamp(b, position_world, Shine { radius_m: 0.1, ..Shine::default() });
}

#[test]
fn kinds_of_light() {
    let glowing: Make = |b| {
        room(b);
        let glowing = b.material(0.2, 3.0);
        block(b, Vec3::new(0.3, -0.2, 0.1), 0.1, glowing);
    };
    twins(Effect::AreaLights, lit_room, glowing);
    twins(Effect::TexturedEmission, glowing, |b| {
        room(b);
        let glowing = b.material(0.2, 3.0);
        let block = block(b, Vec3::new(0.3, -0.2, 0.1), 0.1, glowing);
        let slot = texture(b, CHECKS);
        b.scene.surfaces[block].material = like(b, glowing, |m| m.emission_texture = Some(slot));
    });
    twins(Effect::PointLamps, glowing, lit_room);
    twins(Effect::SoftLamps, lit_room, |b| {
        room(b);
        soft(b, Vec3::ZERO);
    });
    let spotted: Make = |b| {
        room(b);
        spot(b, Vec3::ZERO, -Vec3::Y);
    };
    twins(Effect::SpotLamps, lit_room, spotted);
}

#[test]
fn suns_and_sky_of_a_closed_and_of_an_open_room() {
    fn under_the_sky(b: &mut Builder, left_out: u8) {
        let grey = b.material(0.5, 0.0);
        hull(b, Vec3::splat(-1.0), Vec3::splat(1.0), true, left_out, grey);
        block(b, Vec3::new(0.2, -0.6, 0.1), 0.3, grey);
        b.sun(Vec3::new(0.3, 1.0, 0.2), 2.0, 0.05);
        b.sky(0.3);
        b.point(Vec3::new(0.5, 0.5, 0.5), 1.0);
    }
    for effect in [Effect::Suns, Effect::SoftSuns, Effect::Sky] {
        twins(effect, |b| under_the_sky(b, 0), |b| under_the_sky(b, 0b1000));
    }
}

#[test]
fn lamps_out_of_reach() {
    fn ranged(b: &mut Builder, range_m: f32) {
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::ZERO, 0.5, grey);
        lamp(b, Vec3::X * 4.0, Shine { range_m: Some(range_m), ..Shine::default() });
    }
    twins(Effect::PointLamps, |b| ranged(b, 3.0), |b| ranged(b, 3.7));
    fn aimed(b: &mut Builder, direction_world: Vec3) {
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::ZERO, 0.5, grey);
        spot(b, Vec3::X * 4.0, direction_world);
    }
    twins(Effect::SpotLamps, |b| aimed(b, Vec3::X), |b| aimed(b, -Vec3::X));
}

#[test]
fn shadows_of_convex_rooms_and_bodies() {
    let furnished: Make = |b| {
        lit_room(b);
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::new(-0.4, -0.6, 0.0), 0.2, grey);
    };
    twins(Effect::Shadows, lit_room, furnished);
    twins(Effect::Penumbras, lit_room, furnished);
    let body: Make = |b| {
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::ZERO, 0.5, grey);
        b.sun(Vec3::ONE, 1.0, 0.0);
        soft(b, Vec3::new(2.0, 3.0, 0.0));
        b.sky(0.2);
    };
    let bodies: Make = |b| {
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::ZERO, 0.5, grey);
        block(b, Vec3::Y * 2.0, 0.5, grey);
        b.sun(Vec3::ONE, 1.0, 0.0);
        soft(b, Vec3::new(2.0, 3.0, 0.0));
        b.sky(0.2);
    };
    twins(Effect::Shadows, body, bodies);
    twins(Effect::Bounces, body, bodies);
    // A lamp in a niche's mouth is on the far side of the niche's planes, yet the room is convex for nobody else.
    let dented: Make = |b| {
        lit_room(b);
        let grey = b.material(0.5, 0.0);
        b.quad(Vec3::new(-1.0, -0.99, -1.0), Vec3::Z, Vec3::X, grey);
    };
    twins(Effect::Shadows, lit_room, dented);
}

#[test]
fn holes_and_tints() {
    fn curtain(b: &mut Builder, alpha: Alpha, opacity: f32) {
        lit_room(b);
        let cloth = transparent(b, alpha, opacity);
        let curtain = b.quad(Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y, cloth);
        if matches!(alpha, Alpha::Mask { .. }) {
            let slot = texture(b, [[255; 4], [255, 255, 255, 0], [255, 255, 255, 0], [255; 4]]);
            b.scene.surfaces[curtain].material = like(b, cloth, |m| m.base_color_texture = Some(slot));
        }
    }
    twins(
        Effect::AlphaTest,
        |b| curtain(b, Alpha::Opaque, 1.0),
        |b| curtain(b, Alpha::Mask { cutoff: 0.5 }, 1.0),
    );
    twins(Effect::TintedShadows, |b| curtain(b, Alpha::Opaque, 1.0), |b| curtain(b, Alpha::Blend, 0.4));
}

#[test]
fn back_faces_of_closed_and_open_boxes() {
    fn boxed(b: &mut Builder, left_out: u8) {
        room(b);
        let both = double_sided(b, 0.5, 0.0);
        hull(b, Vec3::splat(-0.3), Vec3::splat(0.3), false, left_out, both);
        b.point(Vec3::new(0.5, 0.6, 0.3), 1.0);
    }
    twins(Effect::BackFaces, |b| boxed(b, 0), |b| boxed(b, 0b1000));
}

#[test]
fn rooms_that_are_sealed_and_such_that_are_not() {
    fn two_rooms(b: &mut Builder, left_out: u8) {
        let both = double_sided(b, 0.5, 0.0);
        hull(b, Vec3::splat(-1.0), Vec3::splat(1.0), true, left_out, both);
        hull(b, Vec3::new(2.0, -1.0, -1.0), Vec3::new(4.0, 1.0, 1.0), true, 0, both);
        block(b, Vec3::new(0.1, -0.6, 0.2), 0.2, both);
        b.point(Vec3::new(0.5, 0.5, 0.5), 1.0);
        soft(b, Vec3::new(3.0, 0.5, 0.5));
        b.sun(Vec3::new(0.1, 1.0, 0.2), 1.0, 0.0);
    }
    let sealed = make(|b| two_rooms(b, 0));
    let plan = planned(&sealed);
    // The outside, two insides, and the inside of the block, which nobody asks about.
    assert_eq!(plan.rooms.len(), 3, "{:?}", plan.rooms);
    assert!(plan.sides[..2].iter().all(|sides| sides.back == Side::Dark), "{:?}", plan.sides);
    assert_eq!(finding(&plan, Effect::UnseenSurfaces).evidence.count, 2);
    assert!(!finding(&plan, Effect::Suns).on && !finding(&plan, Effect::LightBetweenRooms).on);
    changes_nothing("two rooms", &sealed, &draft());

    let open = make(|b| two_rooms(b, 0b1000));
    let plan = planned(&open);
    assert_eq!(plan.rooms.len(), 2, "{:?}", plan.rooms);
    assert_eq!(plan.sides[0].back, Side::Hidden);
    assert_eq!(plan.sides[1].back, Side::Hidden, "what is outside sees it");
    assert!(finding(&plan, Effect::Suns).on);
    changes_nothing("a room without a ceiling", &open, &draft());

    // Something that gets through a wall is in both rooms: light on either part of it counts.
    let pierced = make(|b| {
        two_rooms(b, 0);
        let grey = b.material(0.5, 0.0);
        block(b, Vec3::new(0.0, 1.0, 0.0), 0.3, grey);
    });
    let plan = planned(&pierced);
    assert!(finding(&plan, Effect::Suns).on, "the sun shines on the part outside");
    changes_nothing("a block through the ceiling", &pierced, &draft());
}

#[test]
fn bounces_and_gather() {
    fn walls(b: &mut Builder, reflectance: f32) {
        let wall = b.material(reflectance, 0.0);
        hull(b, Vec3::splat(-1.0), Vec3::splat(1.0), true, 0, wall);
        b.point(Vec3::new(0.2, 0.1, 0.3), 1.0);
    }
    for effect in [Effect::Bounces, Effect::FinalGather] {
        twins(effect, |b| walls(b, 0.0), |b| walls(b, 0.5));
    }
    fn ground(b: &mut Builder, with_wall: bool) {
        let grey = b.material(0.5, 0.0);
        b.quad(Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 4.0, grey);
        if with_wall {
            b.quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y, grey);
        }
        b.sun(Vec3::new(0.1, 1.0, 0.5), 1.0, 0.0);
    }
    for effect in [Effect::Bounces, Effect::FinalGather, Effect::Shadows] {
        twins(effect, |b| ground(b, false), |b| ground(b, true));
    }
    twins(
        Effect::FinalGather,
        |b| ground(b, false),
        |b| {
            ground(b, false);
            b.sky(0.4);
        },
    );
}

#[test]
fn grey_and_coloured() {
    twins(Effect::ColourChannels, lit_room, |b| {
        lit_room(b);
        let red = coloured(b, 0.8, 0.1, 0.1);
        block(b, Vec3::new(-0.4, -0.6, 0.0), 0.2, red);
    });
    twins(Effect::ColourChannels, lit_room, |b| {
        room(b);
        let intensity = Intensity(Vec3::new(1.0, 0.9, 0.8));
        lamp(b, Vec3::ZERO, Shine { intensity, ..Shine::default() });
    });
}

#[test]
fn images_normals_and_instances() {
    twins(Effect::AlbedoTextures, lit_room, |b| {
        lit_room(b);
        let slot = texture(b, CHECKS);
        let grey = b.scene.surfaces[0].material;
        b.scene.surfaces[0].material = like(b, grey, |m| m.base_color_texture = Some(slot));
    });
    twins(Effect::SmoothNormals, lit_room, |b| {
        lit_room(b);
        let grey = b.material(0.5, 0.0);
        let round = block(b, Vec3::new(0.2, -0.5, 0.0), 0.2, grey);
        b.scene.geometries[round].smooth = true;
    });
    twins(Effect::Instancing, lit_room, |b| {
        lit_room(b);
        let grey = b.material(0.5, 0.0);
        let first = block(b, Vec3::new(0.2, -0.5, 0.0), 0.2, grey);
        let mut second = b.scene.surfaces[first].clone();
        let by = Vec3::new(-0.6, 0.0, 0.2);
        second.world_from_local = DAffine3::from_translation(by.as_dvec3());
        second.position_world.iter_mut().for_each(|p| *p += by);
        (second.origin.node, second.origin.name) = (first + 1, "twin".into());
        b.scene.surfaces.push(second);
    });
}

#[test]
fn only_direct_light_needs_no_bounces() {
    use lightkiln::plan::{Wanted, plan};
    let scene = make(lit_room);
    let plan = plan(&scene, &Wanted { direct_alone: true, ..Wanted::default() });
    assert!(!plan.work.bounces && !plan.work.gather);
    assert!(finding(&plan, Effect::Bounces).reason.contains("--light direct"));
}
