//! Scenes as a file in memory, read like any user's, and the light that a bake finds in them.

use super::baked::Baked;
use super::sphere::sphere;
use crate::error::Result;
use crate::import;
use crate::options::{BakeOptions, ImportOptions, LampUnits, Quality, SkyOption};
use crate::scene::Scene;
use crate::units::Radiance;
use glam::{DQuat, DVec3, Vec3, dvec3};
use serde_json::{Value, json};
use std::path::Path;

/// How large a model is made, how it is turned and where it is put.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// What tables call it.
    pub name: &'static str,
    /// Multiplies every length.
    pub scale: f64,
    /// Turns it about its origin.
    pub turn: DQuat,
    /// Then moves it, metres.
    pub by: DVec3,
}

impl Place {
    /// As it was built.
    pub const HERE: Self = Self { name: "×1", scale: 1.0, turn: DQuat::IDENTITY, by: DVec3::ZERO };
    /// Small.
    pub const SMALL: Self = Self { name: "×1e-3", scale: 1e-3, ..Self::HERE };
    /// Large.
    pub const LARGE: Self = Self { name: "×1e6", scale: 1e6, ..Self::HERE };
    /// Far from the origin along every axis.
    pub const FAR: Self = Self { name: "×1, 1e6 m away", by: dvec3(1e6, -1e6, 1e6), ..Self::HERE };
    /// All of them.
    pub const ALL: [Self; 4] = [Self::HERE, Self::SMALL, Self::LARGE, Self::FAR];

    /// A point of the world as the model has it.
    pub fn in_model(&self, scene: &Scene, position_world: Vec3) -> DVec3 {
        self.turn.inverse() * (position_world.as_dvec3() + scene.origin_world - self.by) / self.scale
    }
}

/// How the vertices of a file are written.
#[derive(Clone, Copy, Default)]
pub struct Written {
    /// Added to every vertex of every mesh, in f32; nodes bring none of it back.
    pub by: Vec3,
    /// Three vertices of its own for each triangle, and no indices.
    pub loose: bool,
    /// Texture coordinates of this value, which nothing uses.
    pub texcoord: Option<f32>,
    /// Vertex colours of this value.
    pub colour: Option<f32>,
}

/// A glTF file that grows. Surfaces are numbered as they come.
#[derive(Clone, Default)]
pub struct Model {
    /// How vertices are written from here on.
    pub written: Written,
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    lights: Vec<Value>,
    nodes: Vec<Value>,
    /// Radiance from everywhere.
    pub sky: f32,
    /// Whether spot lamps follow glTF's cone instead of Blender's.
    pub gltf_cones: bool,
}

impl Model {
    /// Nothing, under a sky of this radiance from everywhere.
    pub fn under_sky(sky: f32) -> Self {
        Self { sky, ..Self::default() }
    }

    /// Nothing yet; vertices will be written like this.
    pub fn written(written: Written) -> Self {
        Self { written, ..Self::default() }
    }

    /// A grey material that glows with this radiance.
    pub fn material(&mut self, rho: f64, radiance: f64) -> usize {
        self.coloured([rho; 3], radiance)
    }

    /// A material of three reflectances.
    pub fn coloured(&mut self, [r, g, b]: [f64; 3], radiance: f64) -> usize {
        self.materials.push(json!({
            "name": format!("material {}", self.materials.len()),
            "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0},
            "emissiveFactor": [1.0, 1.0, 1.0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": radiance}}
        }));
        self.materials.len() - 1
    }

    /// Makes a material count on both sides.
    pub fn double_sided(&mut self, material: usize) {
        self.materials[material]["doubleSided"] = json!(true);
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// A sphere around the origin, see [`sphere`].
    pub fn sphere(&mut self, facets: u32, radius: f64, inside: bool, above: Option<bool>, material: usize) {
        let (position, triangles) = sphere(facets, radius, inside, above);
        let position: Vec<Vec3> = position.iter().map(|corner| corner.as_vec3()).collect();
        self.mesh(&position, &triangles, material);
    }

    /// A mesh of its own node, without normals and, unless [`Self::written`] says so, texture coordinates; returns its
    /// surface.
    pub fn mesh(&mut self, position: &[Vec3], triangles: &[[u32; 3]], material: usize) -> usize {
        let Written { by, loose, texcoord, colour } = self.written;
        let moved = |p: Vec3| p + by;
        let position: Vec<Vec3> = if loose {
            triangles.as_flattened().iter().map(|&i| moved(position[i as usize])).collect()
        } else {
            position.iter().copied().map(moved).collect()
        };
        let count = position.len();
        let positions = self.view(bytemuck::cast_slice(&position));
        let least = position.iter().copied().fold(Vec3::INFINITY, Vec3::min).to_array();
        let most = position.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max).to_array();
        let position = json!({"bufferView": positions, "componentType": 5126, "type": "VEC3", "count": count,
            "min": least, "max": most});
        let mut primitive =
            json!({"attributes": {"POSITION": self.accessor(position)}, "material": material});
        if !loose {
            let view = self.view(bytemuck::cast_slice(triangles));
            let all = 3 * triangles.len();
            let indices = json!({"bufferView": view, "componentType": 5125, "type": "SCALAR", "count": all});
            primitive["indices"] = json!(self.accessor(indices));
        }
        for (name, kind, wide, value) in [("TEXCOORD_0", "VEC2", 2, texcoord), ("COLOR_0", "VEC3", 3, colour)]
        {
            if let Some(value) = value {
                let view = self.view(bytemuck::cast_slice(&vec![value; wide * count]));
                let floats = json!({"bufferView": view, "componentType": 5126, "type": kind, "count": count});
                primitive["attributes"][name] = json!(self.accessor(floats));
            }
        }
        self.meshes.push(json!({"name": format!("shape {}", self.meshes.len()), "primitives": [primitive]}));
        let mesh = self.meshes.len() - 1;
        self.nodes.push(json!({"name": format!("object {mesh}"), "mesh": mesh}));
        mesh
    }

    /// A parallelogram that faces u × v.
    pub fn quad(&mut self, corner: Vec3, u: Vec3, v: Vec3, material: usize) -> usize {
        self.mesh(&[corner, corner + u, corner + u + v, corner + v], &[[0, 1, 2], [0, 2, 3]], material)
    }

    /// The same cut into n × n.
    pub fn grid(&mut self, corner: Vec3, u: Vec3, v: Vec3, n: u32, material: usize) -> usize {
        let at = |i: u32| i as f32 / n as f32;
        let position: Vec<Vec3> =
            (0..=n).flat_map(|y| (0..=n).map(move |x| corner + u * at(x) + v * at(y))).collect();
        let corner = |x, y| x + (n + 1) * y;
        let triangles: Vec<[u32; 3]> = (0..n * n)
            .flat_map(|cell| {
                let (x, y) = (cell % n, cell / n);
                let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        self.mesh(&position, &triangles, material)
    }

    /// The six walls of a box that face inwards: −x, +x, −y, +y, −z, +z.
    pub fn room(&mut self, min: Vec3, max: Vec3, materials: [usize; 6]) -> [usize; 6] {
        let d = max - min;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        [
            self.quad(min, y, z, materials[0]),
            self.quad(min + x, z, y, materials[1]),
            self.quad(min, z, x, materials[2]),
            self.quad(min + y, x, z, materials[3]),
            self.quad(min, x, y, materials[4]),
            self.quad(min + z, y, x, materials[5]),
        ]
    }

    /// The six sides of a block that face outwards.
    pub fn block(&mut self, min: Vec3, max: Vec3, material: usize) -> [usize; 6] {
        let d = max - min;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        [
            self.quad(min, z, y, material),
            self.quad(min + x, y, z, material),
            self.quad(min, x, z, material),
            self.quad(min + y, z, x, material),
            self.quad(min, y, x, material),
            self.quad(min + z, x, y, material),
        ]
    }

    fn lamp(&mut self, light: Value, position: Vec3, axis: Vec3) {
        self.lights.push(light);
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, axis.as_dvec3().normalize());
        self.nodes.push(json!({
            "name": format!("lamp {}", self.lights.len() - 1),
            "translation": position.to_array(),
            "rotation": turn.to_array(),
            "extensions": {"KHR_lights_punctual": {"light": self.lights.len() - 1}}
        }));
    }

    /// A point lamp of so many W/sr, or a luminous sphere.
    pub fn point(&mut self, position: Vec3, intensity: f64, radius: f64) {
        let light = json!({"type": "point", "intensity": intensity, "extras": {"radius": radius}});
        self.lamp(light, position, Vec3::NEG_Z);
    }

    /// A spot lamp.
    pub fn spot(&mut self, position: Vec3, axis: Vec3, intensity: f64, [inner, outer]: [f64; 2]) {
        let cone = json!({"innerConeAngle": inner, "outerConeAngle": outer});
        self.lamp(json!({"type": "spot", "intensity": intensity, "spot": cone}), position, axis);
    }

    /// A sun of so many W/m² and this angular diameter.
    pub fn sun(&mut self, toward: Vec3, irradiance: f64, angle_rad: f64) {
        let light = json!({"type": "directional", "intensity": irradiance, "extras": {"angle": angle_rad}});
        self.lamp(light, Vec3::ZERO, -toward);
    }

    /// An elliptic area lamp that shines along an axis.
    pub fn disc(&mut self, position: Vec3, axis: Vec3, radius: f64, power: f64) {
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, axis.as_dvec3().normalize());
        self.nodes.push(
            json!({"name": "disc", "translation": position.to_array(), "rotation": turn.to_array(),
            "extras": {"lightkiln": {"area_lamp":
                {"shape": "ellipse", "size": [2.0 * radius, 2.0 * radius], "power": power}}}}),
        );
    }

    /// Lets a hand change a surface's node.
    pub fn node(&mut self, surface: usize) -> Option<&mut Value> {
        self.nodes.iter_mut().filter(|node| node.get("mesh").is_some()).nth(surface)
    }

    /// Turns the order of the nodes round, and with it that of the surfaces.
    pub fn reverse(&mut self) {
        self.nodes.reverse();
    }

    /// The file.
    pub fn glb(&self, place: &Place) -> Vec<u8> {
        let mut nodes = self.nodes.clone();
        let children: Vec<usize> = (0..nodes.len()).collect();
        let mut root = json!({
            "name": "root",
            "translation": place.by.to_array(),
            "rotation": place.turn.to_array(),
            "scale": [place.scale, place.scale, place.scale],
        });
        if !children.is_empty() {
            root["children"] = json!(children);
        }
        nodes.push(root);
        let mut lights = self.lights.clone();
        for light in &mut lights {
            // The light on a model stays the same: intensity grows with the square of its size, radii with the size.
            if light["type"] != "directional" {
                light["intensity"] =
                    json!(light["intensity"].as_f64().unwrap_or(0.0) * place.scale * place.scale);
            }
            if let Some(radius) = light["extras"]["radius"].as_f64() {
                light["extras"]["radius"] = json!(radius * place.scale);
            }
        }
        for node in &mut nodes {
            let power = node.pointer("/extras/lightkiln/area_lamp/power").and_then(Value::as_f64);
            if let Some(power) = power {
                node["extras"]["lightkiln"]["area_lamp"]["power"] = json!(power * place.scale * place.scale);
            }
        }
        let mut file = json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
            "nodes": nodes,
            "scenes": [{"nodes": [nodes.len() - 1]}],
            "scene": 0,
        });
        let mut part = |name: &str, values: &[Value]| {
            if !values.is_empty() {
                file[name] = json!(values);
            }
        };
        part("materials", &self.materials);
        part("meshes", &self.meshes);
        part("accessors", &self.accessors);
        part("bufferViews", &self.views);
        if !self.bin.is_empty() {
            part("buffers", &[json!({"byteLength": self.bin.len()})]);
        }
        if !lights.is_empty() {
            file["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
        }
        container(&file, &self.bin)
    }

    /// The file as it is read.
    pub fn scene(&self, place: &Place) -> Result<Scene> {
        let lamp_units = if self.gltf_cones { LampUnits::Gltf } else { LampUnits::Unitless };
        let sky = (self.sky > 0.0).then(|| SkyOption::Constant(Radiance::grey(self.sky)));
        let options = ImportOptions { lamp_units, sky, ..ImportOptions::default() };
        Ok(import::load_bytes(Path::new("hard case.glb"), &self.glb(place), &options)?.1)
    }

    /// Read and lit.
    pub fn bake(&self, place: &Place, options: &BakeOptions) -> Result<Baked> {
        Baked::of(self.scene(place)?, *place, options)
    }
}

fn container(json: &Value, bin: &[u8]) -> Vec<u8> {
    let pad = |mut bytes: Vec<u8>, fill: u8| {
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        bytes
    };
    let (json, bin) = (pad(json.to_string().into_bytes(), b' '), pad(bin.to_vec(), 0));
    let mut chunks = vec![(b"JSON", json)];
    if !bin.is_empty() {
        chunks.push((b"BIN\0", bin));
    }
    let length: usize = 12 + chunks.iter().map(|chunk| 8 + chunk.1.len()).sum::<usize>();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in chunks {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// A level and a page's size.
pub fn effort(quality: Quality, page_size: u32) -> BakeOptions {
    let mut options = BakeOptions { light: quality.light(), ..BakeOptions::default() };
    options.atlas.page_size = page_size;
    options
}
