use super::shapes::{Random, cube, placed, soup, tries};
use crate::transport::{OpaqueTracer, Shaft, Tracer, World, segment};
use glam::{DVec3, Vec3};

fn within(random: &mut Random, [low, high]: [Vec3; 2]) -> Vec3 {
    low + (high - low) * (random.cube() * 0.5 + 0.5)
}

fn small_box(random: &mut Random, size: f32) -> [Vec3; 2] {
    let corner = random.cube() * 1.5;
    // Boxes without extent along an axis, or along all, are those of lamps and of texels that lie straight.
    let extent = (random.cube() * 0.5 + 0.5)
        * size
        * Vec3::select(random.cube().cmpgt(Vec3::ZERO), Vec3::ONE, Vec3::ZERO);
    [corner, corner + extent]
}

#[test]
fn what_a_ray_meets_reaches_into_the_shaft() {
    let mut random = Random::new(11);
    let (mut empty, mut met) = (0, 0);
    for round in 0..tries(400, 8) {
        let (count, size) =
            ([6, 40, tries(200, 60), tries(900, 90)][round % 4], [0.4, 0.1, 0.05, 0.3][round / 4 % 4]);
        let offset = [0.0, 100.0][round / 16 % 2];
        let moved = |t: [Vec3; 3]| t.map(|c| c + Vec3::splat(offset));
        let world = World::opaque(soup(&mut random, count, size).into_iter().map(moved).collect());
        let [from, to] = [0.3, 0.5].map(|size| small_box(&mut random, size).map(|c| c + Vec3::splat(offset)));
        let mut found = Vec::new();
        assert!(world.reaching_into(&Shaft::new(from, to), usize::MAX, &mut found));
        empty += usize::from(found.is_empty());
        let tracer = OpaqueTracer::new(&world);
        for _ in 0..tries(200, 10) {
            let ray = segment(within(&mut random, from), within(&mut random, to));
            if let Some(hit) = tracer.closest(&ray) {
                met += 1;
                assert!(
                    found.contains(&hit.triangle),
                    "{from:?} to {to:?} meets {:?}",
                    world.corners(hit.triangle)
                );
            }
        }
    }
    assert!(
        empty > tries(40, 2) && met > tries(10_000, 4),
        "{empty} empty shafts and {met} hits show nothing"
    );
}

#[test]
fn a_plane_parts_what_counts_from_what_does_not() {
    // A cube on the floor between a place on the floor and a lamp above it.
    let mut corners = placed(&cube(), 0.1, DVec3::new(0.5, 0.1, 0.0));
    corners.extend([[Vec3::ZERO, Vec3::Z * 9.0, Vec3::X * 9.0]; 1]);
    let world = World::opaque(corners);
    let place = Vec3::new(0.0, 1e-6, 0.0);
    let reaching = |lamp: Vec3| {
        let (mut all, mut above) = (Vec::new(), Vec::new());
        let shaft = || Shaft::new([place, place], [lamp, lamp]);
        assert!(world.reaching_into(&shaft(), 100, &mut all));
        assert!(world.reaching_into(&shaft().above(Vec3::Y, 1e-6), 100, &mut above));
        (all.len(), above.len())
    };
    let (_, above) = reaching(Vec3::new(0.0, 1.0, 0.0));
    assert_eq!(above, 0, "the floor stands in no way");
    let (all, above) = reaching(Vec3::new(1.0, 0.2, 0.0));
    assert!(above > 0 && above <= all);
}

#[test]
fn more_than_were_asked_for_are_told() {
    let mut random = Random::new(3);
    let world = World::opaque(soup(&mut random, tries(500, 200), 0.5));
    let shaft = || Shaft::new([Vec3::splat(-0.1), Vec3::ZERO], [Vec3::ONE, Vec3::ONE]);
    let mut found = Vec::new();
    assert!(!world.reaching_into(&shaft(), 5, &mut found));
    assert_eq!(found.len(), 5);
}
