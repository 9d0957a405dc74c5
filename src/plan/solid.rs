//! Connected components of a mesh, and whether each is the closed outward skin of a solid.

use super::columns::Columns;
use glam::{DVec3, Vec3};

/// Why a component is, or is not, the skin of a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skin {
    /// Closed, edge-manifold, consistently wound, outward everywhere.
    Closed,
    /// An edge has one triangle only.
    Open,
    /// An edge has more than two triangles, or two that wind against each other.
    Tangled,
    /// The enclosed volume is negative or nothing.
    Inward,
    /// Some part of a closed skin is turned inside out.
    Folded,
    /// The proof would cost too much.
    Intricate,
}

/// One edge-connected component.
pub(super) struct Component {
    pub(super) skin: Skin,
    /// `(part, triangle)`: which of the welded meshes, and which of its triangles.
    pub(super) triangles: Vec<(u32, u32)>,
    pub(super) min: DVec3,
    pub(super) max: DVec3,
    /// Corners of the triangles, as wound from the front, in the space of the shape.
    pub(super) corners: Vec<[DVec3; 3]>,
    /// Present when `skin` is closed.
    pub(super) columns: Option<Columns>,
}

/// A mesh to be welded with others: positions, and triangles wound counter-clockwise from the front.
pub(super) struct Part<'a> {
    pub(super) positions: &'a [Vec3],
    pub(super) triangles: &'a [[u32; 3]],
    /// Whether the winding must be turned.
    pub(super) turned: bool,
}

/// The most triangle tests a proof may take.
const MOST_TESTS: f64 = 4e8;

/// Welds by exact position and finds the components, in the order of their first triangle. Triangles that weld to
/// fewer than three corners belong to none. `prove` is false when nobody asks whether they are closed.
pub(super) fn components(parts: &[Part], prove: bool) -> Vec<Component> {
    let corner_ids = weld(parts);
    let mut rows = Vec::new();
    for (part, (mesh, ids)) in (0..).zip(parts.iter().zip(&corner_ids)) {
        for (t, &[a, b, c]) in (0..).zip(ids) {
            if a != b && b != c && c != a {
                rows.push((part, t, if mesh.turned { [a, c, b] } else { [a, b, c] }));
            }
        }
    }
    let (root, faults) = connect(&rows);
    let mut index = vec![u32::MAX; rows.len()];
    let mut groups: Vec<(Skin, Vec<usize>)> = Vec::new();
    for (row, &r) in root.iter().enumerate() {
        let r = r as usize;
        if index[r] == u32::MAX {
            index[r] = groups.len() as u32;
            groups.push((faults[r], Vec::new()));
        }
        groups[index[r] as usize].1.push(row);
    }
    let at = |part: u32, triangle: u32, corner: usize| {
        let mesh = &parts[part as usize];
        let turned = if mesh.turned { [0, 2, 1] } else { [0, 1, 2] };
        mesh.positions[mesh.triangles[triangle as usize][turned[corner]] as usize].as_dvec3()
    };
    let build = |(skin, members): (Skin, Vec<usize>)| {
        let corner = |&row: &usize| [0, 1, 2].map(|i| at(rows[row].0, rows[row].1, i));
        let corners: Vec<[DVec3; 3]> = members.iter().map(corner).collect();
        let all = || corners.iter().flatten().copied();
        let min = all().fold(DVec3::INFINITY, DVec3::min);
        let max = all().fold(DVec3::NEG_INFINITY, DVec3::max);
        let ids = members.iter().map(|&row| rows[row].2).collect();
        let (skin, columns) = match skin {
            Skin::Closed if prove => outward(corners.clone(), ids),
            other => (other, None),
        };
        let triangles = members.iter().map(|&row| (rows[row].0, rows[row].1)).collect();
        Component { skin, triangles, min, max, corners, columns }
    };
    groups.into_iter().map(build).collect()
}

/// Signed volume (negative when it winds inward) and area of triangles.
pub(super) fn volume_and_area(triangles: impl Iterator<Item = [DVec3; 3]>) -> (f64, f64) {
    let mut origin = None;
    triangles.fold((0.0, 0.0), |(volume, area), [a, b, c]| {
        let o = *origin.get_or_insert(a);
        let cross = (b - a).cross(c - a);
        (volume + cross.dot(a - o) / 6.0, area + 0.5 * cross.length())
    })
}

/// Ids of welded positions, per part and triangle; equal where all bits are equal (−0 is 0).
fn weld(parts: &[Part]) -> Vec<Vec<[u32; 3]>> {
    let bits = |v: Vec3| v.to_array().map(|x| (x + 0.0).to_bits());
    let mut keys: Vec<([u32; 3], u32, u32)> = Vec::new();
    for (part, mesh) in (0..).zip(parts) {
        keys.extend((0..).zip(mesh.positions).map(|(i, &p)| (bits(p), part, i)));
    }
    keys.sort_unstable();
    let mut ids: Vec<Vec<u32>> = parts.iter().map(|mesh| vec![0; mesh.positions.len()]).collect();
    let mut id = 0;
    for (i, &(key, part, vertex)) in keys.iter().enumerate() {
        id += u32::from(i > 0 && keys[i - 1].0 != key);
        ids[part as usize][vertex as usize] = id;
    }
    let of = |(mesh, ids): (&Part, &Vec<u32>)| {
        mesh.triangles.iter().map(|t| t.map(|v| ids[v as usize])).collect::<Vec<_>>()
    };
    parts.iter().zip(&ids).map(of).collect()
}

/// Joins triangles that share an edge: the root of every row, and per root the worst fault of its edges.
fn connect(rows: &[(u32, u32, [u32; 3])]) -> (Vec<u32>, Vec<Skin>) {
    let mut edges: Vec<([u32; 2], bool, u32)> = Vec::with_capacity(3 * rows.len());
    for (row, &(_, _, [a, b, c])) in (0..).zip(rows) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.push(([from.min(to), from.max(to)], from < to, row));
        }
    }
    edges.sort_unstable();
    let mut root: Vec<u32> = (0..rows.len() as u32).collect();
    let mut faulty = vec![Skin::Closed; rows.len()];
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        let fault = match shared {
            [_] => Skin::Open,
            [a, b] if a.1 != b.1 => Skin::Closed,
            _ => Skin::Tangled,
        };
        for edge in shared {
            join(&mut root, shared[0].2, edge.2);
            if faulty[edge.2 as usize] == Skin::Closed {
                faulty[edge.2 as usize] = fault;
            }
        }
    }
    let mut faults = vec![Skin::Closed; rows.len()];
    for row in 0..rows.len() as u32 {
        let r = find(&mut root, row);
        root[row as usize] = r;
        if faults[r as usize] == Skin::Closed {
            faults[r as usize] = faulty[row as usize];
        }
    }
    (root, faults)
}

fn find(root: &mut [u32], mut i: u32) -> u32 {
    while root[i as usize] != i {
        root[i as usize] = root[root[i as usize] as usize];
        i = root[i as usize];
    }
    i
}

fn join(root: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(root, a), find(root, b));
    root[a.max(b) as usize] = a.min(b);
}

/// Whether a closed skin is outward everywhere: its volume is positive, and no point just in front of a triangle is
/// wound around negatively. Then every back lies where the winding number is at least one, cut off from infinity.
fn outward(triangles: Vec<[DVec3; 3]>, ids: Vec<[u32; 3]>) -> (Skin, Option<Columns>) {
    let (volume, area) = volume_and_area(triangles.iter().copied());
    let columns = Columns::of(triangles, ids);
    let tolerance = columns.tolerance();
    // A skin thinner than the tolerance everywhere encloses nothing that can be told from its surface.
    if volume.is_nan() || volume <= 0.01 * tolerance * area {
        return (Skin::Inward, None);
    }
    if columns.cost() * 4.0 * columns.triangles().len() as f64 > MOST_TESTS {
        return (Skin::Intricate, None);
    }
    let sound = columns.triangles().iter().all(|&[a, b, c]| {
        let cross = (b - a).cross(c - a);
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let Some(normal) = cross.try_normalize() else { return true };
        let step = normal * (1e-4 * cross.length() / longest.sqrt());
        let weights = [[1.0, 1.0, 1.0], [8.0, 1.0, 1.0], [1.0, 8.0, 1.0], [1.0, 1.0, 8.0]];
        weights
            .iter()
            .all(|w| columns.winding((a * w[0] + b * w[1] + c * w[2]) / w.iter().sum::<f64>() + step) >= 0)
    });
    if sound { (Skin::Closed, Some(columns)) } else { (Skin::Folded, None) }
}
