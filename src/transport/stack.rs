//! What a traversal has still to visit.

use super::collapse::STACK;
use std::mem::MaybeUninit;

/// Nodes still to be visited with the distance where the ray enters them, the nearest on top.
pub(super) struct Stack {
    entries: [MaybeUninit<(u32, f32)>; STACK],
    depth: usize,
}

impl Stack {
    #[inline(always)]
    pub fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], depth: 0 }
    }

    /// Number of entries.
    #[inline(always)]
    pub fn depth(&self) -> usize {
        self.depth
    }

    #[inline(always)]
    fn at(&mut self, slot: usize) -> &mut MaybeUninit<(u32, f32)> {
        debug_assert!(slot < STACK);
        // SAFETY: a tree has so few levels that there are never more entries, see `STACK`.
        unsafe { self.entries.get_unchecked_mut(slot) }
    }

    /// Puts an entry on top.
    #[inline(always)]
    pub fn push(&mut self, node: u32, enters: f32) {
        let slot = self.depth;
        self.at(slot).write((node, enters));
        self.depth += 1;
    }

    /// Puts an entry below the nearer ones of those above `base`.
    #[inline(always)]
    pub fn insert(&mut self, base: usize, node: u32, enters: f32) {
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
        self.at(slot).write((node, enters));
        self.depth += 1;
    }

    /// The top entry that the ray enters no later than `t_max`.
    #[inline(always)]
    pub fn pop(&mut self, t_max: f32) -> Option<u32> {
        while self.depth > 0 {
            self.depth -= 1;
            let slot = self.depth;
            // SAFETY: below the old depth, so written.
            let (node, enters) = unsafe { self.at(slot).assume_init() };
            if enters <= t_max {
                return Some(node);
            }
        }
        None
    }
}
