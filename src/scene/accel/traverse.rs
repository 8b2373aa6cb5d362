//! Rays through the wide tree.

use super::{LANES, LEAF, LeafRef, TopLevel, WideNode};
use crate::grid::LatticeRay;
use crate::ids::PatchId;
use crate::math::simd::Kernel;

/// The stack of a traversal, kept by each thread so that no ray allocates.
#[derive(Clone, Debug, Default)]
pub struct TraversalStack {
    entries: Vec<Entry>,
}

/// Something to visit: bits of the t of entry above, `LEAF | slot` or an inner node below. t >= 0, so entries are ordered by t.
type Entry = u64;

#[inline(always)]
fn entry(t: f32, target: u32) -> Entry {
    u64::from(t.to_bits()) << 32 | u64::from(target)
}

#[inline(always)]
fn t_of(entry: Entry) -> f32 {
    f32::from_bits((entry >> 32) as u32)
}

impl TopLevel {
    /// A walk along a ray, at its start.
    #[inline(always)]
    pub fn walk<'t>(&'t self, stack: &'t mut TraversalStack) -> Walk<'t> {
        let entries = stack.empty(self.stack_need);
        entries.push(entry(0.0, 0));
        Walk { tree: self, stack: entries }
    }

    /// Calls `visit` for the patches whose boxes the ray meets, the nearest of each node first, until the rest lie beyond
    /// `t_max`. It is given as [`LatticeRay::t_max`] and `visit` makes it smaller when it hits something.
    pub fn closest<K: Kernel>(
        &self,
        kernel: K,
        ray: &LatticeRay,
        stack: &mut TraversalStack,
        mut visit: impl FnMut(LeafRef, &mut f32),
    ) {
        let mut t_max = ray.t_max;
        let mut walk = self.walk(stack);
        while let Some(leaf) = walk.nearest(kernel, ray, t_max, |_| ()) {
            visit(leaf, &mut t_max);
        }
    }

    /// Calls `visit` for the patches whose boxes the ray meets, in any order, until it says `true`: then so does this.
    pub fn occluded<K: Kernel>(
        &self,
        kernel: K,
        ray: &LatticeRay,
        stack: &mut TraversalStack,
        mut visit: impl FnMut(LeafRef) -> bool,
    ) -> bool {
        let mut walk = self.walk(stack);
        while let Some(leaf) = walk.any(kernel, ray, |_| ()) {
            if visit(leaf) {
                return true;
            }
        }
        false
    }

    /// Pushes the lanes of `node` that the ray meets.
    #[inline(always)]
    fn push_children<K: Kernel>(
        &self,
        k: K,
        ray: &LatticeRay,
        t_max: f32,
        node: u32,
        stack: &mut Vec<Entry>,
        prefetch: &impl Fn(u32),
    ) {
        let wide = &self.nodes[node as usize];
        let (mut mask, t_near) = wide.test(k, ray, t_max);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let target = if wide.refs[lane] & LEAF != 0 {
                let slot = node * LANES as u32 + lane as u32;
                prefetch(slot);
                LEAF | slot
            } else {
                let inner = wide.refs[lane];
                let lines: *const [u8; 64] = (&raw const self.nodes[inner as usize]).cast();
                for line in 0..4 {
                    k.prefetch(lines.wrapping_add(line));
                }
                inner
            };
            stack.push(entry(t_near[lane], target));
        }
    }

    #[inline(always)]
    fn leaf(&self, target: u32) -> LeafRef {
        let slot = target & !LEAF;
        let reference = self.nodes[slot as usize / LANES].refs[slot as usize % LANES];
        LeafRef { slot, patch: PatchId(reference & !LEAF) }
    }
}

/// A ray's way through the tree, from leaf to leaf.
///
/// It hands out leaves instead of calling back: code with vector instructions in a closure would be compiled without them.
pub struct Walk<'t> {
    tree: &'t TopLevel,
    stack: &'t mut Vec<Entry>,
}

impl Walk<'_> {
    /// The next patch whose box the ray meets before `t_max`, the nearest of each node first. `prefetch` is called with a
    /// leaf's slot when the leaf is found, some time before it is handed out.
    #[inline(always)]
    pub fn nearest<K: Kernel>(
        &mut self,
        kernel: K,
        ray: &LatticeRay,
        t_max: f32,
        prefetch: impl Fn(u32),
    ) -> Option<LeafRef> {
        while let Some(current) = self.stack.pop() {
            let target = current as u32;
            if t_of(current) > t_max {
                continue;
            }
            if target & LEAF != 0 {
                return Some(self.tree.leaf(target));
            }
            let first = self.stack.len();
            self.tree.push_children(kernel, ray, t_max, target, self.stack, &prefetch);
            sort_descending(&mut self.stack[first..]);
        }
        None
    }

    /// The next patch whose box the ray meets, in any order.
    #[inline(always)]
    pub fn any<K: Kernel>(&mut self, kernel: K, ray: &LatticeRay, prefetch: impl Fn(u32)) -> Option<LeafRef> {
        while let Some(current) = self.stack.pop() {
            let target = current as u32;
            if target & LEAF != 0 {
                return Some(self.tree.leaf(target));
            }
            self.tree.push_children(kernel, ray, ray.t_max, target, self.stack, &prefetch);
        }
        None
    }
}

impl WideNode {
    /// The lanes that the ray meets between 0 and `t_max`, and where it enters them.
    #[inline(always)]
    fn test<K: Kernel>(&self, k: K, ray: &LatticeRay, t_max: f32) -> (u32, [f32; LANES]) {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(t_max));
        for axis in 0..3 {
            let inv = k.splat(ray.inv[axis]);
            let near = axis + 3 * ray.is_negative[axis];
            let far = axis + 3 * (1 - ray.is_negative[axis]);
            enter = k.max(self.plane_t(k, near, ray.near_origin[axis], inv), enter);
            leave = k.min(self.plane_t(k, far, ray.far_origin[axis], inv), leave);
        }
        (k.le(enter, leave), k.store(enter))
    }

    /// t of one plane of all lanes.
    #[inline(always)]
    fn plane_t<K: Kernel>(&self, k: K, plane: usize, origin: f32, inv: K::F) -> K::F {
        k.mul(k.sub(k.load(&self.planes[plane]), k.splat(origin)), inv)
    }
}

impl TraversalStack {
    /// The stack, empty, with room for `need` entries.
    #[inline(always)]
    fn empty(&mut self, need: usize) -> &mut Vec<Entry> {
        self.entries.clear();
        self.entries.reserve(need);
        &mut self.entries
    }
}

/// Insertion sort, greatest first: lists have eight entries at most, and one or two as a rule.
#[inline(always)]
fn sort_descending(entries: &mut [Entry]) {
    for i in 1..entries.len() {
        let moving = entries[i];
        let mut hole = i;
        while hole > 0 && entries[hole - 1] < moving {
            entries[hole] = entries[hole - 1];
            hole -= 1;
        }
        entries[hole] = moving;
    }
}
