//! Walking the tree, nearest child first.

use super::lanes::{Lanes, Portable};
use super::shear::Sheared;
use super::tree::{ASK_BIT, LEAF_BIT, STACK, Tree};
use super::{Hit, Ray};

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
        closest::<Portable, _>(self, ray, t_min, &mut question)
    }

    /// Whether anything blocks.
    pub fn any(&self, ray: &Ray, mut question: impl Question) -> bool {
        any::<Portable, _>(self, ray, &mut question)
    }
}

#[inline(always)]
fn closest<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, t_min: f32, question: &mut Q) -> Option<Hit> {
    let sheared = Sheared::new(ray, tree)?;
    let lanes = L::new(&sheared);
    let mut best: Option<Hit> = None;
    let mut t_max = ray.t_max;
    let mut stack = [(0u32, 0f32); STACK];
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (child, enters) = stack[depth];
        if enters > t_max {
            continue;
        }
        if child & LEAF_BIT == 0 {
            let node = &tree.nodes[child as usize];
            let (mut mask, first) = lanes.boxes(node, t_min, t_max);
            let base = depth;
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let mut slot = depth;
                while slot > base && stack[slot - 1].1 < first[k] {
                    stack[slot] = stack[slot - 1];
                    slot -= 1;
                }
                stack[slot] = (node.child[k], first[k]);
                depth += 1;
            }
            continue;
        }
        let start = ((child & !LEAF_BIT) >> 3) as usize;
        for block in &tree.blocks[start..start + (child & 7) as usize] {
            let mut mask = lanes.triangles(block);
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let Some(meeting) = sheared.meet(block, lane) else { continue };
                let id = block.id[lane];
                let triangle = id & !ASK_BIT;
                let nearer = meeting.t < t_max
                    || (meeting.t == t_max && best.is_some_and(|best| triangle < best.triangle));
                if !nearer || meeting.t < t_min {
                    continue;
                }
                let hit = Hit { t: meeting.t, triangle, u: meeting.u, v: meeting.v, front: meeting.front };
                if Q::ASKS && id & ASK_BIT != 0 && !question.blocks(&hit) {
                    continue;
                }
                t_max = hit.t;
                best = Some(hit);
            }
        }
    }
    best
}

#[inline(always)]
fn any<L: Lanes, Q: Question>(tree: &Tree, ray: &Ray, question: &mut Q) -> bool {
    let Some(sheared) = Sheared::new(ray, tree) else { return false };
    let lanes = L::new(&sheared);
    let mut stack = [0u32; STACK];
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let child = stack[depth];
        if child & LEAF_BIT == 0 {
            let node = &tree.nodes[child as usize];
            let (mut mask, _) = lanes.boxes(node, 0.0, ray.t_max);
            while mask != 0 {
                stack[depth] = node.child[mask.trailing_zeros() as usize];
                mask &= mask - 1;
                depth += 1;
            }
            continue;
        }
        let start = ((child & !LEAF_BIT) >> 3) as usize;
        for block in &tree.blocks[start..start + (child & 7) as usize] {
            let mut mask = lanes.triangles(block);
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let Some(meeting) = sheared.meet(block, lane) else { continue };
                if meeting.t >= ray.t_max {
                    continue;
                }
                let id = block.id[lane];
                let hit = Hit {
                    t: meeting.t,
                    triangle: id & !ASK_BIT,
                    u: meeting.u,
                    v: meeting.v,
                    front: meeting.front,
                };
                if !Q::ASKS || id & ASK_BIT == 0 || question.blocks(&hit) {
                    return true;
                }
            }
        }
    }
    false
}
