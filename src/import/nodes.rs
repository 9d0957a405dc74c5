//! The node hierarchy of one scene: who stands where, in f64.

use super::json::{NODES, Part, SCENES, items};
use crate::error::{Error, Result, Warning};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde_json::Value;

/// Where the nodes of the chosen scene stand.
#[derive(Debug)]
pub(super) struct Hierarchy {
    /// World from local, by node; `None` for nodes that are hidden or not part of the scene.
    pub world_from_node: Vec<Option<DAffine3>>,
    /// The chosen scene; `None` in a file without scenes.
    pub scene: Option<usize>,
}

/// Chooses the scene and places its nodes. `wanted` is a name or an index.
pub(super) fn place(json: &Value, wanted: Option<&str>, warnings: &mut Vec<Warning>) -> Result<Hierarchy> {
    let nodes: Vec<Part> =
        (0..items(json, NODES)?.len()).map(|i| Part::item(json, NODES, i)).collect::<Result<_>>()?;
    let children: Vec<Vec<usize>> =
        nodes.iter().map(|node| node.indices("children")).collect::<Result<_>>()?;
    let parents = find_parents(&nodes, &children)?;
    refuse_cycles(&nodes, &parents)?;

    let scene = choose(json, wanted)?;
    let roots = match scene {
        Some(index) => scene_roots(&Part::item(json, SCENES, index)?, &nodes, &parents, warnings)?,
        None => {
            warnings.push(Warning::new("the file", "it has no scenes; every node of it is baked"));
            (0..nodes.len()).filter(|&i| parents[i].is_none()).collect()
        }
    };

    let mut world_from_node = vec![None; nodes.len()];
    // A stack of our own: files may be nested deeper than the thread's stack is.
    let mut waiting: Vec<(usize, DAffine3)> =
        roots.into_iter().map(|root| (root, DAffine3::IDENTITY)).collect();
    while let Some((index, world_from_parent)) = waiting.pop() {
        let node = &nodes[index];
        if is_hidden(node)? {
            warnings
                .push(Warning::new(node.label(), "it is hidden (KHR_node_visibility): left out of the bake"));
            continue;
        }
        let world = world_from_parent * parent_from_node(node, warnings)?;
        if !world.is_finite() {
            return Err(Error::invalid(
                node.at(),
                "its place in the world is too far or too large to compute",
            ));
        }
        world_from_node[index] = Some(world);
        waiting.extend(children[index].iter().map(|&child| (child, world)));
    }
    Ok(Hierarchy { world_from_node, scene })
}

fn find_parents(nodes: &[Part], children: &[Vec<usize>]) -> Result<Vec<Option<usize>>> {
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (parent, children) in children.iter().enumerate() {
        for &child in children {
            let Some(slot) = parents.get_mut(child) else {
                return Err(nodes[parent].dangling("children", NODES, child));
            };
            if let Some(other) = slot.replace(parent) {
                let what = format!(
                    "it is a child of both {} and {}: a node may have one parent, export the scene again",
                    nodes[other].at(),
                    nodes[parent].at()
                );
                return Err(Error::invalid(nodes[child].at(), what));
            }
        }
    }
    Ok(parents)
}

/// With at most one parent each, nodes in a cycle are those from which going up never ends.
fn refuse_cycles(nodes: &[Part], parents: &[Option<usize>]) -> Result<()> {
    // The walk that first reached a node; 0 is none.
    let mut reached_by = vec![0_usize; nodes.len()];
    for start in 0..nodes.len() {
        let walk = start + 1;
        let mut at = Some(start);
        while let Some(index) = at {
            if reached_by[index] == walk {
                return Err(Error::invalid(
                    nodes[index].at(),
                    "it is its own ancestor: export the scene again",
                ));
            }
            if reached_by[index] != 0 {
                break;
            }
            reached_by[index] = walk;
            at = parents[index];
        }
    }
    Ok(())
}

fn choose(json: &Value, wanted: Option<&str>) -> Result<Option<usize>> {
    let count = items(json, SCENES)?.len();
    let default = Part::root(json)?.index("scene")?;
    let Some(wanted) = wanted else {
        return match (default, count) {
            (None, 0) => Ok(None),
            (None, _) => Ok(Some(0)),
            (Some(index), _) if index < count => Ok(Some(index)),
            (Some(index), _) => Err(Part::root(json)?.dangling("scene", SCENES, index)),
        };
    };
    let names: Vec<String> =
        (0..count).map(|i| Ok(Part::item(json, SCENES, i)?.label())).collect::<Result<_>>()?;
    let by_name = names.iter().position(|name| name == wanted);
    match by_name.or_else(|| wanted.parse().ok().filter(|&index: &usize| index < count)) {
        Some(index) => Ok(Some(index)),
        None => {
            let what = match names.len() {
                0 => "the file has no scenes".to_owned(),
                _ => format!("there is no such scene; the file has: {}", names.join(", ")),
            };
            Err(Error::invalid(format!("--scene {wanted}"), what))
        }
    }
}

fn scene_roots(
    scene: &Part,
    nodes: &[Part],
    parents: &[Option<usize>],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<usize>> {
    let mut roots = scene.indices("nodes")?;
    for &root in &roots {
        match parents.get(root) {
            None => return Err(scene.dangling("nodes", NODES, root)),
            Some(None) => {}
            Some(&Some(parent)) => {
                let what = format!(
                    "{} lists it as a root, but it is a child of {}: export the scene again",
                    scene.at(),
                    nodes[parent].at()
                );
                return Err(Error::invalid(nodes[root].at(), what));
            }
        }
    }
    let listed = roots.len();
    roots.sort_unstable();
    roots.dedup();
    if roots.len() < listed {
        warnings.push(Warning::new(scene.label(), "it lists a node twice; the node is baked once"));
    }
    Ok(roots)
}

fn is_hidden(node: &Part) -> Result<bool> {
    let Some(visibility) = node.extension("KHR_node_visibility")? else { return Ok(false) };
    Ok(visibility.flag("visible")? == Some(false))
}

fn parent_from_node(node: &Part, warnings: &mut Vec<Warning>) -> Result<DAffine3> {
    let translation = node.numbers::<3>("translation")?;
    let rotation = node.numbers::<4>("rotation")?;
    let scale = node.numbers::<3>("scale")?;
    if let Some(matrix) = node.numbers::<16>("matrix")? {
        if translation.is_some() || rotation.is_some() || scale.is_some() {
            return Err(node.wrong("matrix", "must not stand beside translation, rotation or scale"));
        }
        let matrix = DMat4::from_cols_array(&matrix);
        let last = matrix.transpose().w_axis;
        // Exporters that multiply matrices in floats leave rounding in the last row.
        if last.truncate().abs().max_element() > 1e-4 || (last.w - 1.0).abs() > 1e-4 {
            return Err(
                node.wrong("matrix", "must have 0, 0, 0, 1 as its last row: perspective is not a place")
            );
        }
        return Ok(DAffine3::from_mat4(matrix));
    }
    let rotation = match rotation.map(DQuat::from_array) {
        None => DQuat::IDENTITY,
        Some(q) => {
            let length = q.length();
            if !(1e-6..1e6).contains(&length) {
                return Err(node.wrong("rotation", "must be a quaternion of length 1"));
            }
            if (length - 1.0).abs() > 0.01 {
                let what = format!(
                    "its rotation is a quaternion of length {length:.3}, not 1; its direction is used"
                );
                warnings.push(Warning::new(node.label(), what));
            }
            q / length
        }
    };
    let vector = |values: Option<[f64; 3]>, default| values.map_or(default, DVec3::from_array);
    Ok(DAffine3::from_scale_rotation_translation(
        vector(scale, DVec3::ONE),
        rotation,
        vector(translation, DVec3::ZERO),
    ))
}

/// What turns local normals into world normals, up to length: the inverse transpose times the determinant, which
/// exists for flattened objects too. Its sign is turned for mirrored ones, so that normals keep to their side.
pub(super) fn normal_matrix(m: DMat3) -> DMat3 {
    let cofactors =
        DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -cofactors } else { cofactors }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn placed(json: &Value, wanted: Option<&str>) -> Result<Hierarchy> {
        place(json, wanted, &mut Vec::new())
    }

    #[test]
    fn composes_in_double_precision() {
        let json = json!({
            "nodes": [
                {"translation": [1e6, 0, 0], "scale": [2, 2, 2], "children": [1]},
                {"rotation": [0, std::f64::consts::FRAC_1_SQRT_2, 0, std::f64::consts::FRAC_1_SQRT_2],
                 "translation": [0.000_1, 0, 0]},
                {"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]}
            ],
            "scenes": [{"nodes": [0, 2]}]
        });
        let hierarchy = placed(&json, None).unwrap();
        let world = hierarchy.world_from_node[1].unwrap();
        // A quarter turn about y takes x to −z; the scale of the parent doubles it.
        let x = world.transform_point3(DVec3::X);
        assert!((x - DVec3::new(1_000_000.000_2, 0.0, -2.0)).length() < 1e-9, "{x}");
        assert_eq!(hierarchy.world_from_node[2].unwrap().translation, DVec3::new(5.0, 6.0, 7.0));
    }

    #[test]
    fn refuses_broken_hierarchies_by_name() {
        let nodes = |nodes: Value| {
            placed(&json!({"nodes": nodes, "scenes": [{"nodes": [0]}]}), None).unwrap_err().to_string()
        };
        let said =
            nodes(json!([{"name": "A", "children": [1]}, {"name": "B", "children": [2]}, {"children": [1]}]));
        assert!(said.contains("'B'") && said.contains("'A'"), "{said}");
        let said = nodes(json!([{}, {"name": "B", "children": [2]}, {"children": [1]}]));
        assert!(said.contains("ancestor"), "{said}");
        assert!(nodes(json!([{"name": "A", "children": [9]}])).contains("node 'A'"));
        assert!(nodes(json!([{"name": "A", "children": [0]}])).contains("ancestor"));
        assert!(nodes(json!([{"matrix": [1, 2]}])).contains("16"));
        assert!(nodes(json!([{"rotation": [0, 0, 0, 0]}])).contains("quaternion"));
        assert!(
            nodes(json!([{"scale": [1e308, 1, 1], "children": [1]}, {"scale": [1e308, 1, 1]}]))
                .contains("too")
        );
        assert!(
            nodes(json!([{"scale": [1, 1, 1], "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}]))
                .contains("beside")
        );
        let not_root = json!({"nodes": [{"children": [1]}, {"name": "B"}], "scenes": [{"nodes": [1]}]});
        assert!(placed(&not_root, None).unwrap_err().to_string().contains("'B'"));
    }

    #[test]
    fn does_not_overflow_the_stack() {
        let count = 200_000;
        let nodes: Vec<Value> = (0..count)
            .map(|i| if i + 1 < count { json!({"children": [i + 1]}) } else { json!({}) })
            .collect();
        let hierarchy = placed(&json!({"nodes": nodes, "scenes": [{"nodes": [0]}]}), None).unwrap();
        assert!(hierarchy.world_from_node[count - 1].is_some());
    }

    #[test]
    fn chooses_scenes_by_name_and_index() {
        let json = json!({
            "nodes": [{}, {}, {}],
            "scene": 1,
            "scenes": [{"name": "Day", "nodes": [0]}, {"name": "Night", "nodes": [1]}, {"name": "0", "nodes": [2]}]
        });
        let node = |wanted| placed(&json, wanted).unwrap().world_from_node.iter().position(Option::is_some);
        assert_eq!(node(None), Some(1));
        assert_eq!(node(Some("Day")), Some(0));
        assert_eq!(node(Some("1")), Some(1));
        assert_eq!(node(Some("0")), Some(2));
        let said = placed(&json, Some("Dusk")).unwrap_err().to_string();
        assert!(said.contains("Day, Night, 0"), "{said}");
        let mut warnings = Vec::new();
        let all = place(&json!({"nodes": [{"children": [1]}, {}]}), None, &mut warnings).unwrap();
        assert!(all.world_from_node.iter().all(Option::is_some) && warnings.len() == 1);
        assert!(placed(&json!({"scene": 3, "scenes": [{}]}), None).is_err());
    }

    #[test]
    fn hidden_nodes_take_their_children_along() {
        let json = json!({
            "nodes": [{"children": [1], "extensions": {"KHR_node_visibility": {"visible": false}}}, {}],
            "scenes": [{"nodes": [0]}]
        });
        assert!(placed(&json, None).unwrap().world_from_node.iter().all(Option::is_none));
    }

    #[test]
    fn normals_keep_their_side() {
        let mirror = DMat3::from_diagonal(DVec3::new(-2.0, 1.0, 1.0));
        assert_eq!((normal_matrix(mirror) * DVec3::X).normalize(), DVec3::NEG_X);
        assert_eq!((normal_matrix(mirror) * DVec3::Y).normalize(), DVec3::Y);
        let squashed = DMat3::from_diagonal(DVec3::new(3.0, 2.0, 0.0));
        assert_eq!((normal_matrix(squashed) * DVec3::Z).normalize(), DVec3::Z);
    }
}
