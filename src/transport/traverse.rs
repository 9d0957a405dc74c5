//! Walking the tree, nearest child first.

use super::lanes::{Lanes, Portable};
use super::shear::{Meeting, Reach, Sheared, Slabs};
use super::tree::{ASK_BIT, LEAF_BIT, Leaf, Node, STACK, Tree, WIDTH};
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

/// Which wide instructions a tree is walked with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Processor {
    #[default]
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Processor {
    /// The best this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
        {
            return Self::Avx2;
        }
        Self::Portable
    }
}

impl Tree {
    /// The nearest hit at `t_min` or beyond that blocks.
    pub fn closest(&self, ray: &Ray, t_min: f32, mut question: impl Question) -> Option<Hit> {
        match self.processor {
            Processor::Portable => closest::<Portable, _>(self, ray, t_min, &mut question),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: detected.
            Processor::Avx2 => unsafe { avx2::closest(self, ray, t_min, &mut question) },
        }
    }

    /// Whether anything blocks.
    pub fn any(&self, ray: &Ray, mut question: impl Question) -> bool {
        match self.processor {
            Processor::Portable => any::<Portable, _>(self, ray, &mut question),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: detected.
            Processor::Avx2 => unsafe { avx2::any(self, ray, &mut question) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::super::lanes::Avx2;
    use super::{Hit, Question, Ray, Tree};

    #[target_feature(enable = "avx2,fma,bmi1")]
    pub unsafe fn closest<Q: Question>(tree: &Tree, ray: &Ray, t_min: f32, question: &mut Q) -> Option<Hit> {
        super::closest::<Avx2, Q>(tree, ray, t_min, question)
    }

    #[target_feature(enable = "avx2,fma,bmi1")]
    pub unsafe fn any<Q: Question>(tree: &Tree, ray: &Ray, question: &mut Q) -> bool {
        super::any::<Avx2, Q>(tree, ray, question)
    }
}

/// Children still to be visited with the distance where the ray enters them, the nearest on top.
struct Stack {
    entries: [MaybeUninit<(u32, f32)>; STACK],
    depth: usize,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], depth: 0 }
    }

    #[inline(always)]
    fn at(&mut self, slot: usize) -> &mut MaybeUninit<(u32, f32)> {
        debug_assert!(slot < STACK);
        // SAFETY: a tree has at most MOST_LEVELS levels of at most WIDTH - 1 waiting siblings each, see `STACK`.
        unsafe { self.entries.get_unchecked_mut(slot) }
    }

    #[inline(always)]
    fn push(&mut self, child: u32, enters: f32) {
        let slot = self.depth;
        self.at(slot).write((child, enters));
        self.depth += 1;
    }

    /// Puts an entry below the nearer ones of those above `base`.
    #[inline(always)]
    fn insert(&mut self, base: usize, child: u32, enters: f32) {
        let mut slot = self.depth;
        while slot > base {
            // SAFETY: below the depth, so written.
            let below = unsafe { self.at(slot - 1).assume_init() };
            if below.1 >= enters {
                break;
            }
            self.at(slot).write(below);
            slot -= 1;
        }
        self.at(slot).write((child, enters));
        self.depth += 1;
    }

    /// The nearest entry that the ray enters no later than `t_max`.
    #[inline(always)]
    fn pop(&mut self, t_max: f32) -> Option<u32> {
        while self.depth > 0 {
            self.depth -= 1;
            let slot = self.depth;
            // SAFETY: below the old depth, so written.
            let (child, enters) = unsafe { self.at(slot).assume_init() };
            if enters <= t_max {
                return Some(child);
            }
        }
        None
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
    // SAFETY: the tree's children are its own nodes, checked when it was made.
    unsafe { tree.nodes.get_unchecked(child as usize) }
}

#[inline(always)]
fn lowest(mask: &mut u32) -> usize {
    let k = mask.trailing_zeros() as usize % WIDTH;
    *mask &= *mask - 1;
    k
}

/// The nearest so far.
struct Nearest<'a, L, Q> {
    ray: Sheared,
    lanes: L,
    question: &'a mut Q,
    t_min: f32,
    t_max: f32,
    best: Option<Meeting>,
}

impl<L: Lanes, Q: Question> Nearest<'_, L, Q> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) {
        let (mut may, _) = self.lanes.triangles(leaf, &self.ray.reach(self.t_max));
        while may != 0 {
            let Some(meeting) = self.ray.meet(leaf, lowest(&mut may)) else { continue };
            let tie = || self.best.is_some_and(|best| meeting.triangle() < best.triangle());
            let nearer = meeting.t < self.t_max || (meeting.t == self.t_max && tie());
            if !nearer || meeting.t < self.t_min {
                continue;
            }
            let asks = Q::ASKS && meeting.id & ASK_BIT != 0;
            if !asks || self.question.blocks(&meeting.to_hit(&self.ray)) {
                self.t_max = meeting.t;
                self.best = Some(meeting);
            }
        }
    }
}

#[inline(always)]
fn closest<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, t_min: f32, question: &mut Q) -> Option<Hit> {
    let sheared = Sheared::new(ray)?;
    let boxes = L::boxes(&Slabs::new(ray, &sheared, tree));
    let lanes = L::new(&sheared);
    let mut nearest = Nearest { ray: sheared, lanes, question, t_min, t_max: ray.t_max, best: None };
    let mut stack = Stack::new();
    let mut current = 0;
    'walk: loop {
        while current & LEAF_BIT == 0 {
            let node = node_of(tree, current);
            let (mut mask, enters) = L::enter(&boxes, node, t_min, nearest.t_max);
            if mask == 0 {
                let Some(child) = stack.pop(nearest.t_max) else { break 'walk };
                current = child;
                continue;
            }
            let k = lowest(&mut mask);
            if mask == 0 {
                current = node.child[k];
                continue;
            }
            let (mut near, mut far) = (k, lowest(&mut mask));
            if enters[far] < enters[near] {
                (near, far) = (far, near);
            }
            L::prefetch(tree, node.child[near]);
            L::prefetch(tree, node.child[far]);
            let base = stack.depth;
            stack.push(node.child[far], enters[far]);
            if mask == 0 {
                current = node.child[near];
                continue;
            }
            stack.push(node.child[near], enters[near]);
            while mask != 0 {
                let k = lowest(&mut mask);
                L::prefetch(tree, node.child[k]);
                stack.insert(base, node.child[k], enters[k]);
            }
            current = stack.pop(f32::INFINITY).unwrap_or(LEAF_BIT);
        }
        nearest.leaf(tree.leaf(current));
        let Some(child) = stack.pop(nearest.t_max) else { break };
        current = child;
    }
    nearest.best.map(|meeting| meeting.to_hit(&sheared))
}

/// Looks for anything that blocks.
struct Any<'a, L, Q> {
    ray: Sheared,
    lanes: L,
    question: &'a mut Q,
    reach: Reach,
    t_max: f32,
}

impl<L: Lanes, Q: Question> Any<'_, L, Q> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        let (mut may, sure) = self.lanes.triangles(leaf, &self.reach);
        if !Q::ASKS && sure != 0 {
            return true;
        }
        while may != 0 {
            let lane = lowest(&mut may);
            if Q::ASKS && sure >> lane & 1 != 0 && leaf.id(lane) & ASK_BIT == 0 {
                return true;
            }
            let Some(meeting) = self.ray.meet(leaf, lane) else { continue };
            if meeting.t >= self.t_max {
                continue;
            }
            let asks = Q::ASKS && meeting.id & ASK_BIT != 0;
            if !asks || self.question.blocks(&meeting.to_hit(&self.ray)) {
                return true;
            }
        }
        false
    }
}

#[inline(always)]
fn any<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, question: &mut Q) -> bool {
    let Some(sheared) = Sheared::new(ray) else { return false };
    let boxes = L::boxes(&Slabs::new(ray, &sheared, tree));
    let lanes = L::new(&sheared);
    let mut any = Any { ray: sheared, lanes, question, reach: sheared.reach(ray.t_max), t_max: ray.t_max };
    let mut stack = Stack::new();
    let mut current = 0;
    loop {
        while current & LEAF_BIT == 0 {
            let node = node_of(tree, current);
            let (mut mask, _) = L::enter(&boxes, node, 0.0, ray.t_max);
            if mask == 0 {
                let Some(child) = stack.pop(f32::INFINITY) else { return false };
                current = child;
                continue;
            }
            let first = lowest(&mut mask);
            while mask != 0 {
                let k = lowest(&mut mask);
                L::prefetch(tree, node.child[k]);
                stack.push(node.child[k], 0.0);
            }
            current = node.child[first];
        }
        if any.leaf(tree.leaf(current)) {
            return true;
        }
        let Some(child) = stack.pop(f32::INFINITY) else { return false };
        current = child;
    }
}
