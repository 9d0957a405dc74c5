//! Charts by projection onto a plane: exact where the surface is flat, the fallback where nothing else works.

use super::topology::{NONE, Topology, plane_axes};
use crate::scene::Geometry;
use glam::{DVec2, DVec3, Vec2};
use std::collections::BinaryHeap;

/// Some triangles of a geometry and their flattened corners, any scale.
#[derive(Clone, Debug)]
pub(super) struct RawChart {
    pub triangles: Vec<u32>,
    pub corner_uv: Vec<[Vec2; 3]>,
}

/// A region whose normals all stay this near their mean is a plane: what projection loses, 1 − cos 0.5°, is 4e-5.
const PLANE_COS: f64 = 0.999_96;

/// A cone chart should not hold normals further than this from its mean (50°)...
const CONE_COS: f64 = 0.642;
/// ...and never holds one further than this (66°): projection then squeezes to no less than 0.4.
const CONE_LIMIT_COS: f64 = 0.4;
/// Rounds in which cone charts move their seeds and get more of them.
const ROUNDS: usize = 5;
/// Rounds in which triangles that no cone reached get seeds of their own.
const STRAY_ROUNDS: usize = 20;

/// Area-weighted mean normal.
fn mean_normal(topology: &Topology, triangles: &[u32]) -> Option<DVec3> {
    let sum: DVec3 =
        triangles.iter().map(|&t| topology.normal[t as usize].as_dvec3() * topology.area[t as usize]).sum();
    sum.try_normalize()
}

/// Cosine of the largest angle between the normals and `mean`.
fn flatness(topology: &Topology, triangles: &[u32], mean: DVec3) -> f64 {
    triangles.iter().map(|&t| topology.normal[t as usize].as_dvec3().dot(mean)).fold(1.0, f64::min)
}

/// The region's one chart when it is a plane.
pub(super) fn plane(geometry: &Geometry, topology: &Topology, triangles: &[u32]) -> Option<RawChart> {
    let mean = mean_normal(topology, triangles)?;
    (flatness(topology, triangles, mean) >= PLANE_COS).then(|| project(geometry, triangles, mean))
}

/// A triangle on its own, laid down without loss.
pub(super) fn lone(geometry: &Geometry, topology: &Topology, triangle: u32) -> RawChart {
    project(geometry, &[triangle], topology.normal[triangle as usize].as_dvec3())
}

/// Parallel projection along `normal`.
fn project(geometry: &Geometry, triangles: &[u32], normal: DVec3) -> RawChart {
    let [u, v] = plane_axes(normal);
    let corner = |i: u32| geometry.position_local[i as usize].as_dvec3();
    // Relative to the chart's middle, so that f32 keeps small charts far from the origin.
    let corners = || triangles.iter().flat_map(|&t| geometry.triangles[t as usize]).map(corner);
    let (low, high) =
        corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let middle = (low + high) * 0.5;
    let flat = |i: u32| {
        let p = corner(i) - middle;
        DVec2::new(p.dot(u), p.dot(v)).as_vec2()
    };
    let corner_uv = triangles.iter().map(|&t| geometry.triangles[t as usize].map(flat)).collect();
    RawChart { triangles: triangles.to_vec(), corner_uv }
}

/// Cuts `triangles` into connected groups whose normals stay in a cone, and projects each along the cone's axis:
/// variational shape approximation (Cohen-Steiner, Alliez, Desbrun 2004) with the L2,1 metric, seeds added where
/// normals leave their cone. Time is a few dozen priority floods, whatever the mesh.
pub(super) fn cones(
    geometry: &Geometry,
    topology: &Topology,
    triangles: &[u32],
    narrow: f64,
) -> Vec<RawChart> {
    let (cone, limit) =
        (CONE_COS + (1.0 - CONE_COS) * narrow, CONE_LIMIT_COS + (1.0 - CONE_LIMIT_COS) * narrow);
    let mut work = Cones::new(topology, triangles);
    let first = mean_normal(topology, triangles).unwrap_or(DVec3::Y);
    let mut seeds = vec![(work.best_seed(first), first)];
    for _ in 0..ROUNDS {
        work.grow(&seeds, 0, limit);
        let (proxies, grown) = work.refit(&seeds, cone);
        seeds = proxies;
        if !grown {
            break;
        }
    }
    work.grow(&seeds, 0, limit);
    for _ in 0..STRAY_ROUNDS {
        let known = seeds.len();
        work.seed_strays(&mut seeds);
        if seeds.len() == known {
            break;
        }
        work.grow(&seeds, known, limit);
    }
    work.groups(limit).into_iter().map(|(group, axis)| project(geometry, &group, axis)).collect()
}

struct Cones<'a> {
    topology: &'a Topology,
    /// Ascending.
    triangles: Vec<u32>,
    /// Neighbours of each row, as rows, or NONE.
    across: Vec<[u32; 3]>,
    /// Seed that each row belongs to, or NONE.
    owner: Vec<u32>,
}

/// Entry of the flood: dearest last; ties by triangle, then seed.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Claim {
    /// Bits of a non-negative float, complemented: the heap gives the greatest first.
    cheapness: u64,
    row: std::cmp::Reverse<u32>,
    seed: std::cmp::Reverse<u32>,
}

impl<'a> Cones<'a> {
    fn new(topology: &'a Topology, triangles: &[u32]) -> Self {
        let mut triangles = triangles.to_vec();
        triangles.sort_unstable();
        let row = |t: u32| triangles.binary_search(&t).map_or(NONE, |row| row as u32);
        let across = triangles.iter().map(|&t| topology.neighbour[t as usize].map(row)).collect();
        let owner = vec![NONE; triangles.len()];
        Self { topology, triangles, across, owner }
    }

    fn normal(&self, row: u32) -> DVec3 {
        self.topology.normal[self.triangles[row as usize] as usize].as_dvec3()
    }

    fn area(&self, row: u32) -> f64 {
        self.topology.area[self.triangles[row as usize] as usize]
    }

    fn neighbours(&self, row: u32) -> impl Iterator<Item = u32> + use<> {
        self.across[row as usize].into_iter().filter(|&n| n != NONE)
    }

    /// The row whose normal is nearest to `axis`.
    fn best_seed(&self, axis: DVec3) -> u32 {
        let rows = 0..self.triangles.len() as u32;
        rows.max_by(|&a, &b| self.normal(a).dot(axis).total_cmp(&self.normal(b).dot(axis)).then(b.cmp(&a)))
            .unwrap_or(0)
    }

    /// Floods from all seeds from `first` on at once, the best fitting triangle first; what earlier seeds own stays,
    /// if there are any.
    fn grow(&mut self, seeds: &[(u32, DVec3)], first: usize, limit: f64) {
        if first == 0 {
            self.owner.fill(NONE);
        }
        let mut claims = BinaryHeap::new();
        let claim = |row: u32, seed: usize, cost: f64| Claim {
            cheapness: !cost.max(0.0).to_bits(),
            row: std::cmp::Reverse(row),
            seed: std::cmp::Reverse(seed as u32),
        };
        for (n, &(row, _)) in seeds.iter().enumerate().skip(first) {
            claims.push(claim(row, n, 0.0));
        }
        while let Some(Claim { row, seed, .. }) = claims.pop() {
            let (row, seed) = (row.0, seed.0 as usize);
            if self.owner[row as usize] != NONE {
                continue;
            }
            self.owner[row as usize] = seed as u32;
            let axis = seeds[seed].1;
            for n in self.neighbours(row) {
                let fit = self.normal(n).dot(axis);
                if self.owner[n as usize] == NONE && fit > limit {
                    claims.push(claim(n, seed, self.area(n) * (1.0 - fit)));
                }
            }
        }
    }

    /// Moves every seed to the triangle that stands for its group best; adds seeds where a group leaves its cone and
    /// where nobody came. True when seeds were added.
    fn refit(&self, seeds: &[(u32, DVec3)], cone: f64) -> (Vec<(u32, DVec3)>, bool) {
        let mut sum = vec![DVec3::ZERO; seeds.len()];
        for (row, &owner) in self.owner.iter().enumerate() {
            if owner != NONE {
                sum[owner as usize] += self.normal(row as u32) * self.area(row as u32);
            }
        }
        let axis: Vec<DVec3> =
            sum.iter().zip(seeds).map(|(s, &(_, old))| s.try_normalize().unwrap_or(old)).collect();
        let mut best: Vec<(f64, u32)> = vec![(f64::NEG_INFINITY, NONE); seeds.len()];
        let mut worst: Vec<(f64, u32)> = vec![(f64::INFINITY, NONE); seeds.len()];
        for (row, &owner) in self.owner.iter().enumerate() {
            let row = row as u32;
            if owner == NONE {
                continue;
            }
            let fit = self.normal(row).dot(axis[owner as usize]);
            if fit > best[owner as usize].0 {
                best[owner as usize] = (fit, row);
            }
            if fit < worst[owner as usize].0 {
                worst[owner as usize] = (fit, row);
            }
        }
        let mut next: Vec<(u32, DVec3)> = Vec::new();
        for (n, &(_, row)) in best.iter().enumerate() {
            if row != NONE {
                next.push((row, axis[n]));
            }
        }
        let before = next.len();
        for &(_, row) in worst.iter().filter(|&&(fit, row)| row != NONE && fit < cone) {
            next.push((row, self.normal(row)));
        }
        self.seed_strays(&mut next);
        let grown = next.len() > before;
        (next, grown)
    }

    /// One seed for every connected patch that nobody reached.
    fn seed_strays(&self, seeds: &mut Vec<(u32, DVec3)>) {
        let mut seen = vec![false; self.owner.len()];
        for row in 0..self.owner.len() as u32 {
            if self.owner[row as usize] != NONE || seen[row as usize] {
                continue;
            }
            seen[row as usize] = true;
            seeds.push((row, self.normal(row)));
            let mut patch = vec![row];
            while let Some(r) = patch.pop() {
                for n in self.neighbours(r) {
                    if self.owner[n as usize] == NONE && !seen[n as usize] {
                        seen[n as usize] = true;
                        patch.push(n);
                    }
                }
            }
        }
    }

    /// Connected groups with their axes; triangles that do not fit their group's final axis, or that nobody reached,
    /// stand alone.
    fn groups(&self, limit: f64) -> Vec<(Vec<u32>, DVec3)> {
        let count = self.owner.iter().filter(|&&o| o != NONE).map(|&o| o + 1).max().unwrap_or(0);
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); count as usize];
        let mut groups = Vec::new();
        for (row, &owner) in self.owner.iter().enumerate() {
            match owner {
                NONE => groups.push((vec![self.triangles[row]], self.normal(row as u32))),
                _ => members[owner as usize].push(self.triangles[row]),
            }
        }
        for group in members.into_iter().filter(|group| !group.is_empty()) {
            let axis = mean_normal(self.topology, &group).unwrap_or(DVec3::Y);
            if flatness(self.topology, &group, axis) > limit * 0.5 {
                groups.push((group, axis));
            } else {
                let normal = |t: u32| self.topology.normal[t as usize].as_dvec3();
                groups.extend(group.into_iter().map(|t| (vec![t], normal(t))));
            }
        }
        groups
    }
}
