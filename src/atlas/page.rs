//! One page that charts are laid on, one after the other, never to move again: into the hole or onto the skyline
//! where they lie lowest. The skyline fits the lower outline of a chart to the upper outline of what lies there
//! (Lévy, Petitjean, Ray, Maillot 2002); holes below it are found in a bitmap, for the chart's box.

use super::coverage::{Cover, fill};

/// Where a chart was laid: its box's first texel and how often it was turned by 90°.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Spot {
    pub x: u16,
    pub y: u16,
    pub turns: u8,
}

/// A chart's lower and upper outline, seen along its columns.
struct Outline {
    turns: u8,
    size: [usize; 2],
    /// First and last touched texel of each column; `None` for a full box.
    columns: Option<Vec<[i16; 2]>>,
}

/// What lies on a page so far.
#[derive(Clone, Debug)]
pub(super) struct Page {
    size: usize,
    gutter: usize,
    stride: usize,
    /// First free row of each column, gutter included.
    skyline: Vec<i16>,
    /// Texels that charts and their gutters take, a bit each.
    taken: Vec<u64>,
    /// Rows before this one have no hole for a box of this size: boxes come in groups of equal size.
    hint: Vec<([usize; 2], usize)>,
    /// Reused.
    lift: Vec<i16>,
    ladder: Vec<i16>,
    free: Vec<u64>,
    row_free: Vec<u64>,
}

/// Remembered hole searches.
const HINTS: usize = 8;

impl Page {
    /// An empty page.
    pub fn new(size: u16, gutter: u16) -> Self {
        let (size, gutter) = (usize::from(size), usize::from(gutter));
        let stride = size.div_ceil(64);
        Self {
            size,
            gutter,
            stride,
            skyline: vec![0; size],
            taken: vec![0; stride * size],
            hint: Vec::new(),
            lift: vec![0; size],
            ladder: vec![0; size],
            free: vec![0; stride],
            row_free: vec![0; stride],
        }
    }

    /// Lays a chart down, or says that it does not fit.
    pub fn lay(&mut self, cover: &Cover) -> Option<Spot> {
        let outlines = outlines(cover);
        let mut best: Option<((usize, i32, usize), Spot, &Outline)> = None;
        for outline in &outlines {
            if let Some((top, waste, x, y)) = self.on_skyline(outline) {
                let key = (top, waste, x);
                if best.as_ref().is_none_or(|(known, ..)| key < *known) {
                    best = Some((key, Spot { x: x as u16, y: y as u16, turns: outline.turns }, outline));
                }
            }
        }
        let below = best.as_ref().map_or(self.size, |(_, spot, _)| usize::from(spot.y));
        let mut hole: Option<(Spot, &Outline)> = None;
        for outline in outlines.iter().filter(|outline| outline.turns < 2) {
            let limit = hole.as_ref().map_or(below, |(spot, _)| usize::from(spot.y));
            if let Some((x, y)) = self.in_hole(outline.size, limit) {
                hole = Some((Spot { x: x as u16, y: y as u16, turns: outline.turns }, outline));
            }
        }
        let (spot, outline) = hole.or(best.map(|(_, spot, outline)| (spot, outline)))?;
        self.take(cover, spot, outline);
        Some(spot)
    }

    /// The lowest place on the skyline: the row after its end, the texels lost below, column and row.
    fn on_skyline(&mut self, outline: &Outline) -> Option<(usize, i32, usize, usize)> {
        let [w, h] = outline.size;
        if w > self.size || h > self.size {
            return None;
        }
        let places = self.size - w + 1;
        let lift = &mut self.lift[..places];
        match &outline.columns {
            None => slide_max(&self.skyline, w, lift, &mut self.ladder),
            Some(columns) => {
                lift.fill(0);
                for (i, &[bottom, _]) in columns.iter().enumerate() {
                    let under = &self.skyline[i..i + places];
                    lift.iter_mut().zip(under).for_each(|(y, &s)| *y = (*y).max(s - bottom));
                }
            }
        }
        let lowest = *lift.iter().min()?;
        if lowest as usize + h > self.size {
            return None;
        }
        let bottoms: i32 =
            outline.columns.as_ref().map_or(0, |columns| columns.iter().map(|&[b, _]| i32::from(b)).sum());
        let ground = |x: usize| -> i32 { self.skyline[x..x + w].iter().map(|&s| i32::from(s)).sum() };
        let mut best = (i32::MAX, 0);
        let mut under: i32 = ground(0);
        for x in 0..places {
            if x > 0 {
                under += i32::from(self.skyline[x + w - 1]) - i32::from(self.skyline[x - 1]);
            }
            if self.lift[x] == lowest {
                let waste = w as i32 * i32::from(lowest) + bottoms - under;
                if waste < best.0 {
                    best = (waste, x);
                }
            }
        }
        Some((lowest as usize + h, best.0, best.1, lowest as usize))
    }

    /// The lowest free box that begins before row `limit`.
    fn in_hole(&mut self, size: [usize; 2], limit: usize) -> Option<(usize, usize)> {
        let [w, h] = size;
        if w > self.size || h > self.size {
            return None;
        }
        let known = self.hint.iter().position(|&(of, _)| of == size);
        let from = known.map_or(0, |n| self.hint[n].1);
        let limit = limit.min(self.size - h + 1);
        let stride = self.stride;
        let mut found = None;
        let mut y = from;
        let (all, row_bits) = (&mut self.free, &mut self.row_free);
        while y < limit && found.is_none() {
            all.fill(u64::MAX);
            let mut next = y + h;
            // From the far row backwards: where it blocks everything, nothing before it can do either.
            for row in (y..y + h).rev() {
                runs(&self.taken[row * stride..(row + 1) * stride], self.size, w, row_bits);
                if row_bits.iter().all(|&word| word == 0) {
                    next = row + 1;
                    all.fill(0);
                    break;
                }
                let mut any = 0;
                for (a, &b) in all.iter_mut().zip(row_bits.iter()) {
                    *a &= b;
                    any |= *a;
                }
                if any == 0 {
                    next = y + 1;
                    break;
                }
            }
            match all.iter().position(|&word| word != 0) {
                Some(n) => found = Some((n * 64 + all[n].trailing_zeros() as usize, y)),
                None => y = next,
            }
        }
        match known {
            Some(n) => self.hint[n].1 = y,
            None => {
                if self.hint.len() == HINTS {
                    self.hint.remove(0);
                }
                self.hint.push((size, y));
            }
        }
        found
    }

    /// Marks a chart and its gutter.
    fn take(&mut self, cover: &Cover, spot: Spot, outline: &Outline) {
        let (x0, y0, g) = (usize::from(spot.x), usize::from(spot.y), self.gutter);
        let [w, h] = outline.size;
        for i in 0..w {
            let top = outline.columns.as_ref().map_or(h - 1, |columns| columns[i][1] as usize);
            let roof = (y0 + top + 1 + g) as i16;
            let from = (x0 + i).saturating_sub(g);
            let to = (x0 + i + g).min(self.size - 1);
            self.skyline[from..=to].iter_mut().for_each(|s| *s = (*s).max(roof));
        }
        let stride = self.stride;
        let mark = |taken: &mut [u64], y: usize, from: usize, to: usize, size: usize| {
            let (from, to) = (from.saturating_sub(g), (to + g).min(size - 1));
            for row in y.saturating_sub(g)..=(y + g).min(size - 1) {
                fill(&mut taken[row * stride..(row + 1) * stride], from, to);
            }
        };
        match &cover.mask {
            None => {
                let (from, to) = (x0.saturating_sub(g), (x0 + w - 1 + g).min(self.size - 1));
                for row in y0.saturating_sub(g)..=(y0 + h - 1 + g).min(self.size - 1) {
                    fill(&mut self.taken[row * stride..(row + 1) * stride], from, to);
                }
            }
            Some(mask) => {
                let [cw, ch] = cover.size.map(usize::from);
                for y in 0..ch {
                    each_run(&mask.bits[y * mask.stride..(y + 1) * mask.stride], cw, |from, to| {
                        match spot.turns {
                            0 => mark(&mut self.taken, y0 + y, x0 + from, x0 + to, self.size),
                            2 => mark(
                                &mut self.taken,
                                y0 + ch - 1 - y,
                                x0 + cw - 1 - to,
                                x0 + cw - 1 - from,
                                self.size,
                            ),
                            turns => {
                                for x in from..=to {
                                    let (tx, ty) = if turns == 1 { (ch - 1 - y, x) } else { (y, cw - 1 - x) };
                                    mark(&mut self.taken, y0 + ty, x0 + tx, x0 + tx, self.size);
                                }
                            }
                        }
                    });
                }
            }
        }
    }
}

/// A chart as it looks after each quarter turn worth trying.
fn outlines(cover: &Cover) -> Vec<Outline> {
    let [w, h] = cover.size.map(usize::from);
    let Some(mask) = &cover.mask else {
        let upright = Outline { turns: 0, size: [w, h], columns: None };
        let turned = Outline { turns: 1, size: [h, w], columns: None };
        return if w == h { vec![upright] } else { vec![upright, turned] };
    };
    let back = |ranges: &[[i16; 2]], far: usize| -> Vec<[i16; 2]> {
        ranges.iter().map(|&[a, b]| [far as i16 - 1 - b, far as i16 - 1 - a]).collect()
    };
    let reversed = |mut ranges: Vec<[i16; 2]>| {
        ranges.reverse();
        ranges
    };
    let columns = [
        mask.columns.clone(),
        reversed(mask.rows.clone()),
        reversed(back(&mask.columns, h)),
        back(&mask.rows, w),
    ];
    let turned = columns.into_iter().enumerate().map(|(turns, columns)| Outline {
        turns: turns as u8,
        size: if turns % 2 == 0 { [w, h] } else { [h, w] },
        columns: Some(columns),
    });
    turned.collect()
}

/// `out[x] = max(skyline[x .. x + w])`, by doubling.
fn slide_max(skyline: &[i16], w: usize, out: &mut [i16], ladder: &mut [i16]) {
    ladder.copy_from_slice(skyline);
    let mut reach = 1;
    while reach * 2 <= w {
        for x in 0..skyline.len() - reach {
            ladder[x] = ladder[x].max(ladder[x + reach]);
        }
        reach *= 2;
    }
    for (x, y) in out.iter_mut().enumerate() {
        *y = ladder[x].max(ladder[x + w - reach]);
    }
}

/// Sets bit x where texels `x .. x + w` of the row are all free and on the page.
fn runs(taken: &[u64], size: usize, w: usize, free: &mut [u64]) {
    for (f, &t) in free.iter_mut().zip(taken) {
        *f = !t;
    }
    if size % 64 != 0 {
        free[size / 64] &= u64::MAX >> (64 - size % 64);
    }
    let mut reach = 1;
    while reach < w {
        let step = reach.min(w - reach);
        let (words, bits) = (step / 64, step % 64);
        let mut any = 0;
        for n in 0..free.len() {
            let near = free.get(n + words).copied().unwrap_or(0);
            let far = free.get(n + words + 1).copied().unwrap_or(0);
            let shifted = if bits == 0 { near } else { near >> bits | far << (64 - bits) };
            free[n] &= shifted;
            any |= free[n];
        }
        if any == 0 {
            return;
        }
        reach += step;
    }
}

/// Calls with the first and last bit of every run of set bits.
fn each_run(words: &[u64], width: usize, mut tell: impl FnMut(usize, usize)) {
    let set = |x: usize| words[x / 64] >> (x % 64) & 1 == 1;
    let mut x = 0;
    while x < width {
        if words[x / 64] >> (x % 64) == 0 {
            x = (x / 64 + 1) * 64;
            continue;
        }
        if !set(x) {
            x += (words[x / 64] >> (x % 64)).trailing_zeros() as usize;
            continue;
        }
        let from = x;
        while x < width && set(x) {
            x += 1;
        }
        tell(from, x - 1);
    }
}
