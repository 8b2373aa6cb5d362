//! Rays through the wide tree.

use super::{LANES, LEAF, LeafRef, NodeBoxes, Refs, TopLevel};
use crate::grid::{LatticeRay, Plane};
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
        let entries = stack.of_size(self.stack_need + LANES);
        entries[0] = entry(0.0, 0);
        Walk { tree: self, stack: entries, n: 1 }
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

    #[inline(always)]
    fn node(&self, node: u32) -> (&NodeBoxes, &Refs) {
        (&self.nodes.boxes[node as usize], &self.nodes.refs[node as usize])
    }

    /// Asks for what a target leads to.
    #[inline(always)]
    fn prefetch<K: Kernel>(&self, k: K, target: u32, leaf: &impl Fn(u32)) {
        if target & LEAF != 0 {
            return leaf(target & !LEAF);
        }
        let lines: *const [u8; 64] = self.nodes.boxes.as_ptr().wrapping_add(target as usize).cast();
        for line in 0..size_of::<NodeBoxes>() / 64 {
            k.prefetch(lines.wrapping_add(line));
        }
        k.prefetch(self.nodes.refs.as_ptr().wrapping_add(target as usize));
    }

    /// What a lane of a node leads to.
    #[inline(always)]
    fn target(&self, node: u32, refs: &Refs, lane: usize) -> u32 {
        let reference = refs[lane % LANES];
        if reference & LEAF != 0 { LEAF | (node * LANES as u32 + lane as u32) } else { reference }
    }

    #[inline(always)]
    fn leaf(&self, target: u32) -> LeafRef {
        let slot = target & !LEAF;
        let reference = self.nodes.refs[slot as usize / LANES][slot as usize % LANES];
        LeafRef { slot, patch: PatchId(reference & !LEAF) }
    }
}

/// A ray's way through the tree, from leaf to leaf.
///
/// It hands out leaves instead of calling back: code with vector instructions in a closure would be compiled without them.
pub struct Walk<'t> {
    tree: &'t TopLevel,
    stack: &'t mut [Entry],
    /// Entries on the stack.
    n: usize,
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
        while self.n > 0 {
            self.n -= 1;
            let current = self.stack[self.n];
            if t_of(current) > t_max {
                continue;
            }
            let mut next = Some(current as u32);
            while let Some(target) = next {
                if target & LEAF != 0 {
                    return Some(self.tree.leaf(target));
                }
                next = self.descend(kernel, ray, t_max, target, &prefetch);
            }
        }
        None
    }

    /// The nearest child of a node that the ray meets; the others go onto the stack. Announces those others, and leaves.
    #[inline(always)]
    fn descend<K: Kernel>(
        &mut self,
        k: K,
        ray: &LatticeRay,
        t_max: f32,
        node: u32,
        prefetch: &impl Fn(u32),
    ) -> Option<u32> {
        let tree = self.tree;
        let (boxes, refs) = tree.node(node);
        let (mask, t_near) = boxes.test(k, ray, t_max);
        if mask == 0 {
            return None;
        }
        let target = |lane: usize| tree.target(node, refs, lane);
        let (lane, rest) = (mask.trailing_zeros() as usize % LANES, mask & (mask - 1));
        if rest == 0 {
            return Some(announced_leaf(target(lane), prefetch));
        }
        let t_near = k.store(t_near);
        let room: &mut [Entry; LANES] = self.stack[self.n..].first_chunk_mut().expect("room for a node's lanes");
        let (other, mut rest) = (rest.trailing_zeros() as usize % LANES, rest & (rest - 1));
        if rest == 0 {
            let (near, far) = if t_near[lane] <= t_near[other] { (lane, other) } else { (other, lane) };
            let far_target = target(far);
            tree.prefetch(k, far_target, prefetch);
            room[0] = entry(t_near[far], far_target);
            self.n += 1;
            return Some(announced_leaf(target(near), prefetch));
        }
        room[0] = entry(t_near[lane], target(lane));
        room[1] = entry(t_near[other], target(other));
        let mut n = 2;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize % LANES;
            rest &= rest - 1;
            room[n % LANES] = entry(t_near[lane], target(lane));
            n += 1;
        }
        sort_descending(&mut room[..n.min(LANES)]);
        for entry in &room[..(n - 1) % LANES] {
            tree.prefetch(k, *entry as u32, prefetch);
        }
        self.n += n - 1;
        Some(announced_leaf(room[(n - 1) % LANES] as u32, prefetch))
    }

    /// The next patch whose box the ray meets, in any order.
    #[inline(always)]
    pub fn any<K: Kernel>(&mut self, kernel: K, ray: &LatticeRay, prefetch: impl Fn(u32)) -> Option<LeafRef> {
        while self.n > 0 {
            self.n -= 1;
            let mut target = self.stack[self.n] as u32;
            while target & LEAF == 0 {
                let (boxes, refs) = self.tree.node(target);
                let (mut mask, _) = boxes.test(kernel, ray, ray.t_max);
                if mask == 0 {
                    break;
                }
                // The first child next, the others later.
                let node = target;
                target = self.tree.target(node, refs, mask.trailing_zeros() as usize % LANES);
                mask &= mask - 1;
                let room: &mut [Entry; LANES] =
                    self.stack[self.n..].first_chunk_mut().expect("room for a node's lanes");
                let mut n = 0;
                while mask != 0 {
                    let later = self.tree.target(node, refs, mask.trailing_zeros() as usize % LANES);
                    mask &= mask - 1;
                    self.tree.prefetch(kernel, later, &prefetch);
                    room[n % LANES] = entry(0.0, later);
                    n += 1;
                }
                self.n += n;
            }
            if target & LEAF != 0 {
                return Some(self.tree.leaf(target));
            }
        }
        None
    }
}

impl NodeBoxes {
    /// The lanes that the ray meets between 0 and `t_max`, and where it enters them.
    #[inline(always)]
    fn test<K: Kernel>(&self, k: K, ray: &LatticeRay, t_max: f32) -> (u32, K::F) {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(t_max));
        for axis in 0..3 {
            let inv = k.splat(ray.inv[axis]);
            enter = k.max(self.plane_t(k, ray.sides.near[axis], ray.near_origin[axis], inv), enter);
            leave = k.min(self.plane_t(k, ray.sides.far[axis], ray.far_origin[axis], inv), leave);
        }
        (k.le(enter, leave), enter)
    }

    /// t of one plane of all lanes.
    #[inline(always)]
    fn plane_t<K: Kernel>(&self, k: K, plane: Plane, origin: f32, inv: K::F) -> K::F {
        let pairs: &[[f32; 2]; 24] = bytemuck::cast_ref(&self.planes);
        let four: &[[f32; 2]; 4] = pairs[plane.index()..plane.index() + 4].try_into().expect("four pairs");
        k.mul(k.sub(k.load(bytemuck::cast_ref(four)), k.splat(origin)), inv)
    }
}

impl TraversalStack {
    /// The stack, with room for `need` entries.
    #[inline(always)]
    fn of_size(&mut self, need: usize) -> &mut [Entry] {
        if self.entries.len() < need {
            self.entries.resize(need, 0);
        }
        &mut self.entries
    }
}

/// The target, announced if it is a leaf; a node that is looked at next needs no announcement.
#[inline(always)]
fn announced_leaf(target: u32, prefetch: &impl Fn(u32)) -> u32 {
    if target & LEAF != 0 {
        prefetch(target & !LEAF);
    }
    target
}

/// Insertion sort, greatest first.
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
