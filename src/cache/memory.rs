//! Cache-line aligned memory that costs nothing until it is touched.
#![allow(unsafe_code)]

use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::ptr::NonNull;

/// Bytes of a cache line, the unit in which blocks are placed.
pub(super) const LINE: usize = 64;

/// Bytes of a large page. What asks for several starts at one: the memory before the first would become resident by
/// small ones, 475 page faults of trex's first frame.
const HUGE_PAGE: usize = 2 << 20;

/// Large pages that memory has room for if it asks for them: fewer might make much more memory resident than is used.
const LEAST_HUGE_PAGES: usize = 8;

/// Lines that hold `bytes` bytes.
pub(super) const fn lines_for(bytes: usize) -> usize {
    bytes.div_ceil(LINE)
}

/// What a line is aligned to.
#[repr(align(64))]
struct Aligned;

/// Zeroed lines owned by this value and reached through raw pointers only, so that parts of it can be lent out
/// separately.
pub(super) struct Memory {
    allocation: Option<(NonNull<u8>, Layout)>,
    first_line: NonNull<u8>,
}

// SAFETY: the memory belongs to this value alone; what is read or written through `start` and `line` is argued for by
// their callers.
unsafe impl Send for Memory {}
// SAFETY: as above; `&Memory` only gives out a pointer.
unsafe impl Sync for Memory {}

impl Memory {
    /// `lines` zeroed lines, or `None` if the system refuses.
    ///
    /// Asks for 16-byte alignment and aligns by hand: a larger alignment makes the allocator write the zeros itself,
    /// which would make every page resident at once.
    pub(super) fn zeroed(lines: usize) -> Option<Self> {
        if lines == 0 {
            return Some(Self::nothing());
        }
        let bytes = lines.checked_mul(LINE)?;
        let is_large = bytes >= LEAST_HUGE_PAGES * HUGE_PAGE;
        let align = if is_large { HUGE_PAGE } else { LINE };
        let layout = Layout::from_size_align(bytes.checked_add(align)?, 16).ok()?;
        // SAFETY: the size is not zero.
        let start = NonNull::new(unsafe { alloc_zeroed(layout) })?;
        // SAFETY: at most `align` - 1 bytes further, and the allocation has `align` bytes more than `lines` lines.
        let first_line = unsafe { start.add(start.align_offset(align)) };
        if is_large {
            prefer_huge_pages(first_line, bytes);
        }
        Some(Self { allocation: Some((start, layout)), first_line })
    }

    /// No line at all.
    pub(super) fn nothing() -> Self {
        Self { allocation: None, first_line: NonNull::<[Aligned; 0]>::dangling().cast() }
    }

    /// Whether an address lies in the allocation.
    pub(super) fn holds(&self, address: usize) -> bool {
        self.allocation
            .is_some_and(|(start, layout)| (start.addr().get()..start.addr().get() + layout.size()).contains(&address))
    }

    /// The address of the first line, 64-byte aligned even if there is none.
    #[inline(always)]
    pub(super) fn start(&self) -> *mut u8 {
        self.first_line.as_ptr()
    }

    /// The address of line `idx`, 64-byte aligned.
    ///
    /// # Safety
    /// `idx` is less than the number of lines.
    #[inline(always)]
    pub(super) unsafe fn line(&self, idx: usize) -> *mut u8 {
        // SAFETY: inside the allocation by the caller's promise.
        unsafe { self.start().add(idx * LINE) }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if let Some((start, layout)) = self.allocation {
            // SAFETY: allocated by `zeroed` with this layout, freed once.
            unsafe { dealloc(start.as_ptr(), layout) }
        }
    }
}

/// Asks for large pages, so that random blocks miss the TLB less often. A refusal changes nothing but speed.
#[cfg(all(target_os = "linux", not(miri)))]
fn prefer_huge_pages(start: NonNull<u8>, bytes: usize) {
    // SAFETY: whole pages inside our allocation; the advice does not change their contents.
    unsafe { libc::madvise(start.as_ptr().cast(), bytes / HUGE_PAGE * HUGE_PAGE, libc::MADV_HUGEPAGE) };
}

#[cfg(not(all(target_os = "linux", not(miri))))]
fn prefer_huge_pages(_start: NonNull<u8>, _bytes: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_aligned_and_zero() {
        let memory = Memory::zeroed(100).unwrap();
        for idx in 0..100 {
            // SAFETY: idx < 100, nobody else knows the memory.
            let line = unsafe { std::slice::from_raw_parts(memory.line(idx), LINE) };
            assert_eq!(line.as_ptr().align_offset(LINE), 0);
            assert!(line.iter().all(|&b| b == 0));
        }
    }

    #[test]
    fn large_memory_starts_at_a_large_page() {
        let lines = lines_for(LEAST_HUGE_PAGES * HUGE_PAGE);
        let memory = Memory::zeroed(lines).unwrap();
        assert_eq!(memory.start().align_offset(HUGE_PAGE), 0);
        for idx in [0, lines - 1] {
            // SAFETY: idx < lines, nobody else knows the memory.
            let line = unsafe { std::slice::from_raw_parts(memory.line(idx), LINE) };
            assert!(line.iter().all(|&b| b == 0));
        }
        assert!(memory.holds(memory.start().addr()) && Memory::nothing().start().align_offset(LINE) == 0);
    }

    #[test]
    fn impossible_sizes_are_refused() {
        assert!(Memory::zeroed(usize::MAX).is_none());
        assert!(Memory::zeroed(usize::MAX / LINE).is_none());
    }
}
