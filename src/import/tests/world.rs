use super::*;
use crate::scene::{Role, SurfacePoint};
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;

fn nodes(nodes: Value) -> Result<Scene> {
    let roots: Vec<usize> = (0..nodes.as_array().map_or(0, Vec::len)).collect();
    square(json!({"nodes": nodes, "scenes": [{"nodes": roots}]}))
}

/// Plane normal of the first triangle from its corners, and the shading normal there.
fn normals(scene: &Scene) -> (Vec3, Vec3) {
    let surface = &scene.surfaces[0];
    let at = SurfacePoint { surface: 0, triangle: 0, barycentric: Vec2::splat(0.25) };
    (scene.plane_normal(surface, 0).unwrap(), scene.shading_normal(at))
}

#[test]
fn mirrored_objects_keep_their_front() {
    for (scale, mirrored, front) in [
        (json!([2, 1, 1]), false, Vec3::Z),
        (json!([-2, 1, 1]), true, Vec3::Z),
        (json!([1, 1, -1]), true, Vec3::NEG_Z),
        (json!([-1, -1, -1]), true, Vec3::NEG_Z),
        (json!([-1, -1, 1]), false, Vec3::Z),
    ] {
        let scene = nodes(json!([{"mesh": 0, "scale": scale}])).unwrap();
        assert_eq!(scene.surfaces[0].mirrored, mirrored, "{scale}");
        assert_eq!(scene.surfaces[0].normal_world[0], front, "{scale}");
        assert_eq!(normals(&scene), (front, front), "{scale}");
    }
}

#[test]
fn normals_stay_square_on_sheared_surfaces() {
    let shear = json!([1, 0, 0.5, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let scene = nodes(json!([{"mesh": 0, "matrix": shear}])).unwrap();
    let normal = scene.surfaces[0].normal_world[0];
    let edge = scene.surfaces[0].position_world[1] - scene.surfaces[0].position_world[0];
    assert!(normal.dot(edge).abs() < 1e-6 && (normal.length() - 1.0).abs() < 1e-6);
}

#[test]
fn flattened_objects_stay_and_vanished_ones_only_keep_their_number() {
    let scene = nodes(json!([
        {"name": "Flat", "mesh": 0, "scale": [2, 2, 0]},
        {"name": "Edge", "mesh": 0, "scale": [1, 0, 1]},
        {"name": "Gone", "mesh": 0, "scale": [0, 0, 0]}
    ]))
    .unwrap();
    let roles: Vec<Role> = scene.surfaces.iter().map(|surface| surface.role).collect();
    assert_eq!(roles, [Role::Lightmapped, Role::Blocks, Role::Blocks]);
    assert_eq!(warnings(&scene, "scale is zero"), ["Flat", "Edge", "Gone"]);
    assert_eq!(scene.surfaces[0].normal_world[0], Vec3::Z);
    assert!(scene.surfaces.iter().flat_map(|s| &s.normal_world).all(|n| n.is_normalized()));
}

#[test]
fn far_scenes_keep_their_precision() {
    let scene =
        nodes(json!([{"mesh": 0, "translation": [1e6, 0, -3e6], "scale": [0.01, 0.01, 0.01]}])).unwrap();
    let surface = &scene.surfaces[0];
    assert!(scene.origin_world.distance(DVec3::new(1e6, 0.0, -3e6)) < 0.02);
    let edge = surface.position_world[1] - surface.position_world[0];
    // Coordinates of 3e6 in f64 have steps of 5e-10.
    assert!((edge - Vec3::new(0.01, 0.0, 0.0)).length() < 1e-8, "{edge}");
    assert_eq!(square(json!({})).unwrap().origin_world, DVec3::ZERO);
    let far = json!([{"name": "Comet", "mesh": 0, "translation": [1e30, 0, 0]}]);
    assert!(refusal(nodes(far)).contains("'Comet'"));
}

#[test]
fn lamps_share_the_origin_of_the_surfaces() {
    let scene = square(json!({
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        "nodes": [
            {"mesh": 0, "translation": [1e6, 0, 0]},
            {"translation": [1e6, 0, 0.5], "extensions": {"KHR_lights_punctual": {"light": 0}}}
        ],
        "scenes": [{"nodes": [0, 1]}]
    }))
    .unwrap();
    let crate::scene::LampKind::Point { position_world, .. } = scene.lamps[0].kind else { panic!() };
    assert_eq!(position_world - scene.surfaces[0].position_world[0], Vec3::new(0.0, 0.0, 0.5));
}

#[test]
fn nodes_share_geometry_and_instances_are_expanded() {
    let mut builder = Builder::square();
    let places = builder.floats(&[0., 0., 1., 0., 0., 2., 0., 0., 3.], "VEC3");
    let json = json!({
        "nodes": [
            {"name": "A", "mesh": 0},
            {"name": "B", "mesh": 0, "translation": [10, 0, 0],
             "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}}
        ],
        "scenes": [{"nodes": [0, 1]}]
    });
    let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
    assert_eq!((scene.geometries.len(), scene.surfaces.len()), (1, 4));
    let instances: Vec<Option<usize>> = scene.surfaces.iter().map(|s| s.origin.instance).collect();
    assert_eq!(instances, [None, Some(0), Some(1), Some(2)]);
    assert_eq!(scene.surfaces[3].position_world[1], Vec3::new(11.0, 0.0, 3.0));
    assert_eq!(scene.surfaces[3].origin.name, "B");
}

#[test]
fn artists_choose_what_is_baked_and_how_finely() {
    let scene = nodes(json!([
        {"mesh": 0, "extras": {"lightkiln": {"bake": false}}},
        {"mesh": 0, "extras": {"lightkiln_density": 4}},
        {"mesh": 0}
    ]))
    .unwrap();
    let chosen: Vec<(Role, f32)> = scene.surfaces.iter().map(|s| (s.role, s.density_factor)).collect();
    assert_eq!(chosen, [(Role::Reflects, 1.0), (Role::Lightmapped, 4.0), (Role::Lightmapped, 1.0)]);
    let wrong = json!([{"name": "Vase", "mesh": 0, "extras": {"lightkiln": {"density": "fine"}}}]);
    assert!(refusal(nodes(wrong)).contains("'Vase'"));
}

#[test]
fn skinned_and_morphed_meshes_stand_in_their_rest_pose() {
    let mut builder = Builder::square();
    let joints = builder.accessor(&[0; 16], 5121, "VEC4", 4);
    let weights = builder.floats(&[1., 0., 0., 0.].repeat(4), "VEC4");
    let delta = builder.floats(&[0., 0., 2.].repeat(4), "VEC3");
    let json = json!({
        "meshes": [
            {"primitives": [{"indices": 3,
                "attributes": {"POSITION": 0, "NORMAL": 1, "JOINTS_0": joints, "WEIGHTS_0": weights}}]},
            {"weights": [0.5], "primitives": [{"indices": 3, "attributes": {"POSITION": 0, "NORMAL": 1},
                "targets": [{"POSITION": delta}]}]}
        ],
        "nodes": [
            {"name": "Skin", "mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"name": "Bone", "translation": [0, 7, 0]},
            {"name": "Face", "mesh": 1},
            {"name": "Statue", "mesh": 0}
        ],
        "skins": [{"joints": [1]}],
        "scenes": [{"nodes": [0, 1, 2, 3]}]
    });
    let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
    let roles: Vec<Role> = scene.surfaces.iter().map(|surface| surface.role).collect();
    assert_eq!(roles, [Role::Reflects, Role::Reflects, Role::Lightmapped]);
    assert_eq!(scene.surfaces[0].position_world[0], Vec3::new(0.0, 7.0, 0.0));
    assert_eq!(scene.surfaces[1].position_world[0], Vec3::new(0.0, 0.0, 1.0));
    assert_eq!(warnings(&scene, "rest pose"), ["Skin", "Face"]);
    assert_eq!(scene.surfaces[0].normal_world[0], Vec3::Z);
}

#[test]
fn flat_and_smooth_shading() {
    let tilted = |normal: [f32; 3], with_normals: bool| {
        let mut builder = Builder::square();
        let normals = builder.floats(&normal.repeat(4), "VEC3");
        let mut attributes = json!({"POSITION": 0});
        if with_normals {
            attributes["NORMAL"] = json!(normals);
        }
        let json = json!({"meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}]});
        let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
        (scene.geometries[0].smooth, normals_of(&scene))
    };
    fn normals_of(scene: &Scene) -> Vec3 {
        normals(scene).1
    }
    assert_eq!(tilted([0.6, 0.0, 0.8], false), (false, Vec3::Z));
    let (smooth, normal) = tilted([0.6, 0.0, 0.8], true);
    assert!(smooth && (normal - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6);
    assert_eq!(tilted([0.001, 0.0, 1.0], true), (false, Vec3::Z));
}

#[test]
fn points_and_lines_are_left_out_by_name() {
    let both = json!({"meshes": [{"name": "Wire", "primitives": [
        {"attributes": {"POSITION": 0}, "mode": 1}, {"attributes": {"NORMAL": 1}}, {"attributes": {"POSITION": 0}, "indices": 3}
    ]}]});
    let scene = square(both).unwrap();
    assert_eq!(scene.surfaces.len(), 1);
    assert_eq!(scene.surfaces[0].origin.primitive, 2);
    assert_eq!(warnings(&scene, "points or lines"), ["mesh 'Wire', primitive 0"]);
    assert_eq!(warnings(&scene, "no POSITION"), ["mesh 'Wire', primitive 1"]);
}

#[test]
fn empty_scenes_are_refused_with_a_remedy() {
    for rest in [
        json!({"scenes": [{"nodes": []}]}),
        json!({"nodes": [{}]}),
        json!({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}]}),
    ] {
        let said = refusal(square(rest));
        assert!(said.contains("no triangles to bake") && said.contains("--scene"), "{said}");
    }
    assert!(
        refusal(square(
            json!({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 4}]}]})
        ))
        .contains("material 4")
    );
}

#[test]
fn claims_of_many_vertices_are_refused_before_they_are_placed() {
    let mut builder = Builder::square();
    // 9 million instances of zeros that no data backs: above the free allowance for such accessors.
    builder.accessors.push(json!({"componentType": 5126, "type": "VEC3", "count": 9_000_000}));
    let json = json!({"nodes": [{"mesh": 0,
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 4}}}}]});
    let result = builder.load_square(json, &ImportOptions::default()).map(|(_, scene)| scene);
    assert!(matches!(result, Err(Error::TooLarge { .. })));
}
