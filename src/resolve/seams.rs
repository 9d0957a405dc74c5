//! Chart borders that are one edge of the surface: where the unwrap cut it, and between the materials of one object.

use crate::atlas::{Atlas, Placement, Unwrap};
use crate::scene::{GeometryId, Scene};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// One side of a seam on its page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Border {
    /// Page index.
    pub page: u32,
    /// Start and end, texels.
    pub uv_texels: [Vec2; 2],
}

/// An edge of the surface that lies twice in texture space; both sides run the same way.
pub(super) type Seam = [Border; 2];

/// The cosine (8°) that vertex normals on both sides must make for the surface to be smooth across the edge.
const SMOOTH: f32 = 0.99;

/// An edge of one triangle of one of the surfaces that are welded together.
#[derive(Clone, Copy, Debug)]
struct Edge {
    part: u32,
    /// Vertices of the unwrapped mesh, in the order of the welded ids.
    vertices: [u32; 2],
    chart: u32,
    /// Whether the triangle winds from the first to the second.
    forward: bool,
}

/// All seams of exported pages across which the surface is smooth, in surface order.
pub(super) fn seams(scene: &Scene, atlas: &Atlas) -> Vec<Seam> {
    let exported = |i: usize| -> Option<&Placement> {
        let placement = atlas.fronts.get(i)?.as_ref()?;
        atlas.pages.get(placement.page as usize)?.exported.then_some(placement)
    };
    // Surfaces of one object share its space, so their vertices can be compared to the bit.
    let mut index = HashMap::new();
    let mut bodies: Vec<Vec<(usize, &Placement)>> = Vec::new();
    for (i, surface) in scene.surfaces.iter().enumerate() {
        let Some(placement) = exported(i) else { continue };
        let origin = &surface.origin;
        let pose = surface.world_from_local.to_cols_array().map(f64::to_bits);
        let body = *index.entry((origin.node, origin.mesh, origin.instance, pose)).or_insert_with(|| {
            bodies.push(Vec::new());
            bodies.len() - 1
        });
        bodies[body].push((i, placement));
    }
    // Instances share their cuts.
    let mut shape_of = HashMap::new();
    let mut shapes: Vec<usize> = Vec::new();
    let body_shape: Vec<usize> = (0..bodies.len())
        .map(|b| {
            let key: Vec<(GeometryId, *const Unwrap)> = bodies[b]
                .iter()
                .map(|&(i, placement)| {
                    (scene.surfaces[i].geometry, std::sync::Arc::as_ptr(&placement.unwrap))
                })
                .collect();
            *shape_of.entry(key).or_insert_with(|| {
                shapes.push(b);
                shapes.len() - 1
            })
        })
        .collect();
    let cuts: Vec<Vec<[Edge; 2]>> = shapes.par_iter().map(|&b| cuts(scene, &bodies[b])).collect();
    let of_body = |(body, &shape): (&Vec<(usize, &Placement)>, &usize)| {
        let border = |edge: &Edge| {
            let placement = body[edge.part as usize].1;
            Border { page: placement.page, uv_texels: edge.vertices.map(|v| placement.uv_texels[v as usize]) }
        };
        cuts[shape].iter().map(|[a, b]| [border(a), border(b)]).collect::<Vec<_>>()
    };
    bodies.iter().zip(&body_shape).flat_map(of_body).collect()
}

/// Pairs of triangle edges that are the same edge of the surface but not of texture space.
fn cuts(scene: &Scene, body: &[(usize, &Placement)]) -> Vec<[Edge; 2]> {
    let ids = weld(scene, body);
    let mut edges: Vec<([u32; 2], Edge)> = Vec::new();
    for (part, (&(_, placement), ids)) in (0..).zip(body.iter().zip(&ids)) {
        let unwrap = &*placement.unwrap;
        let id = |v: u32| ids[unwrap.source_vertex[v as usize] as usize];
        for (&[a, b, c], &chart) in unwrap.triangles.iter().zip(&unwrap.chart_of_triangle) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let forward = id(from) < id(to);
                if id(from) != id(to) {
                    let vertices = if forward { [from, to] } else { [to, from] };
                    edges.push((vertices.map(id), Edge { part, vertices, chart, forward }));
                }
            }
        }
    }
    // Stable: edges of equal ends stay in the order of their triangles.
    edges.par_sort_by_key(|&(key, _)| key);
    let joined = |a: &Edge, b: &Edge| {
        let (p, q) = (body[a.part as usize].1, body[b.part as usize].1);
        a.part == b.part
            && a.chart == b.chart
            && (0..2).all(|k| p.uv_texels[a.vertices[k] as usize] == q.uv_texels[b.vertices[k] as usize])
    };
    let smooth = |a: &Edge, b: &Edge| {
        (0..2).all(|k| normal(scene, body, a, k).dot(normal(scene, body, b, k)) >= SMOOTH)
    };
    let mut cuts = Vec::new();
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        let mut taken = vec![false; shared.len()];
        for i in 0..shared.len() {
            for j in i + 1..shared.len() {
                let (a, b) = (&shared[i].1, &shared[j].1);
                if taken[i] || taken[j] || a.forward == b.forward || !smooth(a, b) {
                    continue;
                }
                (taken[i], taken[j]) = (true, true);
                if !joined(a, b) {
                    cuts.push([*a, *b]);
                }
            }
        }
    }
    cuts
}

/// Normal at an end of an edge.
fn normal(scene: &Scene, body: &[(usize, &Placement)], edge: &Edge, end: usize) -> Vec3 {
    let (surface, placement) = body[edge.part as usize];
    let vertex = placement.unwrap.source_vertex[edge.vertices[end] as usize] as usize;
    scene.surfaces[surface].normal_world.get(vertex).copied().unwrap_or(Vec3::ZERO)
}

/// Ids of positions that are equal to the bit, per surface and source vertex.
fn weld(scene: &Scene, body: &[(usize, &Placement)]) -> Vec<Vec<u32>> {
    let positions = |&(i, _): &(usize, &Placement)| scene.surfaces[i].position_world.as_slice();
    let mut keys: Vec<([u32; 3], u32, u32)> = Vec::new();
    for (part, surface) in (0..).zip(body) {
        let bits = |p: &Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
        keys.extend((0..).zip(positions(surface)).map(|(v, p)| (bits(p), part, v)));
    }
    keys.par_sort_unstable();
    let mut ids: Vec<Vec<u32>> = body.iter().map(|surface| vec![0; positions(surface).len()]).collect();
    let mut id = 0;
    for (i, &(key, part, vertex)) in keys.iter().enumerate() {
        id += u32::from(i > 0 && keys[i - 1].0 != key);
        ids[part as usize][vertex as usize] = id;
    }
    ids
}
