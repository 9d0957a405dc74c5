//! What the tests of the export share: tiny scenes, made-up atlases and pages, and the way back from a written file.
#![allow(dead_code)]

use glam::{Vec2, Vec3};
use lightkiln::atlas::{Atlas, Page, Placement, Unwrap};
use lightkiln::export::{self, Metadata, Written};
use lightkiln::import::{self, Document};
use lightkiln::options::{ExportOptions, ImportOptions};
use lightkiln::resolve::{Lightmap, LightmapPage};
use lightkiln::scene::{Role, Scene};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A made-up way to cut a geometry into charts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Every triangle on its own: no vertex is shared.
    Triangles,
    /// Three charts of every third triangle: some vertices are split, some not, the order changes.
    Thirds,
    /// Nothing is split.
    Nowhere,
    /// Nothing is split, but the vertices come in reverse order.
    Reversed,
}

pub const CUTS: [Cut; 4] = [Cut::Triangles, Cut::Thirds, Cut::Nowhere, Cut::Reversed];

/// An atlas of two exported pages and a hidden one, of 64 texels; a node lies on page `page_of(node)`.
pub fn atlas(scene: &Scene, cut: Cut, page_of: impl Fn(usize) -> u32) -> Atlas {
    let page = |exported| Page { size_texels: 64, exported };
    let mut unwraps: HashMap<u32, Arc<Unwrap>> = HashMap::new();
    let mut fronts = Vec::new();
    for (number, surface) in scene.surfaces.iter().enumerate() {
        if surface.role != Role::Lightmapped {
            fronts.push(None);
            continue;
        }
        let unwrap = unwraps.entry(surface.geometry.0).or_insert_with(|| {
            let geometry = scene.geometry(surface);
            Arc::new(unwrap(&geometry.triangles, geometry.position_local.len(), cut))
        });
        fronts.push(Some(place(unwrap.clone(), page_of(surface.origin.node), number)));
    }
    let backs = vec![None; fronts.len()];
    let pages = vec![page(true), page(true), page(false)];
    Atlas { pages, fronts, backs, density: 16.0, ..Atlas::default() }
}

fn unwrap(triangles: &[[u32; 3]], vertex_count: usize, cut: Cut) -> Unwrap {
    let chart = |triangle: usize| match cut {
        Cut::Triangles => triangle,
        Cut::Thirds => triangle % 3,
        Cut::Nowhere | Cut::Reversed => 0,
    };
    let mut source_vertex: Vec<u32> = match cut {
        Cut::Nowhere => (0..vertex_count as u32).collect(),
        Cut::Reversed => (0..vertex_count as u32).rev().collect(),
        _ => Vec::new(),
    };
    let mut known: HashMap<(u32, usize), u32> =
        source_vertex.iter().enumerate().map(|(new, &old)| ((old, 0), new as u32)).collect();
    let corner = |triangle: usize, old: u32, source: &mut Vec<u32>, known: &mut HashMap<_, u32>| {
        *known.entry((old, chart(triangle))).or_insert_with(|| {
            source.push(old);
            source.len() as u32 - 1
        })
    };
    let split = triangles
        .iter()
        .enumerate()
        .map(|(t, corners)| corners.map(|old| corner(t, old, &mut source_vertex, &mut known)))
        .collect();
    let charts: Vec<u32> = (0..triangles.len()).map(|t| chart(t) as u32).collect();
    let chart_count = charts.iter().max().map_or(0, |most| most + 1);
    Unwrap { source_vertex, triangles: split, chart_of_triangle: charts, chart_count }
}

/// Every vertex somewhere else on the page.
fn place(unwrap: Arc<Unwrap>, page: u32, seed: usize) -> Placement {
    let fraction = |x: usize| (x as u32).wrapping_mul(2_654_435_769) as f32 / u32::MAX as f32;
    let uv_texels: Vec<Vec2> = (0..unwrap.source_vertex.len())
        .map(|v| Vec2::new(fraction(v * 2 + seed * 7919), fraction(v * 2 + 1 + seed * 7919)) * 62.0 + 1.0)
        .collect();
    let min = uv_texels.iter().copied().fold(Vec2::splat(64.0), Vec2::min);
    let max = uv_texels.iter().copied().fold(Vec2::ZERO, Vec2::max);
    Placement { page, unwrap, uv_texels, rect_texels: [min, max] }
}

/// Made-up pages for an atlas.
pub fn lightmap(atlas: &Atlas) -> Lightmap {
    let page = |(number, page): (usize, &Page)| {
        let count = (page.size_texels * page.size_texels) as usize;
        let value = (0..count).map(|i| Vec3::new(number as f32, i as f32 / count as f32, 0.25)).collect();
        LightmapPage { size_texels: page.size_texels, value, covered: vec![true; count] }
    };
    Lightmap { pages: atlas.pages.iter().filter(|p| p.exported).enumerate().map(page).collect() }
}

pub fn metadata() -> Metadata {
    Metadata {
        generator: "lightkiln 0.1.0".to_owned(),
        settings: json!({"quality": "good"}),
        convergence: vec![("unshot".to_owned(), 1e-4)],
        ..Metadata::default()
    }
}

/// A scene and what became of it, in a folder of its own.
pub struct Baked {
    pub folder: tempfile::TempDir,
    pub before: Document,
    pub scene: Scene,
    pub atlas: Atlas,
    pub lightmap: Lightmap,
    pub written: Written,
    pub after: Document,
    pub scene_after: Scene,
}

impl Baked {
    /// Bakes a file in memory.
    pub fn new(name: &str, bytes: &[u8], cut: Cut) -> Self {
        Self::with(name, bytes, cut, |_| 0, ExportOptions::default())
    }

    pub fn with(
        name: &str,
        bytes: &[u8],
        cut: Cut,
        page_of: impl Fn(usize) -> u32,
        options: ExportOptions,
    ) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join(name);
        std::fs::write(&input, bytes).unwrap();
        Self::of_file(folder, &input, cut, page_of, options).unwrap()
    }

    /// Gives a lightmap to everything, also to what the import excludes.
    pub fn forced(name: &str, bytes: &[u8], cut: Cut) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join(name);
        std::fs::write(&input, bytes).unwrap();
        let (before, mut scene) = import::load(&input, &ImportOptions::default()).unwrap();
        scene.surfaces.iter_mut().for_each(|surface| surface.role = Role::Lightmapped);
        Self::of_scene(folder, (before, scene), cut, |_| 0, ExportOptions::default()).unwrap()
    }

    /// Bakes a file that may lie anywhere; a relative output is one in `folder`.
    pub fn of_file(
        folder: tempfile::TempDir,
        input: &Path,
        cut: Cut,
        page_of: impl Fn(usize) -> u32,
        options: ExportOptions,
    ) -> lightkiln::Result<Self> {
        let read = ImportOptions { allow_outside: true, ..ImportOptions::default() };
        Self::of_scene(folder, import::load(input, &read)?, cut, page_of, options)
    }

    /// Bakes what was loaded; a relative output is one in `folder`.
    pub fn of_scene(
        folder: tempfile::TempDir,
        (before, scene): (Document, Scene),
        cut: Cut,
        page_of: impl Fn(usize) -> u32,
        mut options: ExportOptions,
    ) -> lightkiln::Result<Self> {
        let atlas = atlas(&scene, cut, page_of);
        let lightmap = lightmap(&atlas);
        for path in [&mut options.output, &mut options.preview].into_iter().flatten() {
            *path = folder.path().join(&*path);
        }
        let written =
            export::write(&before, &scene, &atlas, &lightmap, Some(&lightmap), &metadata(), &options)?;
        let output = export::output_path(&before.path, &options)?;
        let read = ImportOptions { allow_outside: true, ..ImportOptions::default() };
        let (after, scene_after) = import::load(&output, &read)?;
        Ok(Self { folder, before, scene, atlas, lightmap, written, after, scene_after })
    }

    pub fn json(&self) -> &Value {
        &self.after.json
    }

    pub fn names(&self) -> Vec<String> {
        let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        self.written.files.iter().map(name).collect()
    }

    /// Whether some warning holds these words.
    pub fn warns(&self, words: &str) -> bool {
        self.written.warnings.iter().any(|warning| warning.what.contains(words))
    }
}

/// A GLB of this JSON and BIN chunk, with more chunks behind.
pub fn glb(json: &str, bin: Option<&[u8]>, others: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let pad = |bytes: &[u8], fill: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        bytes
    };
    let mut chunks = vec![(*b"JSON", pad(json.as_bytes(), b' '))];
    chunks.extend(bin.map(|bin| (*b"BIN\0", pad(bin, 0xEE))));
    chunks.extend(others.iter().map(|(kind, bytes)| (**kind, bytes.to_vec())));
    let length: usize = 12 + chunks.iter().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((length as u32).to_le_bytes());
    for (kind, bytes) in chunks {
        out.extend((bytes.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(bytes);
    }
    out
}

/// Collects bytes and the views and accessors on them.
#[derive(Default)]
pub struct Builder {
    pub bin: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl Builder {
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    pub fn accessor(&mut self, bytes: &[u8], component_type: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors
            .push(json!({"bufferView": view, "componentType": component_type, "type": kind, "count": count}));
        self.accessors.len() - 1
    }

    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    /// Positions of a fan-shaped, slightly bent sheet with `count` vertices, with bounds.
    pub fn positions(&mut self, count: usize) -> usize {
        let at = |i: usize| [i as f32 * 0.1, (i % 2) as f32, (i as f32 * 0.7).sin() * 0.3];
        let values: Vec<f32> = (0..count).flat_map(at).collect();
        let accessor = self.floats(&values, "VEC3");
        let column = |axis: usize| values.iter().skip(axis).step_by(3).copied();
        let low: Vec<f32> = (0..3).map(|axis| column(axis).fold(f32::MAX, f32::min)).collect();
        let high: Vec<f32> = (0..3).map(|axis| column(axis).fold(f32::MIN, f32::max)).collect();
        self.accessors[accessor]["min"] = json!(low);
        self.accessors[accessor]["max"] = json!(high);
        accessor
    }

    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    /// Indices of the strip that `positions` is, as a list.
    pub fn sheet(&mut self, count: usize) -> usize {
        let triangle = |i: u16| if i.is_multiple_of(2) { [i, i + 1, i + 2] } else { [i, i + 2, i + 1] };
        let values: Vec<u16> = (0..count as u16 - 2).flat_map(triangle).collect();
        self.indices(&values)
    }

    /// The whole JSON: `rest` is merged into what was collected.
    pub fn json(&self, rest: Value) -> Value {
        let mut json = json!({
            "asset": {"version": "2.0", "generator": "Khronos glTF Blender I/O v4.5.51"},
            "scene": 0,
            "buffers": [{"byteLength": self.bin.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        if let (Some(json), Value::Object(rest)) = (json.as_object_mut(), rest) {
            json.extend(rest);
        }
        json
    }

    pub fn glb(&self, rest: Value) -> Vec<u8> {
        glb(&self.json(rest).to_string(), Some(&self.bin), &[])
    }
}

/// One node with one mesh of one primitive; `primitive`, `node` and `rest` are merged in.
pub fn one(builder: &Builder, primitive: Value) -> Vec<u8> {
    builder.glb(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Sheet", "mesh": 0}],
        "meshes": [{"name": "SheetMesh", "primitives": [primitive]}],
    }))
}

/// A sheet of `count` vertices: POSITION is accessor 0, indices accessor 1.
pub fn sheet(count: usize) -> Builder {
    let mut builder = Builder::default();
    builder.positions(count);
    builder.sheet(count);
    builder
}

/// One black pixel.
pub const PNG: &[u8] = b"\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\
    \x00\x00\x00\x3a\x7e\x9b\x55\x00\x00\x00\x0a\x49\x44\x41\x54\x78\x9c\x63\x60\x00\x00\x00\x02\x00\x01\x48\
    \xaf\xa4\x71\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";
