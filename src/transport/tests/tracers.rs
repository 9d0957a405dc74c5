use super::shapes::{Random, brute_force, independent, soup, tries};
use crate::scene::{Alpha, Geometry, GeometryId, Material, MaterialId, Role, Scene, Surface};
use crate::transport::{Blocking, OpaqueTracer, Ray, Tracer, World};
use crate::with_tracer;
use glam::{DAffine3, Vec3, Vec4};

/// One square at each z, facing +z, with its material.
fn panes(panes: &[(f32, Material)]) -> Scene {
    let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let geometry = Geometry {
        position_local: square.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        normal_local: vec![Vec3::Z; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Geometry::default()
    };
    let surfaces = panes.iter().enumerate().map(|(i, (z, _))| Surface {
        origin: Default::default(),
        geometry: GeometryId(0),
        material: MaterialId(i as u32),
        world_from_local: DAffine3::IDENTITY,
        position_world: geometry.position_local.iter().map(|p| *p + Vec3::Z * *z).collect(),
        normal_world: vec![Vec3::Z; 4],
        mirrored: false,
        role: Role::Lightmapped,
        density_factor: 1.0,
    });
    Scene {
        surfaces: surfaces.collect(),
        materials: panes.iter().map(|(_, material)| material.clone()).collect(),
        geometries: vec![geometry],
        ..Scene::default()
    }
}

fn material(alpha: Alpha, color: Vec4) -> Material {
    Material { alpha, base_color: color, ..Material::default() }
}

fn down() -> Ray {
    Ray::unbounded(Vec3::new(0.3, 0.2, 10.0), Vec3::NEG_Z)
}

#[test]
fn indices_map_back_to_surfaces() {
    let scene = panes(&[(0.0, Material::default()), (1.0, Material::default())]);
    let world = World::new(&scene);
    assert_eq!(world.len(), 4);
    let hit = OpaqueTracer::new(&world).closest(&down()).unwrap();
    assert_eq!((world.surface_of(hit.triangle), world.local_triangle(hit.triangle)), (1, 0));
    assert_eq!(world.triangle_of(1, 0), hit.triangle);
    assert!((scene.position(world.surface_point(&hit)) - Vec3::new(0.3, 0.2, 1.0)).length() < 1e-6);
    assert_eq!((hit.t, hit.front), (9.0, true));
    assert_eq!(world.normal(hit.triangle), Vec3::Z);
}

#[test]
fn the_tree_finds_what_trying_every_triangle_finds() {
    let mut random = Random::new(1);
    for (count, size) in [(1, 1.0), (7, 0.5), (tries(300, 60), 0.3), (tries(5000, 150), 0.05)] {
        let world = World::opaque(soup(&mut random, count, size));
        let tracer = OpaqueTracer::new(&world);
        for _ in 0..tries(2000, 6) {
            let ray =
                Ray { t_max: random.unit() * 3.0, ..Ray::unbounded(random.cube() * 1.5, random.direction()) };
            let found = tracer.closest(&ray);
            assert_eq!(found, brute_force(&world, &ray), "{ray:?}");
            assert_eq!(tracer.occluded(&ray), found.is_some());
        }
    }
}

#[test]
fn hits_agree_with_an_independent_test_in_f64() {
    let mut random = Random::new(2);
    let world = World::opaque(soup(&mut random, 200, 0.4));
    let tracer = OpaqueTracer::new(&world);
    for _ in 0..tries(5000, 10) {
        let ray = Ray::unbounded(random.cube(), random.direction());
        let hits = (0..200).filter_map(|t| Some((independent(&ray, &world.corners(t))?, t)));
        let nearest = hits.min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        // Hits this close to an edge or to the origin may fall either way by rounding.
        let Some(((t, inside), triangle)) = nearest else { continue };
        if inside < 1e-5 || t < 1e-5 {
            continue;
        }
        let hit = tracer.closest(&ray).unwrap();
        assert!(
            (f64::from(hit.t) - t).abs() < 1e-5 || hit.triangle != triangle && f64::from(hit.t) < t,
            "{ray:?}"
        );
    }
}

#[test]
fn a_tinted_pane_takes_its_share() {
    let glass = material(Alpha::Blend, Vec4::new(1.0, 0.5, 0.0, 0.25));
    let scene = panes(&[(0.0, Material::default()), (1.0, glass.clone()), (1.0, glass)]);
    let world = World::new(&scene);
    assert_eq!(world.blocking(), Blocking::Tinted);
    let mut visits = Vec::new();
    let (left, shadow) = with_tracer!(world.tracer(&scene), tracer => {
        let shadow = tracer.transmittance(&Ray { t_max: 9.5, ..down() });
        assert!(tracer.occluded(&down()) && !tracer.occluded(&Ray { t_max: 9.5, ..down() }));
        (tracer.walk(&down(), |hit, share| visits.push((hit.triangle, share))), shadow)
    });
    let passes = Vec3::new(0.75, 0.375, 0.0);
    assert_eq!(left, Vec3::ZERO);
    assert_eq!(shadow, passes * passes);
    let floor = passes * passes;
    assert_eq!(visits, [(2, Vec3::splat(0.25)), (4, passes * 0.25), (0, floor)]);
}

#[test]
fn only_what_needs_it_is_asked() {
    let leaf = |alpha| material(Alpha::Mask { cutoff: 0.5 }, Vec4::new(1.0, 1.0, 1.0, alpha));
    let scene = panes(&[(0.0, leaf(0.6)), (1.0, leaf(0.4))]);
    let world = World::new(&scene);
    assert_eq!(world.blocking(), Blocking::Opaque);
    let hit = OpaqueTracer::new(&world).closest(&down()).unwrap();
    assert_eq!(world.surface_of(hit.triangle), 0);
}

#[test]
fn a_world_of_nothing_stops_nothing() {
    let world = World::opaque(Vec::new());
    let tracer = OpaqueTracer::new(&world);
    assert_eq!(tracer.closest(&down()), None);
    assert!(!tracer.occluded(&down()));
}

#[test]
fn broken_triangles_stop_nothing_and_keep_their_index() {
    let good = [Vec3::NEG_X, Vec3::X, Vec3::Y];
    let bad = [Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e20), Vec3::ZERO].map(|v| [Vec3::ZERO, Vec3::X, v]);
    let world = World::opaque(bad.into_iter().chain([good]).collect());
    let hit = OpaqueTracer::new(&world).closest(&down()).unwrap();
    assert_eq!(hit.triangle, 4);
    assert_eq!(world.len(), 5);
}

#[test]
fn thousands_of_equal_triangles_do_no_harm() {
    let world = World::opaque(vec![[Vec3::NEG_X * 3.0, Vec3::X * 3.0, Vec3::Y * 3.0]; tries(5000, 60)]);
    let hit = OpaqueTracer::new(&world).closest(&down()).unwrap();
    assert_eq!((hit.triangle, hit.t), (0, 10.0));
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let mut random = Random::new(3);
    let world = World::opaque(soup(&mut random, 100, 0.5));
    let tracer = OpaqueTracer::new(&world);
    for bad in [Vec3::ZERO, Vec3::NAN, Vec3::new(f32::NAN, 1.0, 0.0), Vec3::INFINITY] {
        assert_eq!(tracer.closest(&Ray::unbounded(Vec3::ZERO, bad)), None);
        assert_eq!(tracer.closest(&Ray::unbounded(bad * f32::NAN, Vec3::X)), None);
    }
}
