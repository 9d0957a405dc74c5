//! From the nodes of the gather to the elements between them.
//!
//! A cell's four corners and middle were gathered and agree. Light is smooth there, so it is interpolated by a
//! biquadratic through nine values: what is missing are the middles of the four edges. They come from the nodes on
//! the edge's own line, by Lagrange's polynomial through up to four of them (error of fourth order in the cell's
//! width). An edge knows nothing but its line, so the two cells that share it agree along it.
//!
//! A bilinear surface with a tent in the middle would do without, but it lies below every dome: in a room lit by one
//! lamp it took 0.5 % of the light.

use super::cells::{Cell, SAME_NORMAL, element_at};
use crate::elements::{Chart, Elements};
use crate::units::Irradiance;
use glam::Vec3;
use rayon::prelude::*;

/// How the elements of a finished cell get their values.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    /// Through four corners and a middle that lie exactly on the grid.
    Quadratic { corner: [u32; 4], middle: u32 },
    /// `at + du·x + dv·y`, texels from the cell's corner: a least-squares plane through nodes that do not.
    Plane { middle: u32, at: Vec3, du: Vec3, dv: Vec3 },
}

/// A cell whose nodes agree.
#[derive(Clone, Copy)]
pub(super) struct Finished {
    pub cell: Cell,
    pub shape: Shape,
    /// The difference that was allowed between nodes: no edge bends further than this.
    pub allowed: f32,
}

/// What was gathered.
pub(super) struct Nodes<'a> {
    pub elements: &'a Elements,
    /// One row an element.
    pub value: &'a [Irradiance],
    /// Whether the element's value was gathered.
    pub gathered: &'a [bool],
}

impl Nodes<'_> {
    /// Values of the elements between a cell's nodes.
    pub fn fill(&self, finished: &Finished) -> Vec<(u32, Irradiance)> {
        let Finished { cell, shape, allowed } = finished;
        let chart = &self.elements.charts[cell.chart as usize];
        let surface: Box<dyn Fn(f32, f32) -> Vec3> = match *shape {
            Shape::Plane { at, du, dv, .. } => Box::new(move |x, y| at + du * x + dv * y),
            Shape::Quadratic { corner, middle } => {
                let grid = self.grid(cell, chart, corner, middle, *allowed);
                Box::new(move |x, y| grid.at(x, y))
            }
        };
        let mut out = Vec::new();
        for y in cell.min[1]..=cell.max[1] {
            for x in cell.min[0]..=cell.max[0] {
                let Some(e) = element_at(self.elements, chart, x, y) else { continue };
                if !self.gathered[e as usize] {
                    let value = surface(f32::from(x - cell.min[0]), f32::from(y - cell.min[1]));
                    out.push((e, Irradiance(value.max(Vec3::ZERO))));
                }
            }
        }
        out
    }

    /// All of them, cell by cell; where cells share a border the first one's value counts.
    pub fn fill_all(&self, finished: &[Finished]) -> Vec<(u32, Irradiance)> {
        finished.par_iter().flat_map_iter(|cell| self.fill(cell)).collect()
    }

    fn grid(&self, cell: &Cell, chart: &Chart, corner: [u32; 4], middle: u32, allowed: f32) -> Grid {
        let ([x0, y0], [x1, y1]) = (cell.min, cell.max);
        let (xm, ym) = ((x0 + x1) / 2, (y0 + y1) / 2);
        let value = |e: u32| self.value[e as usize].0;
        let [a, b, c, d] = corner.map(value);
        let edge = |axis: usize, at: u16, ends: [u16; 2], values: [Vec3; 2]| {
            let line = Line { nodes: self, chart, axis, at, like: middle };
            line.middle(ends, if axis == 0 { xm } else { ym }, values, allowed)
        };
        Grid {
            s: [0.0, f32::from(xm - x0), f32::from(x1 - x0)],
            t: [0.0, f32::from(ym - y0), f32::from(y1 - y0)],
            value: [
                [a, edge(0, y0, [x0, x1], [a, b]), b],
                [edge(1, x0, [y0, y1], [a, c]), value(middle), edge(1, x1, [y0, y1], [b, d])],
                [c, edge(0, y1, [x0, x1], [c, d]), d],
            ],
        }
    }
}

/// A row or column of texels of a chart.
struct Line<'a> {
    nodes: &'a Nodes<'a>,
    chart: &'a Chart,
    axis: usize,
    /// The other coordinate.
    at: u16,
    /// An element whose normal the nodes must share.
    like: u32,
}

impl Line<'_> {
    fn node(&self, along: i32) -> Option<Vec3> {
        let along = u16::try_from(along).ok()?;
        let (x, y) = if self.axis == 0 { (along, self.at) } else { (self.at, along) };
        let [low, high] = [self.chart.min, self.chart.max];
        if x < low[0] || y < low[1] || x >= high[0] || y >= high[1] {
            return None;
        }
        let elements = self.nodes.elements;
        let e = element_at(elements, self.chart, x, y)? as usize;
        let straight =
            elements.normal_shading[e].dot(elements.normal_shading[self.like as usize]) >= SAME_NORMAL;
        (self.nodes.gathered[e] && straight).then(|| self.nodes.value[e].0)
    }

    /// The node about a cell's width beyond an end. Grids of neighbouring blocks are a texel apart.
    fn beyond(&self, end: u16, away: i32) -> Option<(f32, Vec3)> {
        [away, away + away.signum(), away - away.signum()].into_iter().filter(|&d| d != 0).find_map(|d| {
            let at = i32::from(end) + d;
            self.node(at).map(|value| (at as f32, value))
        })
    }

    /// The value between two ends.
    fn middle(&self, ends: [u16; 2], at: u16, values: [Vec3; 2], allowed: f32) -> Vec3 {
        let [from, to] = ends;
        if at == from {
            return values[0];
        }
        if let Some(value) = self.node(at.into()) {
            return value;
        }
        let width = i32::from(to) - i32::from(from);
        let mut points =
            [(f32::from(from), values[0]), (f32::from(to), values[1]), (0.0, Vec3::ZERO), (0.0, Vec3::ZERO)];
        let mut count = 2;
        for beyond in [self.beyond(from, -width), self.beyond(to, width)].into_iter().flatten() {
            points[count] = beyond;
            count += 1;
        }
        let x = f32::from(at);
        let straight = values[0].lerp(values[1], (x - f32::from(from)) / width as f32);
        let bend = lagrange(&points[..count], x) - straight;
        straight + bend.clamp(Vec3::splat(-allowed), Vec3::splat(allowed))
    }
}

/// The polynomial of least degree through the points, at `x`.
fn lagrange(points: &[(f32, Vec3)], x: f32) -> Vec3 {
    let weight = |i: usize| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, p)| (x - p.0) / (points[i].0 - p.0)).product::<f32>()
    };
    points.iter().enumerate().map(|(i, p)| p.1 * weight(i)).sum()
}

/// Nine values and the biquadratic surface through them.
struct Grid {
    s: [f32; 3],
    t: [f32; 3],
    /// Rows along t.
    value: [[Vec3; 3]; 3],
}

impl Grid {
    fn at(&self, x: f32, y: f32) -> Vec3 {
        let row = |values: &[Vec3; 3], at: &[f32; 3], x: f32| {
            // Cells one texel wide have their middle at an end.
            if at[1] == at[0] {
                return values[0].lerp(values[2], if at[2] > 0.0 { x / at[2] } else { 0.0 });
            }
            lagrange(&[(at[0], values[0]), (at[1], values[1]), (at[2], values[2])], x)
        };
        let column = [0, 1, 2].map(|k| row(&self.value[k], &self.s, x));
        row(&column, &self.t, y)
    }
}

/// Least-squares plane through values; a touch of damping keeps it flat where the points do not fix it.
pub(super) fn plane(points: &[(f32, f32, Vec3)]) -> (Vec3, Vec3, Vec3) {
    let n = points.len() as f32;
    let mean =
        points.iter().fold((0.0, 0.0, Vec3::ZERO), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n, m.2 + p.2 / n));
    let (mut xx, mut xy, mut yy) = (0.0_f32, 0.0_f32, 0.0_f32);
    let (mut xv, mut yv) = (Vec3::ZERO, Vec3::ZERO);
    for &(x, y, v) in points {
        let (x, y, v) = (x - mean.0, y - mean.1, v - mean.2);
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xv += v * x;
        yv += v * y;
    }
    let damping = 1e-3 * (xx + yy) + 1e-6;
    let (xx, yy) = (xx + damping, yy + damping);
    let determinant = xx * yy - xy * xy;
    let (du, dv) = ((xv * yy - yv * xy) / determinant, (yv * xx - xv * xy) / determinant);
    (mean.2 - du * mean.0 - dv * mean.1, du, dv)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_biquadratic_is_met_exactly() {
        let f = |x: f32, y: f32| Vec3::new(1.0 + 0.5 * x * x - y, 2.0 - 0.1 * x * y * y, 0.25 * y * y);
        let (s, t) = ([0.0, 7.0, 15.0], [0.0, 4.0, 8.0]);
        let grid = Grid { s, t, value: t.map(|y| s.map(|x| f(x, y))) };
        for (x, y) in [(0.0, 0.0), (3.0, 5.0), (15.0, 8.0), (11.0, 1.0)] {
            // f32 sums of up to 110.
            assert!((grid.at(x, y) - f(x, y)).abs().max_element() < 1e-4, "{} {}", grid.at(x, y), f(x, y));
        }
    }

    #[test]
    fn a_cubic_is_met_by_four_nodes_on_a_line() {
        let f = |x: f32| Vec3::new(1.0, x, 0.01 * x * x * x);
        let points = [4.0, 20.0, -12.0, 37.0].map(|x| (x, f(x)));
        assert!((lagrange(&points, 12.0) - f(12.0)).abs().max_element() < 1e-3);
    }

    #[test]
    fn a_plane_goes_through_its_points() {
        let f = |x: f32, y: f32| Vec3::new(1.0 + 0.5 * x, 2.0 - y, 0.0);
        let points = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (5.0, 3.0)].map(|(x, y)| (x, y, f(x, y)));
        let (at, du, dv) = plane(&points);
        // The damping takes a thousandth of the slope.
        assert!((at + du * 2.0 + dv - f(2.0, 1.0)).abs().max_element() < 0.01);
    }
}
