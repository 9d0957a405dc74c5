//! The rest pose of skinned and morphed meshes: they take no lightmap, but they stand in the light.

use super::document::{Document, RawAccessor, RawPrimitive};
use super::geometry::{Built, vectors3};
use super::json::{Part, SKINS};
use super::nodes::{Hierarchy, normal_matrix};
use crate::error::{Error, Result, Warning};
use crate::scene::Geometry;
use glam::{DAffine3, DMat4, DVec3, Vec3};

/// What moves the vertices of a primitive.
pub(super) struct Rig {
    /// Position and normal deltas of each morph target; empty where the target does not touch them.
    targets: Vec<(Vec<Vec3>, Vec<Vec3>)>,
    influences: Vec<Influences>,
}

/// One set of joint numbers and their weights, four to a vertex.
struct Influences {
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
}

/// Vertices in the world.
pub(super) struct Posed {
    pub position_world: Vec<DVec3>,
    pub normal_world: Vec<Vec3>,
    /// Whether the first vertex's transform mirrors.
    pub mirrored: bool,
}

/// The vertices of a skinned or morphed primitive, and whether it is one.
pub(super) fn at_rest(
    document: &Document,
    hierarchy: &Hierarchy,
    node: &Part,
    mesh: &Part,
    shape: &Built,
    world: DAffine3,
    warnings: &mut Vec<Warning>,
) -> Result<(Option<Posed>, bool)> {
    let has_skin = node.object.contains_key("skin");
    let Some(rig) = shape.rig.as_ref().filter(|rig| rig.morphs() || (rig.bends() && has_skin)) else {
        return Ok((None, false));
    };
    let weights = match node.array("weights")? {
        Some(weights) => Some(weights),
        None => mesh.array("weights")?,
    };
    let weights: Vec<f64> = weights.unwrap_or(&[]).iter().map(|w| w.as_f64().unwrap_or(0.0)).collect();
    let mut what =
        "it is skinned or morphed: it blocks and reflects light in its rest pose and gets no lightmap"
            .to_owned();
    let mut posed = None;
    if rig.bends() && has_skin {
        let bones = joints(document, node, hierarchy)?;
        posed = bones.and_then(|joints| rig.pose(&shape.geometry, &weights, Some(&joints), world));
        if posed.is_none() {
            what.push_str(
                "; its skin cannot be used (joints missing or outside of the scene), so it stands unbent",
            );
        }
    }
    let posed = match posed {
        Some(posed) => Some(posed),
        None => rig.pose(&shape.geometry, &weights, None, world),
    };
    let warning = Warning::new(node.label(), what);
    if warnings.last() != Some(&warning) {
        warnings.push(warning);
    }
    Ok((posed, true))
}

impl Rig {
    /// `None` when nothing moves the vertices.
    pub fn read(raw: &RawPrimitive, part: &Part) -> Result<Option<Self>> {
        let find =
            |name: String| raw.attributes.iter().find(|(semantic, _)| *semantic == name).map(|(_, a)| a);
        let mut influences = Vec::new();
        for set in 0.. {
            let (joints, weights) = (find(format!("JOINTS_{set}")), find(format!("WEIGHTS_{set}")));
            match (joints, weights) {
                (Some(joints), Some(weights)) => influences.push(read_influences(joints, weights, part)?),
                (None, None) => break,
                _ => {
                    return Err(Error::invalid(
                        part.at(),
                        format!("JOINTS_{set} and WEIGHTS_{set} belong together"),
                    ));
                }
            }
        }
        let targets = raw
            .targets
            .iter()
            .map(|target| Ok((deltas(target, "POSITION", part)?, deltas(target, "NORMAL", part)?)))
            .collect::<Result<Vec<_>>>()?;
        let moves = !influences.is_empty() || !targets.is_empty();
        Ok(moves.then_some(Self { targets, influences }))
    }

    /// Whether the primitive has morph targets.
    pub fn morphs(&self) -> bool {
        !self.targets.is_empty()
    }

    /// Whether the primitive has joints.
    pub fn bends(&self) -> bool {
        !self.influences.is_empty()
    }

    /// The rest pose. `weights` are of the morph targets, missing ones are zero; `joints` take bind space to the world,
    /// and without them `world_from_node` does.
    pub fn pose(
        &self,
        geometry: &Geometry,
        weights: &[f64],
        joints: Option<&[DAffine3]>,
        world_from_node: DAffine3,
    ) -> Option<Posed> {
        let mut position_world = Vec::with_capacity(geometry.position_local.len());
        let mut normal_world = Vec::with_capacity(geometry.position_local.len());
        let mut mirrored = false;
        for (vertex, (position, normal)) in
            geometry.position_local.iter().zip(&geometry.normal_local).enumerate()
        {
            let (mut position, mut normal) = (position.as_dvec3(), normal.as_dvec3());
            for ((positions, normals), &weight) in self.targets.iter().zip(weights) {
                position += weight * positions.get(vertex).map_or(DVec3::ZERO, |delta| delta.as_dvec3());
                normal += weight * normals.get(vertex).map_or(DVec3::ZERO, |delta| delta.as_dvec3());
            }
            let world = match joints {
                Some(joints) => self.blend(vertex, joints)?,
                None => world_from_node,
            };
            mirrored |= vertex == 0 && world.matrix3.determinant() < 0.0;
            position_world.push(world.transform_point3(position));
            let turned = normal_matrix(world.matrix3) * normal;
            normal_world.push(turned.try_normalize().unwrap_or(DVec3::Y).as_vec3());
        }
        position_world.iter().all(|p| p.is_finite()).then_some(Posed {
            position_world,
            normal_world,
            mirrored,
        })
    }

    /// Weighted mean of the joints of a vertex; `None` when it names one that does not exist.
    fn blend(&self, vertex: usize, joints: &[DAffine3]) -> Option<DAffine3> {
        let mut sum = DAffine3::ZERO;
        let mut total = 0.0;
        for set in &self.influences {
            for (&joint, &weight) in set.joints[vertex].iter().zip(&set.weights[vertex]) {
                if weight > 0.0 {
                    let (joint, weight) = (joints.get(usize::from(joint))?, f64::from(weight));
                    sum.matrix3 += joint.matrix3 * weight;
                    sum.translation += joint.translation * weight;
                    total += weight;
                }
            }
        }
        if total == 0.0 {
            return joints.first().copied();
        }
        Some(DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total })
    }
}

/// World from bind space for each joint of a skin; `None` when the skin cannot be used: a joint outside of the scene,
/// or matrices that are too few or not finite.
pub(super) fn joints(
    document: &Document,
    node: &Part,
    hierarchy: &Hierarchy,
) -> Result<Option<Vec<DAffine3>>> {
    let Some(skin) = node.follow(&document.json, "skin", SKINS)? else { return Ok(None) };
    let nodes = skin.indices("joints")?;
    let binds: Vec<DAffine3> = match skin.index("inverseBindMatrices")? {
        None => vec![DAffine3::IDENTITY; nodes.len()],
        Some(accessor) => {
            let raw = document.raw_accessor(accessor)?;
            if raw.kind != "MAT4" || raw.component_type != 5126 {
                return Err(skin.wrong("inverseBindMatrices", "must be matrices of floats"));
            }
            let floats = raw.to_floats();
            let matrix = |m: &[f32]| DMat4::from_cols_array(&std::array::from_fn(|i| f64::from(m[i])));
            floats.chunks_exact(16).map(|m| DAffine3::from_mat4(matrix(m))).collect()
        }
    };
    if nodes.is_empty() || binds.len() < nodes.len() {
        return Ok(None);
    }
    let world = |(&node, bind): (&usize, &DAffine3)| {
        let joint = (*hierarchy.world_from_node.get(node)?)? * *bind;
        joint.is_finite().then_some(joint)
    };
    Ok(nodes.iter().zip(&binds).map(world).collect())
}

fn read_influences(joints: &RawAccessor, weights: &RawAccessor, part: &Part) -> Result<Influences> {
    let fours = |accessor: &RawAccessor| accessor.kind == "VEC4";
    if !fours(joints) || !fours(weights) || !matches!(joints.component_type, 5121 | 5123) {
        return Err(Error::invalid(
            part.at(),
            "JOINTS and WEIGHTS must come in fours, joints as unsigned integers",
        ));
    }
    let numbers = joints.to_floats();
    Ok(Influences {
        joints: numbers
            .chunks_exact(4)
            .map(|j| [j[0] as u16, j[1] as u16, j[2] as u16, j[3] as u16])
            .collect(),
        weights: weights.to_floats().chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect(),
    })
}

fn deltas(target: &[(String, RawAccessor)], name: &str, part: &Part) -> Result<Vec<Vec3>> {
    let Some((_, accessor)) = target.iter().find(|(semantic, _)| semantic == name) else {
        return Ok(Vec::new());
    };
    if accessor.kind != "VEC3" {
        return Err(Error::invalid(part.at(), format!("{name} of a morph target must be three numbers")));
    }
    Ok(vectors3(&accessor.to_floats()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Geometry {
        Geometry {
            position_local: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normal_local: vec![Vec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            ..Geometry::default()
        }
    }

    #[test]
    fn joints_move_vertices_and_the_node_does_not() {
        let halves = vec![[0.5, 0.5, 0.0, 0.0]; 3];
        let rig = Rig {
            targets: vec![],
            influences: vec![Influences { joints: vec![[0, 1, 0, 0]; 3], weights: halves }],
        };
        let joints = [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::new(4.0, 0.0, 0.0))];
        let away = DAffine3::from_translation(DVec3::splat(100.0));
        let posed = rig.pose(&triangle(), &[], Some(&joints), away).unwrap();
        assert_eq!(posed.position_world[1], DVec3::new(3.0, 0.0, 0.0));
        assert_eq!(posed.normal_world[0], Vec3::Z);
        assert!(rig.pose(&triangle(), &[], Some(&joints[..1]), away).is_none());
        let posed = rig.pose(&triangle(), &[], None, away).unwrap();
        assert_eq!(posed.position_world[1], DVec3::new(101.0, 100.0, 100.0));
    }

    #[test]
    fn targets_add_their_share() {
        let rig =
            Rig { targets: vec![(vec![Vec3::Z; 3], vec![]), (vec![Vec3::X; 3], vec![])], influences: vec![] };
        let posed = rig.pose(&triangle(), &[0.5], None, DAffine3::IDENTITY).unwrap();
        assert_eq!(posed.position_world[0], DVec3::new(0.0, 0.0, 0.5));
        let nan = rig.pose(&triangle(), &[f64::NAN], None, DAffine3::IDENTITY);
        assert!(nan.is_none());
    }
}
