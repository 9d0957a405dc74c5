//! A slice on large memory pages, or at least on whole cache lines.
//!
//! A random walk through a tree of tens of megabytes misses the processor's table of small pages at nearly every
//! step. Where the system lets a program ask for large ones (Linux, `madvise`), large slices ask.

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ops::Deref;
use std::ptr::NonNull;

/// Bytes of a large page, x86-64 and most of Arm.
const LARGE_PAGE: usize = 2 << 20;

/// Bytes of a cache line, or a multiple.
const LINE: usize = 64;

/// An immutable slice, on large pages when it is large.
pub(super) struct Pages<T> {
    start: NonNull<T>,
    len: usize,
}

// SAFETY: it owns its items as a Box<[T]> does.
unsafe impl<T: Send> Send for Pages<T> {}
// SAFETY: only shared references are given out.
unsafe impl<T: Sync> Sync for Pages<T> {}

impl<T: Copy> Pages<T> {
    /// Copies the items.
    pub fn new(items: &[T]) -> Self {
        let layout = Self::layout(items.len());
        if layout.size() == 0 {
            return Self { start: NonNull::dangling(), len: items.len() };
        }
        // SAFETY: the layout is not empty; it has room for all items and their alignment.
        unsafe {
            let Some(start) = NonNull::new(alloc(layout).cast::<T>()) else { handle_alloc_error(layout) };
            if layout.align() == LARGE_PAGE {
                ask_for_large_pages(start.as_ptr().cast(), layout.size());
            }
            start.as_ptr().copy_from_nonoverlapping(items.as_ptr(), items.len());
            Self { start, len: items.len() }
        }
    }
}

impl<T> Pages<T> {
    fn layout(len: usize) -> Layout {
        let bytes = len * size_of::<T>();
        let large = bytes >= 2 * LARGE_PAGE;
        let (bytes, align) = if large {
            (bytes.next_multiple_of(LARGE_PAGE), LARGE_PAGE)
        } else {
            (bytes, align_of::<T>().max(LINE))
        };
        Layout::from_size_align(bytes, align).expect("items that exist in memory have a lawful size")
    }
}

impl<T> Drop for Pages<T> {
    fn drop(&mut self) {
        let layout = Self::layout(self.len);
        if layout.size() > 0 {
            // SAFETY: allocated with this layout; `Copy` items need no drop.
            unsafe { dealloc(self.start.as_ptr().cast(), layout) }
        }
    }
}

impl<T> Deref for Pages<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: all `len` items were written.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T: Copy> Clone for Pages<T> {
    fn clone(&self) -> Self {
        Self::new(self)
    }
}

impl<T: Copy> Default for Pages<T> {
    fn default() -> Self {
        Self::new(&[])
    }
}

/// Only advice: whatever the system answers, the memory works.
#[cfg(target_os = "linux")]
fn ask_for_large_pages(start: *mut u8, bytes: usize) {
    unsafe extern "C" {
        fn madvise(start: *mut u8, bytes: usize, advice: i32) -> i32;
    }
    const MADV_HUGEPAGE: i32 = 14;
    // SAFETY: the range is one of our own allocations, aligned to pages.
    unsafe { madvise(start, bytes, MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn ask_for_large_pages(_: *mut u8, _: usize) {}
