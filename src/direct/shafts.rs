//! Which texels of a block surely see all of an emitter: no triangle reaches into the shaft between the two. Tiles of
//! texels are asked before their texels, with what few triangles reach into the tile's shaft (Haines & Wallace 1994,
//! section 4).

use super::Emitter;
use super::footprint::Footprint;
use crate::transport::{Shaft, World};
use glam::Vec3;

/// Tiles are parted into so many along each axis, down to texels.
const PART: usize = 4;
/// Tiles above texels.
const LEVELS: usize = 3;
/// Of more triangles no list is kept. Where more reach into the shaft of the smallest tile, its texels are not asked one
/// by one: that would cost more than their rays.
const MOST: usize = 32;

/// Where shadow rays of a texel or a tile start.
#[derive(Clone, Copy)]
struct Start {
    low: Vec3,
    high: Vec3,
    /// Normal of the plane that all of them stand on, and the least height along it; none where there are several planes.
    plane: Option<(Vec3, f64)>,
}

/// A block's texels and the tiles above them.
pub struct Tiles {
    /// Texels along both axes.
    size: [usize; 2],
    /// Texels in rows, then the tiles of each level; none where nothing starts.
    levels: [Vec<Option<Start>>; LEVELS + 1],
}

/// One emitter's search.
pub struct Search<'a, E> {
    pub emitter: &'a E,
    pub world: &'a World,
    pub tiles: &'a Tiles,
}

impl Tiles {
    /// Texels in rows of `size[0]`, where there is one.
    pub fn new(size: [usize; 2], footprints: impl Iterator<Item = Option<Footprint>>) -> Self {
        let start = |footprint: Footprint| {
            let [low, high] = footprint.starts();
            Start { low, high, plane: Some(footprint.plane()) }
        };
        let mut levels = [const { Vec::new() }; LEVELS + 1];
        levels[0] = footprints.map(|footprint| footprint.map(start)).collect();
        for level in 1..=LEVELS {
            let (below, above) = (extent(size, level - 1), extent(size, level));
            levels[level] = (0..above[0] * above[1])
                .map(|k| {
                    let parts = parts(k % above[0], k / above[0], below);
                    parts.filter_map(|k| levels[level - 1][k]).reduce(Start::with)
                })
                .collect();
        }
        Self { size, levels }
    }
}

/// Tiles of a level along both axes.
fn extent(size: [usize; 2], level: usize) -> [usize; 2] {
    size.map(|size| size.div_ceil(PART.pow(level as u32)))
}

/// Indices of a tile's parts in the level below, which has `below` tiles.
fn parts(x: usize, y: usize, below: [usize; 2]) -> impl Iterator<Item = usize> {
    let span = move |k: usize, axis: usize| k * PART..((k + 1) * PART).min(below[axis]);
    span(y, 1).flat_map(move |y| span(x, 0).map(move |x| y * below[0] + x))
}

impl Start {
    fn with(self, other: Self) -> Self {
        let plane = match (self.plane, other.plane) {
            // Normals of triangles in one plane differ by their rounding: 2u per axis.
            (Some((normal, height)), Some((same, other)))
                if (normal - same).abs().max_element() <= f32::EPSILON =>
            {
                Some((normal, height.min(other)))
            }
            _ => None,
        };
        Self { low: self.low.min(other.low), high: self.high.max(other.high), plane }
    }

    fn shaft<E: Emitter>(&self, emitter: &E, world: &World) -> Shaft {
        let shaft = emitter.shaft([self.low, self.high], world.bounds());
        match self.plane {
            Some((normal, height)) => shaft.above(normal, height),
            None => shaft,
        }
    }
}

impl<E: Emitter> Search<'_, E> {
    /// Marks the texels from which all of the emitter is seen, a row a texel; those that `asked` does not want may be left out.
    pub fn run(&self, clear: &mut [bool], asked: impl Fn(usize) -> bool + Copy) {
        let top = extent(self.tiles.size, LEVELS);
        let mut lists = [const { Vec::new() }; LEVELS];
        for k in 0..top[0] * top[1] {
            self.visit(LEVELS, [k % top[0], k / top[0]], None, &mut lists, clear, asked);
        }
    }

    /// `among`: the triangles that reach into the tile above, where they are few.
    fn visit(
        &self,
        level: usize,
        [x, y]: [usize; 2],
        among: Option<&mut Vec<u32>>,
        lists: &mut [Vec<u32>],
        clear: &mut [bool],
        asked: impl Fn(usize) -> bool + Copy,
    ) {
        let size = extent(self.tiles.size, level);
        let at = y * size[0] + x;
        let Some(start) = &self.tiles.levels[level][at] else { return };
        if level == 0 {
            // What stood in a neighbour's way is asked first.
            let Some(among) = among.filter(|_| asked(at)) else { return };
            let shaft = start.shaft(self.emitter, self.world);
            let first = among.iter().position(|&t| !shaft.misses(&self.world.corners(t)));
            match first {
                Some(first) => among.swap(0, first),
                None => clear[at] = true,
            }
            return;
        }
        let shaft = start.shaft(self.emitter, self.world);
        let (own, lists) = lists.split_last_mut().expect("a list for each level");
        own.clear();
        let few = match among {
            Some(among) => {
                own.extend(among.iter().filter(|&&t| !shaft.misses(&self.world.corners(t))));
                true
            }
            None => self.world.reaching_into(&shaft, MOST, own),
        };
        let below = extent(self.tiles.size, level - 1);
        if few && own.is_empty() {
            self.mark(level, [x, y], clear);
            return;
        }
        for part in parts(x, y, below) {
            let among = few.then_some(&mut *own);
            self.visit(level - 1, [part % below[0], part / below[0]], among, lists, clear, asked);
        }
    }

    /// Marks all texels of a tile.
    fn mark(&self, level: usize, [x, y]: [usize; 2], clear: &mut [bool]) {
        let side = PART.pow(level as u32);
        let [width, height] = self.tiles.size;
        for row in y * side..((y + 1) * side).min(height) {
            clear[row * width + x * side..row * width + ((x + 1) * side).min(width)].fill(true);
        }
    }
}
