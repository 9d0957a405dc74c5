//! Every lightmapped node gets a mesh object of its own, which shares all accessors but the lightmap coordinates.

use super::super::carrier::Carrier;
use super::append::{Edit, index_at, items, remove_extension};
use super::instances;
use super::materials::Wardrobe;
use super::texcoord;
use super::vertices::{DRACO, Splitter, Wiring};
use crate::atlas::{Atlas, Placement};
use crate::error::{Error, Result};
use crate::scene::Scene;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Extensions of primitives that do not number vertices, so a split leaves them true.
const INDIFFERENT_TO_ORDER: [&str; 3] =
    ["KHR_materials_variants", "EXT_mesh_features", "EXT_structural_metadata"];

/// A node that got a lightmap.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Worn {
    /// Index in the output.
    pub node: usize,
    /// As the artist knows it.
    pub name: String,
    /// Page of the atlas.
    pub page: u32,
    /// Texture coordinate set.
    pub set: usize,
    /// Where on the page, as fractions: `[u0, v0, u1, v1]`, v downwards.
    pub rect: [f32; 4],
}

/// A node to be given a lightmap.
struct Wearer<'a> {
    node: usize,
    instance: Option<usize>,
    mesh: usize,
    name: String,
    /// Placement of each primitive.
    fronts: BTreeMap<usize, &'a Placement>,
}

/// Gives every surface that has a place on an exported page its coordinates and its material.
pub(in super::super) fn dress(
    edit: &mut Edit,
    scene: &Scene,
    atlas: &Atlas,
    carrier: &Carrier,
) -> Result<Vec<Worn>> {
    let mut wearers = wearers(edit, scene, atlas)?;
    let instanced = wearers.iter().filter(|w| w.instance.is_some()).map(|w| w.node);
    let children = instances::expand(edit, instanced.collect::<BTreeSet<_>>())?;
    for wearer in &mut wearers {
        let Some(instance) = wearer.instance else { continue };
        let child = children.get(&wearer.node).and_then(|made| made.get(instance));
        wearer.node = *child.ok_or_else(|| foreign(&wearer.name))?;
        wearer.name = format!("{}.{instance:03}", wearer.name);
    }

    let in_place = owned_meshes(edit, &wearers);
    let outside = materials_outside(edit, &wearers, &in_place);
    let mut work = Work {
        wardrobe: Wardrobe::new(carrier, outside, &edit.document.json),
        splitter: Splitter::default(),
        sets: BTreeMap::new(),
        warned: BTreeSet::new(),
        atlas,
    };
    let mut used = BTreeSet::new();
    let mut worn = Vec::with_capacity(wearers.len());
    for wearer in &wearers {
        let (mesh, set) = work.mesh(edit, wearer)?;
        if in_place.contains(&wearer.mesh) && used.insert(wearer.mesh) {
            edit.json["meshes"][wearer.mesh] = mesh;
        } else {
            let own = edit.push("meshes", mesh);
            edit.json["nodes"][wearer.node]["mesh"] = json!(own);
        }
        worn.push(wearer.worn(atlas, set));
    }
    edit.retire_extension(DRACO);
    Ok(worn)
}

/// The nodes of the scene that have a place on an exported page, by node and instance.
fn wearers<'a>(edit: &Edit, scene: &Scene, atlas: &'a Atlas) -> Result<Vec<Wearer<'a>>> {
    let mut found: BTreeMap<(usize, Option<usize>), Wearer> = BTreeMap::new();
    for (surface, front) in scene.surfaces.iter().zip(&atlas.fronts) {
        let Some(front) = front else { continue };
        let page = atlas.pages.get(front.page as usize);
        if !page.is_some_and(|page| page.exported) || front.unwrap.triangles.is_empty() {
            continue;
        }
        let origin = &surface.origin;
        let json = &edit.document.json;
        let node = items(json, "nodes").get(origin.node).filter(|node| node.is_object());
        let mesh = items(json, "meshes").get(origin.mesh);
        let primitive =
            mesh.and_then(|mesh| mesh.get("primitives")?.get(origin.primitive)?.get("attributes"));
        let whole = front.uv_texels.len() == front.unwrap.source_vertex.len();
        if node.is_none() || !primitive.is_some_and(Value::is_object) || !whole {
            return Err(foreign(&origin.name));
        }
        let wearer = found.entry((origin.node, origin.instance)).or_insert_with(|| Wearer {
            node: origin.node,
            instance: origin.instance,
            mesh: origin.mesh,
            name: origin.name.clone(),
            fronts: BTreeMap::new(),
        });
        wearer.fronts.insert(origin.primitive, front);
    }
    Ok(found.into_values().collect())
}

fn foreign(name: &str) -> Error {
    Error::invalid(
        name,
        "this object, or its place on the page, is not the file's; this is a fault of the program",
    )
}

/// Meshes whose users all get lightmaps: the first of them may wear the mesh itself.
fn owned_meshes(edit: &Edit, wearers: &[Wearer]) -> BTreeSet<usize> {
    let mut users: BTreeMap<usize, usize> = BTreeMap::new();
    for node in items(&edit.json, "nodes") {
        if let Some(mesh) = index_at(node, "mesh") {
            *users.entry(mesh).or_default() += 1;
        }
    }
    for wearer in wearers {
        if let Some(left) = users.get_mut(&wearer.mesh) {
            *left = left.saturating_sub(1);
        }
    }
    users.into_iter().filter(|&(_, left)| left == 0).map(|(mesh, _)| mesh).collect()
}

/// Materials that some primitive wears which gets no lightmap, or which stays in the file for others.
fn materials_outside(edit: &Edit, wearers: &[Wearer], in_place: &BTreeSet<usize>) -> BTreeSet<usize> {
    let mut outside = BTreeSet::new();
    let meshes = items(&edit.document.json, "meshes");
    let mut add = |mesh: usize, lit: &dyn Fn(usize) -> bool| {
        let primitives = meshes[mesh].get("primitives").and_then(Value::as_array);
        for (index, primitive) in primitives.into_iter().flatten().enumerate() {
            if !lit(index) {
                outside.extend(texcoord::materials_of(primitive).into_iter().flatten());
            }
        }
    };
    for mesh in (0..meshes.len()).filter(|mesh| !in_place.contains(mesh)) {
        add(mesh, &|_| false);
    }
    for wearer in wearers {
        add(wearer.mesh, &|primitive| wearer.fronts.contains_key(&primitive));
    }
    outside
}

/// What is shared while the meshes are made.
struct Work<'c> {
    wardrobe: Wardrobe<'c>,
    splitter: Splitter,
    /// Texture coordinate set by mesh and lightmapped primitives.
    sets: BTreeMap<(usize, Vec<usize>), usize>,
    warned: BTreeSet<(usize, usize)>,
    atlas: &'c Atlas,
}

impl Work<'_> {
    /// The mesh object for one node, and the set its lightmap uses.
    fn mesh(&mut self, edit: &mut Edit, wearer: &Wearer) -> Result<(Value, usize)> {
        let mut mesh = edit.document.json["meshes"][wearer.mesh].clone();
        let set = self.set(edit, wearer);
        for (&index, placement) in &wearer.fronts {
            let primitive = &mut mesh["primitives"][index];
            let wiring = self.splitter.wiring(edit, wearer.mesh, index, &placement.unwrap, &wearer.name)?;
            let page_size = self.atlas.pages[placement.page as usize].size_texels;
            let uv = wiring.texcoords(placement, page_size);
            let read = texcoord::sets_read(&edit.document.json, primitive);
            if let Wiring::Split { attributes, targets, indices } = &*wiring {
                if self.warned.insert((wearer.mesh, index)) {
                    warn_of_order(edit, primitive, &wearer.name);
                }
                rewire(primitive, attributes, targets, *indices);
            }
            let lightmap = edit.texcoords(&uv);
            for lower in 0..set {
                let name = format!("TEXCOORD_{lower}");
                if primitive["attributes"].get(&name).is_none() {
                    // Numbers must not leave gaps. A texture that reads the missing set was shown at (0, 0) so far.
                    let filler = if read.contains(&lower) {
                        edit.texcoords(&vec![[0.0; 2]; uv.len()])
                    } else {
                        lightmap
                    };
                    primitive["attributes"][name] = json!(filler);
                }
            }
            primitive["attributes"][format!("TEXCOORD_{set}")] = json!(lightmap);
            let page = placement.page;
            let mut new = BTreeMap::new();
            for material in texcoord::materials_of(primitive) {
                if let Some(lit) = self.wardrobe.lit(edit, material, page, set) {
                    new.insert(material, lit);
                }
            }
            texcoord::replace_materials(primitive, &new);
        }
        Ok((mesh, set))
    }

    fn set(&mut self, edit: &mut Edit, wearer: &Wearer) -> usize {
        let lit: Vec<usize> = wearer.fronts.keys().copied().collect();
        if let Some(&known) = self.sets.get(&(wearer.mesh, lit.clone())) {
            return known;
        }
        let json = &edit.document.json;
        let primitives: Vec<&Value> =
            lit.iter().map(|&index| &json["meshes"][wearer.mesh]["primitives"][index]).collect();
        let (set, warning) = texcoord::choose(json, &primitives);
        if warning.is_none()
            && primitives.iter().any(|primitive| {
                primitive["attributes"].get(format!("TEXCOORD_{set}")).is_some()
                    && texcoord::was_lightmap(json, primitive, set)
            })
        {
            edit.warn(&wearer.name, "it had a lightmap already, which the new one replaces");
        }
        if let Some(what) = warning {
            edit.warn(&wearer.name, what);
        }
        self.sets.insert((wearer.mesh, lit), set);
        set
    }
}

/// Points a primitive at its split vertices, as a list of triangles.
fn rewire(
    primitive: &mut Value,
    attributes: &[(String, usize)],
    targets: &[Vec<(String, usize)>],
    indices: usize,
) {
    for (name, accessor) in attributes {
        primitive["attributes"][name] = json!(accessor);
    }
    for (number, target) in targets.iter().enumerate() {
        for (name, accessor) in target {
            primitive["targets"][number][name] = json!(accessor);
        }
    }
    primitive["indices"] = json!(indices);
    // Strips and fans were expanded; 4 is the default.
    if index_at(primitive, "mode").is_some_and(|mode| mode != 4) {
        primitive["mode"] = json!(4);
    }
    remove_extension(primitive, DRACO);
}

fn warn_of_order(edit: &mut Edit, primitive: &Value, name: &str) {
    let extensions = primitive.get("extensions").and_then(Value::as_object);
    let others: Vec<&str> = extensions
        .into_iter()
        .flat_map(|all| all.keys().map(String::as_str))
        .filter(|name| *name != DRACO && !INDIFFERENT_TO_ORDER.contains(name))
        .collect();
    if !others.is_empty() {
        let what = format!(
            "chart seams split its vertices, so vertex numbers changed: check what {} says about them",
            others.join(", ")
        );
        edit.warn(name, what);
    }
}

impl Wearer<'_> {
    fn worn(&self, atlas: &Atlas, set: usize) -> Worn {
        let page = self.fronts.values().next().map_or(0, |front| front.page);
        let size = atlas.pages.get(page as usize).map_or(1, |page| page.size_texels.max(1)) as f32;
        let same = self.fronts.values().filter(|front| front.page == page);
        let [min, max] = same
            .map(|front| front.rect_texels)
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
            .map_or([glam::Vec2::ZERO; 2], |rect| rect.map(|corner| corner / size));
        Worn { node: self.node, name: self.name.clone(), page, set, rect: [min.x, min.y, max.x, max.y] }
    }
}
