//! Point in solid: winding numbers of a closed triangle mesh, by counting crossings along one axis.

use glam::{DVec2, DVec3};

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Winding number 0 or less.
    Outside,
    /// Winding number 1 or more.
    Inside,
    /// Within the tolerance of the surface: neither can be said.
    On,
}

/// The triangles of one closed component, binned by their projection along its shortest side.
pub(super) struct Columns {
    triangles: Vec<[DVec3; 3]>,
    /// Identity of every corner: two triangles that share an edge must judge it alike.
    corners: Vec<[u32; 3]>,
    axes: [usize; 3],
    min: DVec3,
    max: DVec3,
    cells: [usize; 2],
    start: Vec<u32>,
    entries: Vec<u32>,
    tolerance: f64,
}

/// A point counts as on a surface within this share of the component's diagonal.
const ON_SURFACE: f64 = 1e-5;

impl Columns {
    /// The same with the tolerance that all proofs use.
    pub(super) fn of(triangles: Vec<[DVec3; 3]>, corners: Vec<[u32; 3]>) -> Self {
        let all = || triangles.iter().flatten().copied();
        let min = all().fold(DVec3::INFINITY, DVec3::min);
        let max = all().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self::new(triangles, corners, ON_SURFACE * min.distance(max))
    }

    /// The distance within which a point is on the surface.
    pub(super) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Triangles whose boxes come within the tolerance of a box; some of them twice.
    pub(super) fn near(&self, min: DVec3, max: DVec3) -> impl Iterator<Item = usize> + '_ {
        let (low, high) = (self.cell(self.flat(min)), self.cell(self.flat(max)));
        let rows = if self.reaches(min, max) { low[1]..high[1] + 1 } else { 0..0 };
        let cells = rows.flat_map(move |y| (low[0]..=high[0]).map(move |x| y * self.cells[0] + x));
        let entries = cells.flat_map(|i| &self.entries[self.start[i] as usize..self.start[i + 1] as usize]);
        entries.map(|&t| t as usize).filter(move |&t| {
            let [a, b, c] = self.triangles[t];
            let (low, high) = (a.min(b).min(c) - self.tolerance, a.max(b).max(c) + self.tolerance);
            low.cmple(max).all() && high.cmpge(min).all()
        })
    }

    /// Whether a triangle gets through triangle `t` by more than the tolerance: no axis parts them (Ericson,
    /// Real-Time Collision Detection, 5.2.10).
    pub(super) fn crosses(&self, t: usize, triangle: &[DVec3; 3]) -> bool {
        let edges = |[a, b, c]: &[DVec3; 3]| [*b - *a, *c - *b, *a - *c];
        let (one, other) = (&self.triangles[t], triangle);
        let (ones, others) = (edges(one), edges(other));
        let normals = [ones[0].cross(ones[1]), others[0].cross(others[1])];
        let between = ones.iter().flat_map(|a| others.iter().map(|b| a.cross(*b)));
        let inside =
            ones.iter().map(|e| normals[0].cross(*e)).chain(others.iter().map(|e| normals[1].cross(*e)));
        let parts = |axis: DVec3| {
            let Some(axis) = axis.try_normalize() else { return false };
            let range = |corners: &[DVec3; 3]| {
                let along = corners.map(|corner| axis.dot(corner - one[0]));
                (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]))
            };
            let (a, b) = (range(one), range(other));
            a.1 <= b.0 + self.tolerance || b.1 <= a.0 + self.tolerance
        };
        !normals.into_iter().chain(between).chain(inside).any(parts)
    }

    /// Whether any triangle comes nearer to a point than `reach`.
    pub(super) fn is_near(&self, p: DVec3, reach: f64) -> bool {
        let reach = reach + self.tolerance;
        let slack = DVec3::splat(reach);
        self.reaches(p - slack, p + slack)
            && self.triangles.iter().any(|t| distance_squared(p, t) <= reach * reach)
    }

    /// `corners` hold ids of welded vertices; `tolerance` is the distance within which a point is on the surface.
    pub(super) fn new(triangles: Vec<[DVec3; 3]>, corners: Vec<[u32; 3]>, tolerance: f64) -> Self {
        let all = || triangles.iter().flatten().copied();
        let min = all().fold(DVec3::INFINITY, DVec3::min) - tolerance;
        let max = all().fold(DVec3::NEG_INFINITY, DVec3::max) + tolerance;
        let extent = max - min;
        let along = (0..3).min_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(2);
        let axes = [(along + 1) % 3, (along + 2) % 3, along];
        let mut columns = Self {
            triangles,
            corners,
            axes,
            min,
            max,
            cells: [1, 1],
            start: vec![],
            entries: vec![],
            tolerance,
        };
        columns.bin();
        columns
    }

    /// Mean number of triangles a query looks at.
    pub(super) fn cost(&self) -> f64 {
        self.entries.len() as f64 / (self.cells[0] * self.cells[1]) as f64
    }

    pub(super) fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Whether the boxes overlap.
    pub(super) fn reaches(&self, min: DVec3, max: DVec3) -> bool {
        min.cmple(self.max).all() && max.cmpge(self.min).all()
    }

    pub(super) fn place(&self, p: DVec3) -> Place {
        if !self.reaches(p, p) {
            return Place::Outside;
        }
        let near = self.tolerance * self.tolerance;
        if self.column(p).any(|t| distance_squared(p, &self.triangles[t]) <= near) {
            return Place::On;
        }
        if self.winding(p) > 0 { Place::Inside } else { Place::Outside }
    }

    /// How often the surface winds around the point.
    pub(super) fn winding(&self, p: DVec3) -> i32 {
        if !self.reaches(p, p) {
            return 0;
        }
        self.column(p).map(|t| self.crossing(t, p)).sum()
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p[self.axes[0]], p[self.axes[1]])
    }

    fn cell(&self, p: DVec2) -> [usize; 2] {
        let (min, max) = (self.flat(self.min), self.flat(self.max));
        std::array::from_fn(|i| {
            let share = (p[i] - min[i]) / (max[i] - min[i]).max(f64::MIN_POSITIVE);
            ((share * self.cells[i] as f64) as usize).min(self.cells[i] - 1)
        })
    }

    fn column(&self, p: DVec3) -> impl Iterator<Item = usize> + '_ {
        let [x, y] = self.cell(self.flat(p));
        let i = y * self.cells[0] + x;
        self.entries[self.start[i] as usize..self.start[i + 1] as usize].iter().map(|&t| t as usize)
    }

    /// What triangle `t` adds to the winding number: a ray along the axis leaves through a back (+1) or enters
    /// through a front (−1).
    fn crossing(&self, t: usize, p: DVec3) -> i32 {
        let corner = self.triangles[t];
        let [a, b, c] = corner.map(|q| self.flat(q));
        let q = self.flat(p);
        let ids = self.corners[t];
        let sides = [
            side_of_edge(a, b, ids[0] < ids[1], q),
            side_of_edge(b, c, ids[1] < ids[2], q),
            side_of_edge(c, a, ids[2] < ids[0], q),
        ];
        if sides[0] != sides[1] || sides[1] != sides[2] {
            return 0;
        }
        let normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
        let above = normal.dot(corner[0] - p) / normal[self.axes[2]];
        match (above > 0.0, sides[0]) {
            (true, true) => 1,
            (true, false) => -1,
            (false, _) => 0,
        }
    }

    /// Fills the bins, as finely as 16 entries a triangle allow.
    fn bin(&mut self) {
        let n = self.triangles.len();
        let extent = self.max - self.min;
        let (w, h) = (extent[self.axes[0]], extent[self.axes[1]]);
        let mut scale = (n as f64 / (w * h).max(f64::MIN_POSITIVE)).sqrt();
        loop {
            self.cells = [w, h].map(|e| ((e * scale).ceil().min(4096.0) as usize).max(1));
            let ranges: Vec<_> = self.triangles.iter().map(|t| self.range(t)).collect();
            let total: usize = ranges.iter().map(|(lo, hi)| (hi[0] - lo[0] + 1) * (hi[1] - lo[1] + 1)).sum();
            if total > 16 * n && self.cells != [1, 1] {
                scale *= 0.5;
                continue;
            }
            let mut start = vec![0_u32; self.cells[0] * self.cells[1] + 1];
            let covered = |(lo, hi): &([usize; 2], [usize; 2])| {
                let (width, x, y) = (self.cells[0], lo[0]..=hi[0], lo[1]..=hi[1]);
                y.flat_map(move |y| x.clone().map(move |x| y * width + x))
            };
            for range in &ranges {
                covered(range).for_each(|cell| start[cell + 1] += 1);
            }
            for i in 1..start.len() {
                start[i] += start[i - 1];
            }
            let mut entries = vec![0_u32; total];
            let mut next = start.clone();
            for (t, range) in ranges.iter().enumerate() {
                for cell in covered(range) {
                    entries[next[cell] as usize] = t as u32;
                    next[cell] += 1;
                }
            }
            (self.start, self.entries) = (start, entries);
            return;
        }
    }

    fn range(&self, triangle: &[DVec3; 3]) -> ([usize; 2], [usize; 2]) {
        let flat = triangle.map(|p| self.flat(p));
        let lo = flat[0].min(flat[1]).min(flat[2]) - self.tolerance;
        let hi = flat[0].max(flat[1]).max(flat[2]) + self.tolerance;
        (self.cell(lo), self.cell(hi))
    }
}

/// Whether `q` lies left of the edge a → b. Always computed from the corner with the lower id, and a point on the
/// line counts as moved by (ε, ε²): so the two triangles of an edge never both claim or both refuse a point.
fn side_of_edge(a: DVec2, b: DVec2, ascending: bool, q: DVec2) -> bool {
    let (from, to) = if ascending { (a, b) } else { (b, a) };
    let edge = to - from;
    let mut left = edge.perp_dot(q - from);
    if left == 0.0 {
        left = if edge.y != 0.0 { -edge.y } else { edge.x };
    }
    (left > 0.0) == ascending
}

/// Squared distance from a point to a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
fn distance_squared(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal) >= 0.0;
    if normal != DVec3::ZERO && inside(a, b) && inside(b, c) && inside(c, a) {
        let height = normal.dot(p - a);
        return height * height / normal.length_squared();
    }
    let edge = |from: DVec3, to: DVec3| {
        let along = to - from;
        let share = (along.dot(p - from) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance_squared(from + along * share)
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit cube, corners numbered by bits x, y, z.
    fn cube() -> Columns {
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let corners: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let at = |i: u32| DVec3::new((i & 1) as f64, ((i >> 1) & 1) as f64, ((i >> 2) & 1) as f64);
        Columns::new(corners.iter().map(|t| t.map(at)).collect(), corners, 1e-6)
    }

    #[test]
    fn a_cube_winds_once_around_its_inside() {
        let cube = cube();
        for i in 0..=20 {
            for j in 0..=20 {
                for k in 0..=20 {
                    let p = (DVec3::new(i as f64, j as f64, k as f64) - 5.0) / 10.0;
                    let inside = p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::ONE).all();
                    let on = !inside && p.cmpge(DVec3::ZERO).all() && p.cmple(DVec3::ONE).all();
                    let expected = if on {
                        Place::On
                    } else if inside {
                        Place::Inside
                    } else {
                        Place::Outside
                    };
                    assert_eq!(cube.place(p), expected, "{p}");
                }
            }
        }
    }
}
