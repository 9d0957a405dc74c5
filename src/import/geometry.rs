//! A primitive as the scene wants it: positions, normals, texture coordinates and colours in floats.

use super::document::{Document, RawAccessor, RawPrimitive};
use super::json::{MESHES, Part};
use super::pose::Rig;
use super::primitive::Topology;
use crate::error::{Error, Result, Warning};
use crate::scene::Geometry;
use glam::{DVec3, Vec2, Vec3, Vec4};

/// Texture coordinate sets beyond this are left alone: no material of glTF is known to use them.
const MAX_TEXCOORDS: usize = 8;
/// Cosine of half a degree: normals closer than this to their triangle's plane normal count as flat.
const FLAT_COSINE: f32 = 0.999_961_9;

/// From this many times its size on, a mesh's vertices know it to less than a thousandth of its size.
const FAR_IN_SIZES: f32 = 8192.0;

/// A geometry and what its rest pose needs.
pub(super) struct Built {
    pub geometry: Geometry,
    /// Joints and morph targets, when the primitive has any.
    pub rig: Option<Rig>,
    pub warnings: Vec<Warning>,
}

/// Reads a primitive. `node` is one that uses it, for messages.
pub(super) fn build(document: &Document, mesh: usize, primitive: usize, node: &str) -> Result<Built> {
    let mesh_part = Part::item(&document.json, MESHES, mesh)?;
    let part = mesh_part.nth("primitives", "primitive", primitive)?;
    let raw = document.raw_primitive(mesh, primitive)?;
    let mut reader = Reader { part, warnings: Vec::new() };
    let position_local = reader.positions(&raw, node)?;
    reader.warn_of_far_origin(&position_local);
    let texcoords = reader.texcoords(&raw)?;
    let color = reader.colors(&raw)?;
    let file_normals = reader.normals(&raw)?;
    let rig = Rig::read(&raw, &part)?;
    let unindexed = !part.object.contains_key("indices") && Topology::of(&part)? == Topology::Triangles;
    let mut geometry = Geometry {
        name: mesh_part.label(),
        position_local,
        normal_local: Vec::new(),
        texcoords,
        color,
        triangles: raw.triangles,
        smooth: false,
        unindexed,
    };
    reader.fill_normals(&mut geometry, file_normals);
    Ok(Built { geometry, rig, warnings: reader.warnings })
}

/// Reads attributes and remembers what was wrong with them.
struct Reader<'a> {
    part: Part<'a>,
    warnings: Vec<Warning>,
}

fn find<'r>(raw: &'r RawPrimitive, name: &str) -> Option<&'r RawAccessor> {
    raw.attributes.iter().find(|(semantic, _)| semantic == name).map(|(_, accessor)| accessor)
}

pub(super) fn vectors3(floats: &[f32]) -> Vec<Vec3> {
    floats.chunks_exact(3).map(Vec3::from_slice).collect()
}

impl Reader<'_> {
    fn warn(&mut self, what: String) {
        self.warnings.push(Warning::new(self.part.at(), what));
    }

    fn bad_format(&self, name: &str, must: &str) -> Error {
        Error::invalid(self.part.at(), format!("{name} must be {must}: export the scene again"))
    }

    fn positions(&self, raw: &RawPrimitive, node: &str) -> Result<Vec<Vec3>> {
        let accessor = find(raw, "POSITION")
            .filter(|accessor| accessor.kind == "VEC3" && accessor.component_type != 5125)
            .ok_or_else(|| self.bad_format("POSITION", "three floats or short integers"))?;
        let positions = vectors3(&accessor.to_floats());
        match positions.iter().position(|p| !p.is_finite()) {
            None => Ok(positions),
            Some(vertex) => {
                let what = format!(
                    "vertex {vertex} (used by node '{node}') is not a number; repair the mesh, for example with \
                     Mesh > Clean Up in Blender, and export it again"
                );
                Err(Error::invalid(self.part.at(), what))
            }
        }
    }

    /// Vertices so far from their own origin that floats there are coarse for what they form. What is lost was lost when
    /// the file was written.
    fn warn_of_far_origin(&mut self, positions: &[Vec3]) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = positions.iter().fold(empty, |(low, high), &p| (low.min(p), high.max(p)));
        let (size, farthest) = ((high - low).max_element(), low.abs().max(high.abs()).max_element());
        if size > 0.0 && farthest > FAR_IN_SIZES * size {
            let what = format!(
                "its vertices lie {farthest:.0} from their own origin, where a 32 bit float moves in steps of {:.1e}: its \
                 shape is rounded to that. Move the origin to the mesh (Blender: Object > Set Origin > Origin to Geometry)",
                farthest * f32::EPSILON
            );
            self.warn(what);
        }
    }

    fn normals(&self, raw: &RawPrimitive) -> Result<Option<Vec<Vec3>>> {
        let Some(accessor) = find(raw, "NORMAL") else { return Ok(None) };
        if accessor.kind != "VEC3" || accessor.component_type == 5125 {
            return Err(self.bad_format("NORMAL", "three floats or signed integers"));
        }
        Ok(Some(vectors3(&accessor.to_floats())))
    }

    fn texcoords(&mut self, raw: &RawPrimitive) -> Result<Vec<Vec<Vec2>>> {
        let count = raw.triangle_vertex_count();
        let mut sets: Vec<Vec<Vec2>> = Vec::new();
        for set in 0..MAX_TEXCOORDS {
            let name = format!("TEXCOORD_{set}");
            let Some(accessor) = find(raw, &name) else { continue };
            let integers_as_they_are = accessor.component_type != 5126 && !accessor.normalized;
            // KHR_mesh_quantization allows those too: KHR_texture_transform scales them back.
            if accessor.kind != "VEC2" || (accessor.component_type == 5125 && integers_as_they_are) {
                return Err(self.bad_format(&name, "two floats or short integers"));
            }
            if sets.len() < set {
                self.warn(format!("it has {name} but not all sets before it; those are taken as zero"));
                sets.resize_with(set, || vec![Vec2::ZERO; count]);
            }
            sets.push(accessor.to_floats().chunks_exact(2).map(Vec2::from_slice).collect());
        }
        Ok(sets)
    }

    fn colors(&mut self, raw: &RawPrimitive) -> Result<Vec<Vec4>> {
        let Some(accessor) = find(raw, "COLOR_0") else { return Ok(Vec::new()) };
        let floats = accessor.to_floats();
        let mut colors: Vec<Vec4> = match accessor.kind.as_str() {
            _ if accessor.component_type != 5126 && !accessor.normalized => Vec::new(),
            "VEC3" => floats.chunks_exact(3).map(|c| Vec3::from_slice(c).extend(1.0)).collect(),
            "VEC4" => floats.chunks_exact(4).map(Vec4::from_slice).collect(),
            _ => Vec::new(),
        };
        if colors.len() != accessor.count {
            return Err(self.bad_format("COLOR_0", "three or four floats or fractions"));
        }
        let mut outside = 0;
        for color in &mut colors {
            let lawful = color.map(|c| if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) });
            outside += usize::from(lawful != *color);
            *color = lawful;
        }
        if outside > 0 {
            self.warn(format!("{outside} of its vertex colours lie outside 0 to 1 and are clamped"));
        }
        Ok(colors)
    }

    /// Normals of the file made whole, or computed. Without normals glTF wants flat triangles; the vertices keep their
    /// order, so their normals are averages and `smooth` says that shading uses the plane of the triangle instead.
    fn fill_normals(&mut self, geometry: &mut Geometry, from_file: Option<Vec<Vec3>>) {
        let (positions, triangles) = (&geometry.position_local, &geometry.triangles);
        let Some(mut normals) = from_file else {
            geometry.normal_local = average_normals(positions, triangles);
            return;
        };
        let mut averages = None;
        let mut replaced = 0;
        for (vertex, normal) in normals.iter_mut().enumerate() {
            *normal = match unit(*normal) {
                Some(unit) => unit,
                None => {
                    replaced += 1;
                    averages.get_or_insert_with(|| average_normals(positions, triangles))[vertex]
                }
            };
        }
        if replaced > 0 {
            self.warn(format!(
                "{replaced} of its normals are zero or not numbers; the faces' normals are used there"
            ));
        }
        geometry.smooth = triangles.iter().any(|triangle| {
            let plane = unit(face_vector(positions, triangle).normalize_or_zero().as_vec3());
            plane.is_some_and(|plane| triangle.iter().any(|&v| normals[v as usize].dot(plane) < FLAT_COSINE))
        });
        geometry.normal_local = normals;
    }
}

impl RawPrimitive {
    /// Number of vertices.
    fn triangle_vertex_count(&self) -> usize {
        find(self, "POSITION").map_or(0, |accessor| accessor.count)
    }
}

/// A unit vector in the direction of `v`, however short it is.
fn unit(v: Vec3) -> Option<Vec3> {
    if !v.is_finite() {
        return None;
    }
    let v = v.as_dvec3();
    (v.length_squared() > 0.0).then(|| v.normalize().as_vec3())
}

/// Twice the area of a triangle times its normal. In f64, where the products of no finite floats overflow or vanish.
fn face_vector(positions: &[Vec3], triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3());
    (b - a).cross(c - a)
}

/// Area-weighted mean normal of the triangles at each vertex; up where there are none.
fn average_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let face = face_vector(positions, triangle);
        for &vertex in triangle {
            sums[vertex as usize] += face;
        }
    }
    sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::Y).as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::Builder;
    use super::*;
    use serde_json::{Value, json};

    const TENT: [f32; 12] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.];

    fn built(builder: &Builder, primitive: Value) -> Result<Built> {
        let document = builder.document(json!({"meshes": [{"name": "Tent", "primitives": [primitive]}]}))?;
        build(&document, 0, 0, "Camp")
    }

    fn tent() -> Builder {
        let mut builder = Builder::default();
        builder.floats(&TENT, "VEC3");
        builder.indices(&[0, 1, 2, 0, 3, 1]);
        builder
    }

    #[test]
    fn missing_normals_shade_flat_and_keep_the_vertices() {
        let built = built(&tent(), json!({"attributes": {"POSITION": 0}, "indices": 1})).unwrap();
        let geometry = built.geometry;
        assert_eq!(geometry.position_local.len(), 4);
        assert_eq!(geometry.triangles, [[0, 1, 2], [0, 3, 1]]);
        assert!(!geometry.smooth && !geometry.unindexed);
        assert_eq!(geometry.normal_local[2], Vec3::Z);
        assert!((geometry.normal_local[0] - Vec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-6);
    }

    #[test]
    fn normals_of_the_file_decide_smoothness() {
        let with = |tilt: f32| {
            let mut builder = Builder::default();
            builder.floats(&TENT[..9], "VEC3");
            let n = [tilt.sin() * 3.0, 0.0, tilt.cos() * 3.0];
            builder.floats(&[n, n, n].concat(), "VEC3");
            built(&builder, json!({"attributes": {"POSITION": 0, "NORMAL": 1}})).unwrap().geometry
        };
        assert!(!with(0.0).smooth && with(0.0).unindexed);
        assert!(!with(0.4_f32.to_radians()).smooth);
        assert!(with(0.6_f32.to_radians()).smooth);
        assert!(with(std::f32::consts::PI).smooth);
        assert!((with(0.3).normal_local[1].length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn broken_normals_are_replaced_and_named() {
        let mut builder = Builder::default();
        builder.floats(&TENT[..9], "VEC3");
        builder.floats(&[0., 0., 0., f32::NAN, 0., 1., 0., 0., 1e-30], "VEC3");
        let built = built(&builder, json!({"attributes": {"POSITION": 0, "NORMAL": 1}})).unwrap();
        assert_eq!(built.geometry.normal_local, [Vec3::Z; 3]);
        assert!(built.warnings[0].at.contains("Tent") && built.warnings[0].what.starts_with("2 of"));
    }

    #[test]
    fn refuses_positions_that_are_no_numbers() {
        let mut builder = Builder::default();
        builder.floats(&[0., 0., 0., 1., f32::INFINITY, 0., 0., 1., 0.], "VEC3");
        let Err(error) = built(&builder, json!({"attributes": {"POSITION": 0}})) else { panic!("accepted") };
        let message = error.to_string();
        assert!(
            message.contains("vertex 1") && message.contains("'Tent'") && message.contains("'Camp'"),
            "{message}"
        );
    }

    #[test]
    fn reads_quantised_attributes() {
        let mut builder = Builder::default();
        let shorts = |values: &[i16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        builder.accessor(&shorts(&[0, 0, 0, 100, 0, 0, 0, -100, 0]), 5122, "VEC3", 3);
        builder.accessor(&[0, 0, 127, 0, 0, 127, 0, 0, 127], 5120, "VEC3", 3);
        builder.accessor(&[255, 0, 0, 0, 255, 0, 0, 0, 255], 5121, "VEC3", 3);
        builder.accessor(&shorts(&[1, 2, 3, 4, 5, 6]), 5122, "VEC2", 3);
        builder.accessors[1]["normalized"] = json!(true);
        builder.accessors[2]["normalized"] = json!(true);
        let json = json!({"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2, "TEXCOORD_1": 3}});
        let built = built(&builder, json).unwrap();
        let geometry = built.geometry;
        assert_eq!(geometry.position_local[2], Vec3::new(0.0, -100.0, 0.0));
        assert_eq!(geometry.normal_local[0], Vec3::Z);
        assert_eq!(geometry.color[1], Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert_eq!(geometry.texcoords[0], [Vec2::ZERO; 3]);
        assert_eq!(geometry.texcoords[1][2], Vec2::new(5.0, 6.0));
        assert_eq!(built.warnings.len(), 1);
    }

    #[test]
    fn refuses_attributes_of_other_types() {
        for (name, component_type, kind) in [
            ("POSITION", 5126, "VEC2"),
            ("POSITION", 5125, "VEC3"),
            ("NORMAL", 5126, "VEC2"),
            ("TEXCOORD_0", 5126, "VEC3"),
            ("COLOR_0", 5121, "VEC3"),
            ("COLOR_0", 5126, "VEC2"),
        ] {
            let mut builder = tent();
            let wrong = builder.accessor(&[0; 64], component_type, kind, 4);
            let mut json = json!({"attributes": {"POSITION": 0}, "indices": 1});
            json["attributes"][name] = json!(wrong);
            assert!(built(&builder, json).is_err(), "{name} {component_type} {kind}");
        }
    }

    #[test]
    fn clamps_colours() {
        let mut builder = tent();
        builder.floats(&[2., -1., f32::NAN, 1., 0., 0., 1., 1., 1., 0., 0., 0.], "VEC3");
        let built =
            built(&builder, json!({"attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1})).unwrap();
        assert_eq!(built.geometry.color[0], Vec4::new(1.0, 0.0, 1.0, 1.0));
        assert!(built.warnings[0].what.starts_with("1 of"));
    }
}
