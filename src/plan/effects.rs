//! Which effects a scene calls for, said in the artist's words.

use super::{Effect, Side, Sides};
use crate::scene::{Alpha, LampKind, Role, Scene};

/// Lists every effect with its reason.
pub fn effects(scene: &Scene, sides: &[Sides]) -> Vec<Effect> {
    let lamps = |what: &str, kind: &dyn Fn(&LampKind) -> bool| {
        let names: Vec<&str> =
            scene.lamps.iter().filter(|l| kind(&l.kind)).map(|l| l.name.as_str()).collect();
        if names.is_empty() {
            (false, format!("the scene has no {what}"))
        } else {
            (true, format!("{}: {}", count(names.len(), what), some_of(&names)))
        }
    };
    let surfaces = |what: &str, none: &str, test: &dyn Fn(usize) -> bool| {
        let names: Vec<&str> = (0..scene.surfaces.len())
            .filter(|&i| test(i))
            .map(|i| scene.surfaces[i].origin.name.as_str())
            .collect();
        if names.is_empty() {
            (false, none.to_owned())
        } else {
            (true, format!("{}: {}", count(names.len(), what), some_of(&names)))
        }
    };
    let material = |i: usize| scene.material(&scene.surfaces[i]);
    let mut out = Vec::new();
    let mut add = |name, (on, reason): (bool, String)| out.push(Effect { name, on, reason });
    add("area lights", surfaces("glowing object", "no material emits light", &|i| material(i).emits()));
    add("point lamps", lamps("point lamp", &|k| matches!(k, LampKind::Point { cone: None, .. })));
    add("spot lamps", lamps("spot lamp", &|k| matches!(k, LampKind::Point { cone: Some(_), .. })));
    add("suns", lamps("sun", &|k| matches!(k, LampKind::Sun { .. })));
    add(
        "soft suns",
        lamps(
            "sun with an angular size",
            &|k| matches!(k, LampKind::Sun { angle_rad, .. } if *angle_rad > 0.0),
        ),
    );
    let lit = scene.sky.is_lit();
    add("sky", (lit, if lit { "the sky is lit".into() } else { "the sky is black".into() }));
    add(
        "alpha test",
        surfaces("object with a mask", "no material uses alphaMode MASK", &|i| {
            matches!(material(i).alpha, Alpha::Mask { .. }) && scene.surfaces[i].role != Role::Emits
        }),
    );
    add(
        "tinted shadows",
        surfaces("object that lets light through", "no material uses alphaMode BLEND", &|i| {
            material(i).alpha == Alpha::Blend
        }),
    );
    add(
        "back faces",
        surfaces("object whose back can be lit", "no back of a double-sided surface can be reached", &|i| {
            sides[i].back != Side::Dark
        }),
    );
    let reflects = surfaces("reflecting object", "every surface is black", &|i| {
        let m = material(i);
        (sides[i].front != Side::Dark || sides[i].back != Side::Dark)
            && m.base_color.truncate().max_element()
                * (1.0 - m.metallic * f32::from(m.metallic_texture.is_none()))
                > 0.0
    });
    add("bounces", reflects);
    out
}

fn count(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} of: {what}") }
}

fn some_of(names: &[&str]) -> String {
    let mut distinct: Vec<&str> = names.to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    let shown = distinct.iter().take(4).map(|n| format!("'{n}'")).collect::<Vec<_>>().join(", ");
    if distinct.len() > 4 { format!("{shown}, ...") } else { shown }
}
