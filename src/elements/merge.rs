//! Small cells joined, so that a scene of very many charts has a bounded number of patches.

use super::Elements;
use super::cells::Cell;
use glam::{DVec3, Vec3};

/// What cells must share to be joined, from the strictest on.
const RULES: [Rule; 4] = [
    Rule { surface: true, direction: true },
    Rule { surface: true, direction: false },
    Rule { surface: false, direction: true },
    Rule { surface: false, direction: false },
];

#[derive(Clone, Copy)]
struct Rule {
    surface: bool,
    direction: bool,
}

/// A cell that may be joined with others.
struct Small {
    cell: u32,
    /// Surface and side.
    surface: (u32, bool),
    /// Which face of a cube the mean normal points through.
    direction: u8,
    /// Place along a Z-order curve through space.
    place: u64,
}

/// Groups of cells, each a patch: one cell each as long as there are at most `most`; else cells below a quarter
/// of `target` are joined with their neighbours, up to `target`, under the strictest rule that suffices.
pub(super) fn merge(
    elements: &Elements,
    order: &[u32],
    cells: &[Cell],
    target: f64,
    most: usize,
) -> Vec<Vec<u32>> {
    let single = |i: u32| vec![i];
    if cells.len() <= most {
        return (0..cells.len() as u32).map(single).collect();
    }
    let is_small = |&i: &u32| cells[i as usize].area < 0.25 * target;
    let large = (0..cells.len() as u32).filter(|i| !is_small(i));
    let mut smalls: Vec<Small> =
        (0..cells.len() as u32).filter(is_small).map(|i| small(elements, order, cells, i)).collect();
    place(elements, &mut smalls, order, cells);
    let kept: Vec<Vec<u32>> = large.map(single).collect();
    let mut joined = Vec::new();
    for rule in RULES {
        joined = join(&mut smalls, cells, target, rule);
        if kept.len() + joined.len() <= most {
            break;
        }
    }
    kept.into_iter().chain(joined).collect()
}

fn join(smalls: &mut [Small], cells: &[Cell], target: f64, rule: Rule) -> Vec<Vec<u32>> {
    let class = |small: &Small| {
        (rule.surface.then_some(small.surface), if rule.direction { small.direction } else { 0 })
    };
    smalls.sort_by_key(|small| (class(small), small.place, small.cell));
    let mut groups: Vec<Vec<u32>> = Vec::new();
    let (mut area, mut last) = (f64::INFINITY, None);
    for small in smalls.iter() {
        let more = cells[small.cell as usize].area;
        if area + more > target || last != Some(class(small)) {
            groups.push(Vec::new());
            area = 0.0;
        }
        last = Some(class(small));
        area += more;
        if let Some(group) = groups.last_mut() {
            group.push(small.cell);
        }
    }
    groups
}

fn small(elements: &Elements, order: &[u32], cells: &[Cell], i: u32) -> Small {
    let cell = &cells[i as usize];
    let chart = &elements.charts[cell.chart as usize];
    let members = order[cell.range.clone()].iter().filter(|&&e| elements.valid[e as usize]);
    let normal: DVec3 = members
        .map(|&e| elements.normal_geometric[e as usize].as_dvec3() * f64::from(elements.area[e as usize].0))
        .sum();
    let axis = (0..3).fold(0, |best, axis| if normal[axis].abs() > normal[best].abs() { axis } else { best });
    let direction = 2 * axis as u8 + u8::from(normal[axis] < 0.0);
    Small { cell: i, surface: (chart.surface, chart.back), direction, place: 0 }
}

/// Gives every cell its place on the curve, from its first valid element.
fn place(elements: &Elements, smalls: &mut [Small], order: &[u32], cells: &[Cell]) {
    let at = |small: &Small| {
        let mut members = order[cells[small.cell as usize].range.clone()].iter();
        members
            .find(|&&e| elements.valid[e as usize])
            .map_or(Vec3::ZERO, |&e| elements.position_world[e as usize])
    };
    let (min, max) = smalls
        .iter()
        .map(at)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let size = (max - min).max_element().max(f32::MIN_POSITIVE);
    for small in smalls {
        let scaled = (at(small) - min) / size * 1_048_575.0;
        small.place = spread(scaled.x as u64) | spread(scaled.y as u64) << 1 | spread(scaled.z as u64) << 2;
    }
}

/// Moves bit i of a 21 bit number to bit 3i.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}
