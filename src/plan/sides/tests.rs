//! Rooms, boxes and what stands in them.

use super::*;
use crate::scene::{Alpha, Geometry, GeometryId, Lamp, Material, MaterialId, Origin};
use crate::units::{Intensity, Radiance};
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

const QUADS: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// The faces of a unit cube around the origin, each with its own vertices, as exporters write flat shading.
fn cube_faces(faces: &[usize]) -> Geometry {
    let mut geometry = Geometry { name: "cube".into(), ..Geometry::default() };
    for &f in faces {
        let first = geometry.position_local.len() as u32;
        for i in QUADS[f] {
            let bit = |axis: u32| (i >> axis & 1) as f32 - 0.5;
            geometry.position_local.push(Vec3::new(bit(0), bit(1), bit(2)));
        }
        geometry.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| first + i)));
    }
    geometry
}

fn turned(mut geometry: Geometry) -> Geometry {
    geometry.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    geometry
}

struct World(Scene);

impl World {
    fn new() -> Self {
        let material = Material { double_sided: true, ..Material::default() };
        Self(Scene { materials: vec![material], ..Scene::default() })
    }

    fn add(&mut self, geometry: Geometry, node: usize, pose: DAffine3) -> usize {
        let origin = Origin { name: format!("n{node}"), node, mesh: node, ..Origin::default() };
        let to_world = |p: &Vec3| pose.transform_point3(p.as_dvec3()).as_vec3();
        self.0.surfaces.push(Surface {
            origin,
            geometry: GeometryId(self.0.geometries.len() as u32),
            material: MaterialId(0),
            world_from_local: pose,
            position_world: geometry.position_local.iter().map(to_world).collect(),
            normal_world: vec![Vec3::Y; geometry.position_local.len()],
            mirrored: pose.matrix3.determinant() < 0.0,
            role: Role::Lightmapped,
            density_factor: 1.0,
        });
        self.0.geometries.push(geometry);
        self.0.surfaces.len() - 1
    }

    fn material(&mut self, surface: usize, material: Material) {
        self.0.surfaces[surface].material = MaterialId(self.0.materials.len() as u32);
        self.0.materials.push(Material { double_sided: true, ..material });
    }

    fn lamp(&mut self, at: Vec3) {
        let kind = LampKind::Point {
            position_world: at,
            intensity: Intensity::grey(1.0),
            range_m: None,
            radius_m: 0.0,
            soft_falloff: false,
            cone: None,
        };
        self.0.lamps.push(Lamp { name: "lamp".into(), kind });
    }

    fn dropped(&self) -> Vec<bool> {
        sides_with_evidence(&self.0).backs.iter().map(|back| back.dropped).collect()
    }

    fn reason(&self, surface: usize) -> String {
        sides_with_evidence(&self.0).backs[surface].reason.clone()
    }
}

fn pose(scale: f64, at: [f64; 3]) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(DVec3::splat(scale), DQuat::from_rotation_y(0.3), at.into())
}

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

#[test]
fn a_closed_box_loses_its_back_also_mirrored_and_squashed() {
    for scale in [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(3.0, -0.01, 1e3), DVec3::splat(-1e-3)] {
        let mut world = World::new();
        world.add(cube_faces(&ALL), 0, DAffine3::from_scale(scale));
        assert_eq!(world.dropped(), [true], "{scale}");
        assert_eq!(world.0.surfaces.len(), sides(&world.0).len());
        assert_eq!(sides(&world.0)[0], Sides { front: Side::Lightmapped, back: Side::Dark });
    }
}

#[test]
fn an_open_an_inward_and_a_flat_box_keep_it() {
    let mut world = World::new();
    world.add(cube_faces(&ALL[..5]), 0, pose(1.0, [0.0; 3]));
    world.add(turned(cube_faces(&ALL)), 1, pose(1.0, [5.0, 0.0, 0.0]));
    world.add(
        cube_faces(&ALL),
        2,
        DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 0.0, 1.0),
            DQuat::IDENTITY,
            DVec3::new(10.0, 0.0, 0.0),
        ),
    );
    assert_eq!(world.dropped(), [false; 3]);
    assert_eq!(world.reason(0), "not closed");
    assert!(world.reason(1).contains("inward") && world.reason(2).contains("scale"));
}

#[test]
fn two_materials_close_one_box_together() {
    let mut world = World::new();
    world.add(cube_faces(&ALL[..3]), 0, pose(1.0, [0.0; 3]));
    world.add(cube_faces(&ALL[3..]), 0, pose(1.0, [0.0; 3]));
    assert_eq!(world.dropped(), [true, true]);
    world.0.surfaces[1].origin.node = 7;
    assert_eq!(world.dropped(), [false, false]);
}

#[test]
fn a_room_with_something_inside_keeps_its_back() {
    let mut room = World::new();
    room.add(cube_faces(&ALL), 0, pose(4.0, [0.0; 3]));
    room.lamp(Vec3::new(0.5, 0.5, 0.5));
    assert_eq!((room.dropped()[0], room.reason(0).as_str()), (false, "lamp 'lamp' is inside"));

    let mut room = World::new();
    room.add(cube_faces(&ALL), 0, pose(4.0, [0.0; 3]));
    let furniture = room.add(cube_faces(&ALL), 1, pose(1.0, [0.2, 0.0, 0.4]));
    assert_eq!(room.dropped(), [false, true]);
    assert_eq!(room.reason(0), "'n1' is inside");
    // Sunk into the floor of the room it lies partly outside.
    let sunk = pose(1.0, [0.2, -1.9, 0.4]);
    let geometry = room.0.geometries[furniture].clone();
    room.0.surfaces.truncate(1);
    room.add(geometry, 1, sunk);
    assert_eq!(room.dropped(), [true, true]);
    // But a sunk light fitting lights the room.
    room.material(1, Material { emission: Radiance::grey(1.0), ..Material::default() });
    assert_eq!(room.dropped(), [false, true]);
    assert_eq!(room.reason(0), "'n1' reaches inside");
}

#[test]
fn things_that_stand_beside_or_on_a_box_do_not_matter() {
    let mut world = World::new();
    world.add(cube_faces(&ALL), 0, DAffine3::from_scale(DVec3::new(10.0, 1.0, 10.0)));
    let on_top = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.7),
        DQuat::from_rotation_y(0.3),
        DVec3::new(1.0, 0.85, 2.0),
    );
    world.add(cube_faces(&ALL), 1, on_top);
    world.lamp(Vec3::new(0.0, 0.51, 0.0));
    assert_eq!(world.dropped(), [true, true]);
}

#[test]
fn a_transparent_box_keeps_its_back() {
    for alpha in [Alpha::Blend, Alpha::Mask { cutoff: 0.5 }] {
        let mut world = World::new();
        let glass = world.add(cube_faces(&ALL), 0, pose(1.0, [0.0; 3]));
        let base_color = Vec4::new(1.0, 1.0, 1.0, 0.3);
        world.material(glass, Material { alpha, base_color, ..Material::default() });
        assert_eq!((world.dropped()[0], world.reason(0).as_str()), (false, "lets light through"));
        // The same mode lets nothing through where alpha is 1.
        world.material(glass, Material { alpha, ..Material::default() });
        assert!(world.dropped()[0]);
    }
}

/// A bow tie: two tetrahedra-like wedges that share a crossing; one of them is inside out although all edges pair up.
#[test]
fn a_closed_skin_with_a_part_inside_out_keeps_its_back() {
    let mut tie = Geometry { name: "tie".into(), ..Geometry::default() };
    // A prism whose outline crosses itself in x–y: (0,0) (4,2) (4,0) (0,1.5); extruded in z.
    let outline = [[0.0, 0.0], [4.0, 2.0], [4.0, 0.0], [0.0, 1.5]];
    for z in [0.0, 1.0] {
        tie.position_local.extend(outline.map(|[x, y]| Vec3::new(x, y, z)));
    }
    for i in 0..4_u32 {
        let j = (i + 1) % 4;
        tie.triangles.extend([[i, j, j + 4], [i, j + 4, i + 4]]);
    }
    tie.triangles.extend([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]);
    let mut world = World::new();
    world.add(tie.clone(), 0, DAffine3::IDENTITY);
    world.add(turned(tie), 1, DAffine3::from_translation(DVec3::new(10.0, 0.0, 0.0)));
    assert_eq!(world.dropped(), [false, false]);
    assert!((0..2).any(|i| world.reason(i) == "a part of it is turned inside out"));
}

#[test]
fn roles_decide_the_front() {
    let mut world = World::new();
    for i in 0..4 {
        world.add(cube_faces(&[0]), i, pose(1.0, [3.0 * i as f64, 0.0, 0.0]));
    }
    world.0.surfaces[1].role = Role::Reflects;
    world.0.surfaces[2].role = Role::Blocks;
    world.material(3, Material { unlit: true, ..Material::default() });
    let of = |front, back| Sides { front, back };
    let expected = [
        of(Side::Lightmapped, Side::Hidden),
        of(Side::Hidden, Side::Hidden),
        of(Side::Dark, Side::Dark),
        of(Side::Dark, Side::Dark),
    ];
    assert_eq!(sides(&world.0), expected);
    world.0.materials[0].double_sided = false;
    assert_eq!(sides(&world.0)[0], of(Side::Lightmapped, Side::Dark));
}
