//! Places geometries in the world: one surface per node, primitive and instance.

use super::claims;
use super::document::Document;
use super::geometry::{self, Built};
use super::json::{ACCESSORS, MATERIALS, MESHES, NODES, Part, items};
use super::nodes::{Hierarchy, normal_matrix};
use super::pose::{self, Posed};
use super::primitive::{Topology, too_many};
use super::{extras, instances};
use crate::error::{Error, Result, Warning};
use crate::scene::{Geometry, GeometryId, MaterialId, Origin, Role, Surface};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Coordinates beyond this are refused: their fourth powers, which areas and distances multiply to, would overflow.
const FARTHEST_M: f64 = 1e9;
/// The most bytes of attributes and morph targets that all primitives may have together.
const MAX_CLAIMED_BYTES: u64 = 8 << 30;
/// Bytes that a node is worth in what it may claim: a node with a mesh and a place is at least as long in JSON.
const NODE_BYTES: usize = 48;
/// The scene gets an origin of its own when it stands further from the file's than this many times its size.
const FAR_IN_SIZES: f64 = 64.0;

/// The surfaces and what they share.
pub(super) struct Placed {
    pub geometries: Vec<Geometry>,
    pub surfaces: Vec<Surface>,
    pub origin_world: DVec3,
}

/// A surface before its vertices are computed.
struct Plan {
    origin: Origin,
    geometry: usize,
    material: MaterialId,
    world_from_local: DAffine3,
    role: Role,
    density_factor: f32,
    posed: Option<Posed>,
}

/// A primitive as a node uses it.
struct Use {
    node: usize,
    mesh: usize,
    primitive: usize,
    geometry: usize,
}

/// Builds every surface of the scene.
pub(super) fn place(
    document: &Document,
    hierarchy: &Hierarchy,
    warnings: &mut Vec<Warning>,
) -> Result<Placed> {
    let uses = collect(document, hierarchy, warnings)?;
    // The first use of each geometry stands for it.
    let mut shapes: Vec<&Use> = Vec::new();
    for used in &uses {
        if used.geometry == shapes.len() {
            shapes.push(used);
        }
    }
    let built: Vec<Result<Built>> = shapes
        .par_iter()
        .map(|shape| {
            let node = Part::item(&document.json, NODES, shape.node)?.label();
            geometry::build(document, shape.mesh, shape.primitive, &node)
        })
        .collect();
    let mut built: Vec<Built> = built.into_iter().collect::<Result<_>>()?;
    for built in &mut built {
        warnings.append(&mut built.warnings);
    }
    let plans = plan(document, hierarchy, &uses, &built, warnings)?;

    let bounds = bounds_world(&plans, &built)?;
    let origin_world = choose_origin(bounds);
    let surfaces: Vec<Surface> = plans
        .into_par_iter()
        .map(|plan| surface(&built[plan.geometry].geometry, plan, origin_world))
        .collect();
    let geometries = built.into_iter().map(|built| built.geometry).collect();
    let mut placed = Placed { geometries, surfaces, origin_world };
    mark_collapsed(&mut placed, warnings);
    Ok(placed)
}

/// Finds the primitives that the scene uses, and numbers them: equal ones share a geometry.
fn collect(document: &Document, hierarchy: &Hierarchy, warnings: &mut Vec<Warning>) -> Result<Vec<Use>> {
    let json = &document.json;
    // Only looked up, never walked: its order does not matter.
    let mut known: HashMap<(usize, usize), Option<usize>> = HashMap::new();
    let (mut uses, mut geometries) = (Vec::new(), 0);
    let (mut vertices, mut bytes) = (0_usize, 0_usize);
    let most_bytes = claims::ATTRIBUTE_BYTES.most(document.total_bytes()).min(MAX_CLAIMED_BYTES);
    for node in (0..hierarchy.world_from_node.len()).filter(|&n| hierarchy.world_from_node[n].is_some()) {
        let part = Part::item(json, NODES, node)?;
        let Some(mesh_part) = part.follow(json, "mesh", MESHES)? else { continue };
        let mesh = mesh_part.position();
        let count =
            mesh_part.array("primitives")?.ok_or_else(|| mesh_part.wrong("primitives", "is missing"))?.len();
        for primitive in 0..count {
            let geometry = match known.get(&(mesh, primitive)) {
                Some(known) => *known,
                None => {
                    let geometry = drawable(document, &mesh_part, primitive, warnings)?.map(|claim| {
                        vertices = vertices.saturating_add(claim.vertices);
                        bytes = bytes.saturating_add(claim.bytes);
                        geometries += 1;
                        geometries - 1
                    });
                    if vertices > super::MAX_VERTICES {
                        return Err(too_many(&mesh_part, vertices));
                    }
                    if bytes as u64 > most_bytes {
                        let what = format!(
                            "the meshes up to this one claim {} MiB, more than the {} MiB that this file may: split \
                             the scene",
                            bytes >> 20,
                            most_bytes >> 20
                        );
                        return Err(Error::TooLarge { what, at: mesh_part.at() });
                    }
                    known.insert((mesh, primitive), geometry);
                    geometry
                }
            };
            uses.extend(geometry.map(|geometry| Use { node, mesh, primitive, geometry }));
        }
    }
    Ok(uses)
}

/// What reading a primitive takes.
struct Claim {
    vertices: usize,
    bytes: usize,
}

/// What a primitive claims; `None` when it has no surface.
fn drawable(
    document: &Document,
    mesh: &Part,
    primitive: usize,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Claim>> {
    let part = mesh.nth("primitives", "primitive", primitive)?;
    let skipped = if Topology::of(&part)? == Topology::Thin {
        Some("it holds points or lines, which take no light; it stays in the file as it is")
    } else {
        None
    };
    let attributes = part.object("attributes")?.ok_or_else(|| part.wrong("attributes", "is missing"))?;
    let position = attributes.index("POSITION")?;
    let skipped =
        skipped.or(position.is_none().then_some("it has no POSITION; it stays in the file as it is"));
    if let Some(what) = skipped {
        warnings.push(Warning::new(part.at(), what));
        return Ok(None);
    }
    let Some(accessor) = attributes.follow(&document.json, "POSITION", ACCESSORS)? else { return Ok(None) };
    Ok(Some(Claim { vertices: accessor.required_index("count")?, bytes: document.claimed_bytes(&part)? }))
}

fn plan(
    document: &Document,
    hierarchy: &Hierarchy,
    uses: &[Use],
    built: &[Built],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Plan>> {
    let json = &document.json;
    let material_count = items(json, MATERIALS)?.len();
    let mut plans: Vec<Plan> = Vec::new();
    let mut vertices = 0_usize;
    let held = document.total_bytes() + NODE_BYTES * items(json, NODES)?.len();
    for used in uses {
        let node = Part::item(json, NODES, used.node)?;
        let mesh = Part::item(json, MESHES, used.mesh)?;
        let primitive = mesh.nth("primitives", "primitive", used.primitive)?;
        let Some(Some(world)) = hierarchy.world_from_node.get(used.node) else { continue };
        let shape = &built[used.geometry];

        let material = match primitive.index("material")? {
            None => MaterialId(0),
            Some(index) if index < material_count => MaterialId(index as u32 + 1),
            Some(index) => return Err(primitive.dangling("material", MATERIALS, index)),
        };
        let wanted = extras::flag(&[&node, &mesh], "bake")?.unwrap_or(true);
        let density_factor = extras::positive(&[&node, &mesh], "density")?.unwrap_or(1.0);
        let (posed, moves) = pose::at_rest(document, hierarchy, &node, &mesh, shape, *world, warnings)?;
        let role = if moves || !wanted { Role::Reflects } else { Role::Lightmapped };

        let transforms = instances::expand(document, &node)?;
        let copies = transforms.as_ref().map_or(1, Vec::len);
        let placed = shape.geometry.position_local.len().max(shape.geometry.triangles.len());
        vertices = vertices.saturating_add(placed.max(1).saturating_mul(copies));
        if vertices > super::MAX_VERTICES {
            return Err(too_many(&node, vertices));
        }
        if !claims::VERTICES.holds(vertices as u64, held) {
            let what = format!(
                "{vertices} vertices are placed up to here, far more than this file holds: it has too many instances"
            );
            return Err(Error::TooLarge { what, at: node.at() });
        }
        let origin = |instance| Origin {
            name: node.label(),
            node: used.node,
            mesh: used.mesh,
            primitive: used.primitive,
            instance,
        };
        let plan = |instance, world_from_local, posed| Plan {
            origin: origin(instance),
            geometry: used.geometry,
            material,
            world_from_local,
            role,
            density_factor,
            posed,
        };
        match transforms {
            None => plans.push(plan(None, if posed.is_some() { DAffine3::IDENTITY } else { *world }, posed)),
            Some(transforms) => plans
                .extend(transforms.iter().enumerate().map(|(i, local)| plan(Some(i), *world * *local, None))),
        }
    }
    Ok(plans)
}

/// Smallest and largest world coordinates; `None` without vertices.
fn bounds_world(plans: &[Plan], built: &[Built]) -> Result<Option<(DVec3, DVec3)>> {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let join = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
    // Minima pass over what is not a number; infinity they keep.
    let grow = |bounds, p: DVec3| {
        let p = if p.is_finite() { p } else { DVec3::INFINITY };
        join(bounds, (p, p))
    };
    let bounds: Vec<(DVec3, DVec3)> =
        plans
            .par_iter()
            .map(|plan| match &plan.posed {
                Some(posed) => posed.position_world.iter().fold(empty, |b, &p| grow(b, p)),
                None => built[plan.geometry].geometry.position_local.iter().fold(empty, |bounds, p| {
                    grow(bounds, plan.world_from_local.transform_point3(p.as_dvec3()))
                }),
            })
            .collect();
    for (plan, bounds) in plans.iter().zip(&bounds) {
        let farthest = bounds.0.abs().max(bounds.1.abs()).max_element();
        if *bounds != empty && farthest > FARTHEST_M {
            let what = format!(
                "it reaches {farthest:.1e} m from the origin, further than {FARTHEST_M:.0e}: scale it down"
            );
            return Err(Error::invalid(format!("node '{}'", plan.origin.name), what));
        }
    }
    let all = bounds.into_iter().fold(empty, join);
    Ok((all != empty).then_some(all))
}

/// A float keeps 7 digits: an object of 10 m that stands 1000 km away has steps of 6 cm. Such scenes get an origin in
/// their middle, rounded to a power of two near their size so that subtracting it loses nothing. Near scenes keep the
/// file's origin, and with it the file's own numbers.
fn choose_origin(bounds: Option<(DVec3, DVec3)>) -> DVec3 {
    let Some((low, high)) = bounds else { return DVec3::ZERO };
    let size = (high - low).max_element();
    let farthest = low.abs().max(high.abs()).max_element();
    if size <= 0.0 || farthest <= FAR_IN_SIZES * size {
        return DVec3::ZERO;
    }
    let step = size.log2().floor().exp2();
    ((low + high) / 2.0 / step).round() * step
}

/// Computes the vertices of a surface.
fn surface(geometry: &Geometry, plan: Plan, origin_world: DVec3) -> Surface {
    let (position_world, normal_world, mirrored) = match plan.posed {
        Some(posed) => {
            let positions = posed.position_world.iter().map(|&p| (p - origin_world).as_vec3()).collect();
            (positions, posed.normal_world, posed.mirrored)
        }
        None => {
            let world = plan.world_from_local;
            let place = |p: &Vec3| (world.transform_point3(p.as_dvec3()) - origin_world).as_vec3();
            // Scaled to about 1, so that the products in the cofactors neither overflow nor vanish.
            let matrix = world.matrix3;
            let largest = matrix.x_axis.abs().max(matrix.y_axis.abs()).max(matrix.z_axis.abs()).max_element();
            let matrix = matrix * (1.0 / largest.max(f64::MIN_POSITIVE));
            let normals = normal_matrix(matrix);
            // Where an object is flattened, the sides have no direction left but that of the whole.
            let flat = [normals.x_axis, normals.y_axis, normals.z_axis]
                .into_iter()
                .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
                .and_then(DVec3::try_normalize)
                .unwrap_or(DVec3::Y);
            let turn = |n: &Vec3| (normals * n.as_dvec3()).try_normalize().unwrap_or(flat).as_vec3();
            (
                geometry.position_local.iter().map(place).collect(),
                geometry.normal_local.iter().map(turn).collect(),
                matrix.determinant() < 0.0,
            )
        }
    };
    Surface {
        origin: plan.origin,
        geometry: GeometryId(plan.geometry as u32),
        material: plan.material,
        world_from_local: plan.world_from_local,
        position_world,
        normal_world,
        mirrored,
        role: plan.role,
        density_factor: plan.density_factor,
    }
}

/// Surfaces without area stay, so that the numbering does, but get no texels; flattened ones are only named.
fn mark_collapsed(placed: &mut Placed, warnings: &mut Vec<Warning>) {
    let geometries = &placed.geometries;
    for surface in &mut placed.surfaces {
        let matrix = surface.world_from_local.matrix3;
        let lengths = matrix.x_axis.length() * matrix.y_axis.length() * matrix.z_axis.length();
        let flattened = matrix.determinant().abs() <= 1e-12 * lengths;
        let triangles = &geometries[surface.geometry.0 as usize].triangles;
        let has_area = triangles.iter().any(|triangle| {
            let [a, b, c] = triangle.map(|i| surface.position_world[i as usize].as_dvec3());
            (b - a).cross(c - a) != DVec3::ZERO
        });
        let what = match (has_area, flattened) {
            (true, false) => continue,
            (true, true) => "its scale is zero along an axis: it is baked as the flat shape that is left",
            (false, true) => "its scale is zero: nothing of it is left to bake",
            (false, false) => "none of its triangles has an area: there is nothing to bake",
        };
        if !has_area {
            surface.role = Role::Blocks;
        }
        let warning = Warning::new(surface.origin.name.clone(), what);
        if warnings.last() != Some(&warning) {
            warnings.push(warning);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_scenes_get_an_origin_and_near_ones_keep_theirs() {
        let at = |low: f64, size: f64| choose_origin(Some((DVec3::splat(low), DVec3::splat(low + size))));
        assert_eq!(at(-5.0, 10.0), DVec3::ZERO);
        assert_eq!(at(600.0, 10.0), DVec3::ZERO);
        assert_eq!(at(1e6, 10.0), DVec3::splat(1_000_008.0));
        let small = at(1.0, 1e-3);
        assert!((small - DVec3::splat(1.0005)).abs().max_element() < 1e-3, "{small}");
        assert_eq!(choose_origin(None), DVec3::ZERO);
        assert_eq!(at(7.0, 0.0), DVec3::ZERO);
    }
}
