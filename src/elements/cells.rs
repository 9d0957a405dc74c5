//! Quadtrees over the charts, cut where their cells reach the wanted size.

use super::Elements;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// A square block of a chart.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Its elements in the Z-order of [`cells`].
    pub range: Range<usize>,
    /// Chart.
    pub chart: u32,
    /// Area of its valid elements, m².
    pub area: f64,
}

/// A block that may be cut into four.
struct Node {
    range: Range<usize>,
    area: f64,
    /// Whether the normals differ too much for one patch.
    curved: bool,
    children: Range<usize>,
}

/// A cone of normals of 40° half angle has a mean of this length, (1 + cos 40°) / 2.
const LEAST_MEAN_NORMAL: f64 = 0.883;
/// Curved blocks are cut down to this share of the wanted area.
const CURVED_SHARE: f64 = 1.0 / 16.0;
/// The tree is built down to blocks of this share of the mean area a patch would have.
const FINEST_SHARE: f64 = 1.0 / 4.0;

/// All elements, chart by chart in Z-order; the cells, blocks of them with valid area; and the area above which blocks
/// were cut. Blocks smaller than a quarter of it count by their area only, so that small charts do not take the
/// patches away from the large ones; [`super::merge`] joins them. The wanted number is that of the charts that count;
/// the others are cut as finely.
pub(super) fn cells(
    elements: &Elements,
    wanted: u32,
    counts: impl Fn(usize) -> bool,
) -> (Vec<u32>, Vec<Cell>, f64) {
    let order: Vec<u32> =
        elements.charts.par_iter().flat_map_iter(|chart| z_order(elements, chart)).collect();
    let weight =
        |e: u32| if elements.valid[e as usize] { f64::from(elements.area[e as usize].0) } else { 0.0 };
    let counted = || (0..elements.charts.len()).filter(|&chart| counts(chart));
    let ids = counted().flat_map(|chart| elements.charts[chart].elements.clone());
    let total: f64 = ids.map(weight).sum();
    let mean = total / f64::from(wanted);
    let build = |chart: &super::Chart| {
        let range = chart.elements.start as usize..chart.elements.end as usize;
        tree(elements, &order, range, [chart.min, chart.max], mean * FINEST_SHARE)
    };
    let trees: Vec<Vec<Node>> = elements.charts.par_iter().map(build).collect();

    let fits = |area: f64| {
        let cut: Vec<&Node> = counted().flat_map(|chart| leaves(&trees[chart], area)).collect();
        let large = cut.iter().filter(|node| node.area >= 0.25 * area).count();
        let small: f64 = cut.iter().map(|node| node.area).filter(|&a| a < 0.25 * area).sum();
        large as f64 + small / area <= f64::from(wanted)
    };
    // The least area that fits, to 1 %: the count falls as the area grows.
    let (mut low, mut high) = (mean * FINEST_SHARE, total.max(f64::MIN_POSITIVE));
    while high > 1.01 * low && low > 0.0 {
        let middle = (low * high).sqrt();
        if fits(middle) { high = middle } else { low = middle }
    }
    let cut = (0..).zip(&trees).flat_map(|(chart, tree)| {
        let cell = move |node: &Node| Cell { range: node.range.clone(), chart, area: node.area };
        leaves(tree, high).into_iter().filter(|node| node.area > 0.0).map(cell)
    });
    (order, cut.collect(), high)
}

/// The elements of a chart along a Z-order curve through its rectangle.
fn z_order(elements: &Elements, chart: &super::Chart) -> Vec<u32> {
    let key = |e: u32| code(elements, [chart.min, chart.max], e);
    let mut ids: Vec<u32> = chart.elements.clone().collect();
    ids.sort_by_cached_key(|&e| key(e));
    ids
}

/// Interleaved bits of the column and row inside the chart.
fn code(elements: &Elements, [min, _]: [[u16; 2]; 2], e: u32) -> u32 {
    let texel = elements.texel[e as usize];
    spread(texel.x.saturating_sub(min[0])) | spread(texel.y.saturating_sub(min[1])) << 1
}

/// Moves bit i to bit 2i.
fn spread(x: u16) -> u32 {
    let mut x = u32::from(x);
    for (shift, mask) in [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)] {
        x = (x | x << shift) & mask;
    }
    x
}

/// The quadtree of a chart, root first, cut while blocks are larger than `finest` or curved.
fn tree(
    elements: &Elements,
    order: &[u32],
    range: Range<usize>,
    rectangle: [[u16; 2]; 2],
    finest: f64,
) -> Vec<Node> {
    let node = |range: Range<usize>| {
        let (mut area, mut normal) = (0.0, DVec3::ZERO);
        for &e in order[range.clone()].iter().filter(|&&e| elements.valid[e as usize]) {
            let a = f64::from(elements.area[e as usize].0);
            area += a;
            normal += elements.normal_geometric[e as usize].as_dvec3() * a;
        }
        Node { range, area, curved: normal.length() < LEAST_MEAN_NORMAL * area, children: 0..0 }
    };
    let [min, max] = rectangle;
    let widest = (max[0] - min[0]).max(max[1] - min[1]);
    // Bits of a code that tell the quarters of the root apart.
    let top = 2 * u32::from(widest).next_power_of_two().trailing_zeros();
    let mut nodes = vec![node(range)];
    let mut levels = vec![top];
    let mut next = 0;
    while next < nodes.len() {
        let (range, level) = (nodes[next].range.clone(), levels[next]);
        let coarse =
            nodes[next].area > finest || (nodes[next].curved && nodes[next].area > finest * CURVED_SHARE);
        if coarse && range.len() > 1 && level >= 2 {
            let first = nodes.len();
            let mut begin = range.start;
            for quarter in 0..4 {
                let end = begin
                    + order[begin..range.end]
                        .partition_point(|&e| (code(elements, rectangle, e) >> (level - 2) & 3) <= quarter);
                if end > begin {
                    nodes.push(node(begin..end));
                    levels.push(level - 2);
                }
                begin = end;
            }
            nodes[next].children = first..nodes.len();
        }
        next += 1;
    }
    nodes
}

/// The blocks of a tree when those above `area`, or curved and above a share of it, are cut; in Z-order.
fn leaves(tree: &[Node], area: f64) -> Vec<&Node> {
    let mut leaves = Vec::new();
    let mut stack = vec![0];
    while let Some(i) = stack.pop() {
        let node = &tree[i];
        let coarse = node.area > area || (node.curved && node.area > CURVED_SHARE * area);
        if coarse && !node.children.is_empty() {
            stack.extend(node.children.clone().rev());
        } else {
            leaves.push(node);
        }
    }
    leaves
}
