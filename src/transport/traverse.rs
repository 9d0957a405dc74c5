//! Walking the tree, nearest child first.

#[cfg(target_arch = "x86_64")]
use super::lanes::Avx2;
use super::lanes::{Lanes, Portable, Processor};
use super::shear::{Meeting, Reach, Sheared, Slabs};
use super::stack::Stack;
use super::tree::{ASK_BIT, Block, LANES, Leaf, Node, TINY, Tree, WIDTH};
use super::{Hit, Ray};
use std::mem::MaybeUninit;

/// What a ray asks of triangles that may let it pass.
pub(super) trait Question {
    /// False when there are none to ask.
    const ASKS: bool;

    /// Whether the surface stops the ray here.
    fn blocks(&mut self, hit: &Hit) -> bool;
}

/// Every triangle blocks.
pub(super) struct Solid;

impl Question for Solid {
    const ASKS: bool = false;

    fn blocks(&mut self, _: &Hit) -> bool {
        true
    }
}

/// Asks a function.
pub(super) struct Ask<F>(pub F);

impl<F: FnMut(&Hit) -> bool> Question for Ask<F> {
    const ASKS: bool = true;

    fn blocks(&mut self, hit: &Hit) -> bool {
        (self.0)(hit)
    }
}

impl Tree {
    /// The nearest hit at `t_min` or beyond that blocks.
    pub fn closest(&self, ray: &Ray, t_min: f32, mut question: impl Question) -> Option<Hit> {
        match self.processor {
            Processor::Portable => closest::<Portable, _>(self, ray, t_min, &mut question),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: detected.
            Processor::Avx2 => unsafe { closest_avx2(self, ray, t_min, &mut question) },
        }
    }

    /// Whether anything blocks.
    pub fn any(&self, ray: &Ray, mut question: impl Question) -> bool {
        match self.processor {
            Processor::Portable => any::<Portable, _>(self, ray, &mut question),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: detected.
            Processor::Avx2 => unsafe { any_avx2(self, ray, &mut question) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1")]
unsafe fn closest_avx2<Q: Question>(tree: &Tree, ray: &Ray, t_min: f32, question: &mut Q) -> Option<Hit> {
    closest::<Avx2, Q>(tree, ray, t_min, question)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1")]
unsafe fn any_avx2<Q: Question>(tree: &Tree, ray: &Ray, question: &mut Q) -> bool {
    any::<Avx2, Q>(tree, ray, question)
}

#[inline(always)]
fn closest<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, t_min: f32, question: &mut Q) -> Option<Hit> {
    let sheared = Sheared::new(ray)?;
    let lanes = L::new(&sheared);
    let mut nearest = Nearest { ray: sheared, question, t_min, t_max: ray.t_max, best: None };
    if tree.nodes.is_empty() {
        nearest.meet_any(tree.tiny(), full_blocks(&lanes, tree.tiny(), &sheared.reach(ray.t_max)).0);
        return nearest.best.map(|meeting| meeting.to_hit(&sheared));
    }
    let boxes = L::boxes(&Slabs::new(ray));
    let mut stack = Stack::new();
    let mut current = 0;
    loop {
        let node = node_of(tree, current);
        let (mask, enters) = L::enter(&boxes, node, t_min, nearest.t_max);
        let (mut leaves, mut inner) = (mask & node.leaves, mask & !node.leaves);
        let base = stack.depth();
        while inner != 0 {
            let k = lowest(&mut inner);
            L::prefetch(node_of(tree, node.child[k]));
            stack.insert(base, node.child[k], enters[k]);
        }
        // All the wide tests first, so that they need not wait for the distances found.
        let reach = sheared.reach(nearest.t_max);
        let (mut queue, mut queued) = ([const { MaybeUninit::uninit() }; WIDTH], 0);
        while leaves != 0 {
            let k = lowest(&mut leaves);
            let (may, _) = blocks(&lanes, tree.leaf(node, k), &reach);
            queue[queued % WIDTH].write((k, may));
            queued += usize::from(may != 0);
        }
        for entry in &queue[..queued] {
            // SAFETY: written above.
            let (k, may) = unsafe { entry.assume_init() };
            nearest.meet_any(tree.leaf(node, k), may);
        }
        let Some(child) = stack.pop(nearest.t_max) else { break };
        current = child;
    }
    nearest.best.map(|meeting| meeting.to_hit(&sheared))
}

#[inline(always)]
fn any<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, question: &mut Q) -> bool {
    let Some(sheared) = Sheared::new(ray) else { return false };
    let lanes = L::new(&sheared);
    let reach = sheared.reach(ray.t_max);
    let mut first = First { ray: sheared, question, t_max: ray.t_max };
    if tree.nodes.is_empty() {
        let (may, sure) = full_blocks(&lanes, tree.tiny(), &reach);
        return (!Q::ASKS && sure != 0) || first.is_among(tree.tiny(), may, sure);
    }
    let boxes = L::boxes(&Slabs::new(ray));
    let mut stack = Stack::new();
    let mut current = 0;
    loop {
        let node = node_of(tree, current);
        let (mask, _) = L::enter(&boxes, node, 0.0, ray.t_max);
        let (mut leaves, mut inner) = (mask & node.leaves, mask & !node.leaves);
        while inner != 0 {
            let k = lowest(&mut inner);
            L::prefetch(node_of(tree, node.child[k]));
            stack.push(node.child[k], 0.0);
        }
        let (mut queue, mut queued) = ([const { MaybeUninit::uninit() }; WIDTH], 0);
        while leaves != 0 {
            let k = lowest(&mut leaves);
            let (may, sure) = blocks(&lanes, tree.leaf(node, k), &reach);
            if !Q::ASKS && sure != 0 {
                return true;
            }
            queue[queued % WIDTH].write((k, may, sure));
            queued += usize::from(may != 0);
        }
        for entry in &queue[..queued] {
            // SAFETY: written above.
            let (k, may, sure) = unsafe { entry.assume_init() };
            if first.is_among(tree.leaf(node, k), may, sure) {
                return true;
            }
        }
        let Some(child) = stack.pop(f32::INFINITY) else { return false };
        current = child;
    }
}

/// The wide tests of a leaf: the masks of [`Lanes::triangles`].
#[inline(always)]
fn blocks<L: Lanes>(lanes: &L, leaf: Leaf, reach: &Reach) -> (u32, u32) {
    let (mut may, mut sure) = (0, 0);
    for start in (0..leaf.count()).step_by(LANES) {
        let found = lanes.triangles(leaf.block(start), reach);
        may |= found.0 << start;
        sure |= found.1 << start;
    }
    (may, sure)
}

/// The same where all blocks are full.
#[inline(always)]
fn full_blocks<L: Lanes>(lanes: &L, leaf: Leaf, reach: &Reach) -> (u64, u64) {
    const { assert!(TINY <= 64) };
    let (mut may, mut sure) = (0, 0);
    for start in (0..leaf.count()).step_by(LANES) {
        let found = lanes.triangles(leaf.full_block(start), reach);
        may |= u64::from(found.0) << start;
        sure |= u64::from(found.1) << start;
    }
    (may, sure)
}

/// The nearest so far.
struct Nearest<'a, Q> {
    ray: Sheared,
    question: &'a mut Q,
    t_min: f32,
    t_max: f32,
    best: Option<Meeting>,
}

impl<Q: Question> Nearest<'_, Q> {
    /// Tries the triangles of a mask.
    #[inline(always)]
    fn meet_any(&mut self, leaf: Leaf, may: impl Into<u64>) {
        let mut may = may.into();
        while may != 0 {
            let k = may.trailing_zeros() as usize;
            may &= may - 1;
            self.meet(leaf.block(k / LANES * LANES), k % LANES);
        }
    }

    #[inline(always)]
    fn meet(&mut self, block: Block, lane: usize) {
        let Some(meeting) = self.ray.meet(block, lane) else { return };
        let tie = || self.best.is_some_and(|best| meeting.triangle() < best.triangle());
        let nearer = meeting.t < self.t_max || (meeting.t == self.t_max && tie());
        if !nearer || meeting.t < self.t_min {
            return;
        }
        let asks = Q::ASKS && meeting.id & ASK_BIT != 0;
        if !asks || self.question.blocks(&meeting.to_hit(&self.ray)) {
            self.t_max = meeting.t;
            self.best = Some(meeting);
        }
    }
}

/// Whether there is a first.
struct First<'a, Q> {
    ray: Sheared,
    question: &'a mut Q,
    t_max: f32,
}

impl<Q: Question> First<'_, Q> {
    /// Tries the triangles of a mask; those of `sure` are met if they need not be asked.
    #[inline(always)]
    fn is_among(&mut self, leaf: Leaf, may: impl Into<u64>, sure: impl Into<u64>) -> bool {
        let (mut may, sure) = (may.into(), sure.into());
        while may != 0 {
            let k = may.trailing_zeros() as usize;
            may &= may - 1;
            if self.blocks(leaf.block(k / LANES * LANES), k % LANES, sure >> k & 1 != 0) {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn blocks(&mut self, block: Block, lane: usize, sure: bool) -> bool {
        let asks = Q::ASKS && block.id(lane) & ASK_BIT != 0;
        if Q::ASKS && sure && !asks {
            return true;
        }
        let Some(meeting) = self.ray.meet(block, lane) else { return false };
        meeting.t < self.t_max && (!asks || self.question.blocks(&meeting.to_hit(&self.ray)))
    }
}

impl Meeting {
    /// Divides the weights.
    #[inline(always)]
    pub fn to_hit(self, ray: &Sheared) -> Hit {
        Hit {
            t: self.t,
            triangle: self.triangle(),
            u: (self.v / self.area) as f32,
            v: (self.w / self.area) as f32,
            front: (self.area > 0.0) == (ray.z < 0.0),
        }
    }

    #[inline(always)]
    fn triangle(self) -> u32 {
        self.id & !ASK_BIT
    }
}

#[inline(always)]
fn node_of(tree: &Tree, child: u32) -> &Node {
    debug_assert!((child as usize) < tree.nodes.len());
    // SAFETY: the tree's children are its own nodes.
    unsafe { tree.nodes.get_unchecked(child as usize) }
}

#[inline(always)]
fn lowest(mask: &mut u32) -> usize {
    let k = mask.trailing_zeros() as usize % WIDTH;
    *mask &= *mask - 1;
    k
}
