//! Fronts: where rays that are much alike begin in the tree.
//!
//! Rays of one tile of a picture meet the same few patches. A **bundle** is all rays whose origins and directions lie
//! within bounds; its **front** are the leaves that some ray of it may meet, found once for all, nearest first, in
//! groups of eight that are tested like nodes. So a ray of the bundle needs no way down: tests of groups do not wait
//! for each other as those of a node and its child do. Where there are more leaves than a front holds, nodes above them
//! stand in their place.
//!
//! What a bundle meets is found by the arithmetic of intervals: over all its rays, the way into a box is no shorter
//! than the least quotient of bounds, and the way to its end no longer than the greatest. Both are taken with a margin
//! above the slack of [`LatticeRay`], so that a front holds every leaf whose box a ray meets.
//!
//! Reshetov, Soupikov, Hurley, "Multi-Level Ray Tracing Algorithm", 2005 (entry points); Boulos, Wald, Shirley,
//! "Geometric and arithmetic culling methods for entire ray packets", 2006.

use super::traverse::{TraversalStack, Walk};
use super::{EMPTY, LANES, LEAF, LeafRef, LeafWalk, NodeBoxes, Refs, TopLevel};
use crate::grid::{LatticeRay, PACKET};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, place};
use crate::math::{DBounds, RayBounds};
use glam::{DVec3, Vec3};

/// Leaves and nodes of a front, at most.
const MOST_ITEMS: usize = 64;

/// By how much boxes grow, in lattice steps: rays are tested with a slack of 60 at most, and rounded to f32 within
/// [`FARTHEST`].
const MARGIN: f32 = 256.0;

/// By how much quotients grow, relatively.
const ROUNDING: f32 = 1e-6;

/// By how much bounds grow, relatively, so that rays that were rounded on their way into the tree's space stay within.
const ROUNDED: f64 = 1e-12;

/// Bundles from beyond have no front, in lattice steps.
const FARTHEST: f64 = 67_108_864.0;

/// Directions whose inverse may be greater along an axis are as good as any along that axis.
const GREATEST_INVERSE: f64 = 1e30;

/// The leaves that rays of a bundle may meet, and nodes in place of further ones.
pub struct Front {
    /// Least and greatest origin, least and greatest direction, not included; the fourth lane is to spare.
    bounds: [[f64; 4]; 4],
    pub(super) groups: Vec<Group>,
    /// Scratch: what is in the groups, and nodes whose children are still to be looked at.
    items: Vec<Item>,
    open: Vec<Item>,
}

/// Bounds that no ray is within.
const NO_RAY: [[f64; 4]; 4] = [[f64::NAN; 4]; 4];

/// Eight leaves or nodes, tested like a node's children.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Group {
    pub boxes: NodeBoxes,
    pub refs: Refs,
    /// Leaf slots.
    pub slots: [u32; LANES],
    /// Where the bundle enters the first of them, at least, in units of the rays' own directions.
    pub enter: f32,
}

#[derive(Clone, Copy)]
struct Item {
    /// Where the bundle enters it, at least.
    enter: f32,
    reference: u32,
    /// That of a leaf.
    slot: u32,
    planes: [f32; 6],
}

impl Default for Front {
    /// That of no ray.
    fn default() -> Self {
        Self { bounds: NO_RAY, groups: Vec::new(), items: Vec::new(), open: Vec::new() }
    }
}

impl Front {
    /// Whether a ray, in lanes 0 to 2 of origin and direction, is of the bundle.
    #[inline(always)]
    pub fn contains<K: Kernel>(&self, k: K, [origin, direction]: [K::D; 2]) -> bool {
        let [o, p, d, e] = &self.bounds;
        let of_origin = k.lt4(k.load4(o), origin) & k.lt4(origin, k.load4(p));
        let of_direction = k.lt4(k.load4(d), direction) & k.lt4(direction, k.load4(e));
        of_origin & of_direction & 7 == 7
    }

    /// Whether rays of the bundle meet nothing.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Whether all rays along these directions (x, y and z of each), from an origin that is within the bundle, are of
    /// it.
    #[inline(always)]
    pub fn contains_all<K: Kernel>(&self, k: K, directions: &[[f64; PACKET]; 3]) -> bool {
        let [.., low, high] = &self.bounds;
        let mut within = 0xf;
        for (axis, lanes) in directions.iter().enumerate() {
            let (four, more) = lanes.split_first_chunk().expect("eight lanes");
            let (four, more) = (k.load4(four), k.load4(more.first_chunk().expect("eight lanes")));
            within &= k.lt4(k.splat4(low[axis]), k.min4(four, more));
            within &= k.lt4(k.max4(four, more), k.splat4(high[axis]));
        }
        within == 0xf
    }

    /// For another bundle.
    fn set_bounds(&mut self, bundle: &RayBounds) {
        let outwards = |of: DBounds| {
            let more = ROUNDED * of.min.abs().max(of.max.abs());
            [of.min - more, of.max + more].map(|v| [v.x, v.y, v.z, 0.0])
        };
        let ([o, p], [d, e]) = (outwards(bundle.origin), outwards(bundle.direction));
        self.bounds = [o, p, d, e];
    }

    /// The leaves, the nearest first; `None` if nodes stand for some.
    pub fn leaves(&self) -> Option<impl ExactSizeIterator<Item = LeafRef> + '_> {
        let is_leaf = |item: &Item| item.reference & LEAF != 0;
        let leaf = |item: &Item| LeafRef { slot: item.slot, patch: PatchId(item.reference & !LEAF) };
        self.items.iter().all(is_leaf).then(|| self.items.iter().map(leaf))
    }

    fn set_groups(&mut self) {
        self.items.sort_unstable_by(|a, b| a.enter.total_cmp(&b.enter));
        self.groups.clear();
        self.groups.extend(self.items.chunks(LANES).map(Group::new));
    }
}

impl Group {
    fn new(items: &[Item]) -> Self {
        // No ray meets a lane that stays as it is.
        let [low, high] = [[f32::MAX; LANES], [f32::MIN; LANES]];
        let boxes = NodeBoxes { planes: [low, low, low, high, high, high] };
        let mut group = Self { boxes, refs: [EMPTY; LANES], slots: [0; LANES], enter: items[0].enter };
        for (lane, item) in items.iter().enumerate() {
            (group.refs[lane], group.slots[lane]) = (item.reference, item.slot);
            group.boxes.planes.iter_mut().zip(item.planes).for_each(|(lanes, plane)| lanes[lane] = plane);
        }
        group
    }
}

impl TopLevel {
    /// Finds the front of a bundle in the tree's space. Returns whether there is one; there is none for origins that
    /// are too far away.
    #[inline(always)]
    pub fn find_front<K: Kernel>(&self, k: K, bundle: &RayBounds, front: &mut Front) -> bool {
        front.bounds = NO_RAY;
        let Some(intervals) = Intervals::new(bundle) else { return false };
        front.set_bounds(bundle);
        let Front { items, open, .. } = front;
        items.clear();
        open.clear();
        self.look_below(k, 0, &intervals, items, open);
        let mut next = 0;
        while next < open.len() && items.len() + (open.len() - next) + LANES - 1 <= MOST_ITEMS {
            self.look_below(k, open[next].reference, &intervals, items, open);
            next += 1;
        }
        items.extend(&open[next..]);
        front.set_groups();
        true
    }

    /// Appends the children of a node that the bundle may meet: leaves to `leaves`, nodes to `nodes`.
    #[inline(always)]
    fn look_below<K: Kernel>(
        &self,
        k: K,
        node: u32,
        bundle: &Intervals,
        leaves: &mut Vec<Item>,
        nodes: &mut Vec<Item>,
    ) {
        let (boxes, refs) = (&self.nodes.boxes[node as usize], &self.nodes.refs[node as usize]);
        let (enter, leave) = bundle.test(k, boxes);
        let (mut met, enter) = (k.le(enter, leave), k.store(enter));
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let planes = boxes.planes.map(|lanes| lanes[lane]);
            let slot = node * LANES as u32 + lane as u32;
            let item = Item { enter: enter[lane], reference: refs[lane], slot, planes };
            match refs[lane] {
                EMPTY => (),
                reference if reference & LEAF != 0 => leaves.push(item),
                _ => nodes.push(item),
            }
        }
    }
}

/// What a bundle's rays have in common, axis by axis.
struct Intervals {
    /// Least and greatest origin, with the margin.
    origin: [Vec3; 2],
    /// Least and greatest inverse of the direction; zero where it has either sign.
    inverse: [Vec3; 2],
}

impl Intervals {
    /// `None` if the origins are too far away for the margin.
    fn new(bundle: &RayBounds) -> Option<Self> {
        let DBounds { min: low, max: high } = bundle.origin;
        // Not `>`, which is false for NaN.
        let is_near = low.abs().max(high.abs()).cmple(DVec3::splat(FARTHEST)).all();
        let of_axis = |axis: usize| inverses([bundle.direction.min[axis], bundle.direction.max[axis]]);
        let [x, y, z] = [0, 1, 2].map(of_axis);
        let inverse = [Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1])];
        is_near.then(|| Self { origin: [low.as_vec3() - MARGIN, high.as_vec3() + MARGIN], inverse })
    }

    /// Where rays enter the boxes at least, and where they leave them at most.
    #[inline(always)]
    fn test<K: Kernel>(&self, k: K, boxes: &NodeBoxes) -> (K::F, K::F) {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(f32::INFINITY));
        for axis in 0..3 {
            let inverse = self.inverse.map(|of| of[axis]);
            if inverse == [0.0; 2] {
                continue;
            }
            let low = k.sub(k.load(&boxes.planes[axis]), k.splat(self.origin[1][axis]));
            let high = k.sub(k.load(&boxes.planes[axis + 3]), k.splat(self.origin[0][axis]));
            let (near, far) = if inverse[0] > 0.0 { (low, high) } else { (high, low) };
            let (least, greatest) = (k.splat(inverse[0]), k.splat(inverse[1]));
            enter = k.max(k.min(k.mul(near, least), k.mul(near, greatest)), enter);
            leave = k.min(k.max(k.mul(far, least), k.mul(far, greatest)), leave);
        }
        (enter, leave)
    }
}

/// The least and the greatest inverse of numbers between two; zeros if there is none or it is not known.
fn inverses([low, high]: [f64; 2]) -> [f32; 2] {
    let has_one_sign = low > 0.0 || high < 0.0;
    let (least, greatest) = (high.recip(), low.recip());
    if !has_one_sign || least.abs().max(greatest.abs()) > GREATEST_INVERSE {
        return [0.0; 2];
    }
    let (least, greatest) = (least as f32, greatest as f32);
    [least - least.abs() * ROUNDING, greatest + greatest.abs() * ROUNDING]
}

impl TopLevel {
    /// A walk along a ray of the bundle whose front this is, at its start.
    #[inline(always)]
    pub fn walk_front<'t, K: Kernel>(
        &'t self,
        kernel: K,
        front: &'t Front,
        ray: &'t LatticeRay,
        stack: &'t mut TraversalStack,
    ) -> FrontWalk<'t, K> {
        let (group, rest) = front.groups.split_first().expect("a front that is not empty");
        let below = self.walk_below(kernel, ray, stack);
        let order = below.order_of(&group.boxes, ray.t_max);
        FrontWalk { kernel, ray, below, is_below: false, group, rest, order }
    }
}

/// A ray's way along a front, from leaf to leaf.
pub struct FrontWalk<'t, K: Kernel> {
    kernel: K,
    ray: &'t LatticeRay,
    /// The way below a node of the front, while `is_below`.
    below: Walk<'t, K>,
    is_below: bool,
    group: &'t Group,
    rest: &'t [Group],
    order: K::O,
}

impl<K: Kernel> LeafWalk for FrontWalk<'_, K> {
    #[inline(always)]
    fn nearest(&mut self, t_max: f32, prefetch: impl Fn(u32)) -> Option<LeafRef> {
        let (k, last) = (self.kernel, place(t_max));
        loop {
            if self.is_below {
                let leaf = self.below.nearest(t_max, &prefetch);
                if leaf.is_some() {
                    return leaf;
                }
                self.is_below = false;
            }
            let (lane, place) = k.first(self.order);
            if place > last {
                (self.group, self.rest) = self.rest.split_first()?;
                if self.group.enter > self.ray.caller_t(t_max) {
                    return None;
                }
                self.order = self.below.order_of(&self.group.boxes, t_max);
                continue;
            }
            self.order = k.without(self.order, lane);
            let reference = self.group.refs[lane % LANES];
            if reference & LEAF != 0 {
                let (next, place) = k.first(self.order);
                if place <= last && self.group.refs[next % LANES] & LEAF != 0 {
                    prefetch(self.group.slots[next % LANES]);
                }
                return Some(LeafRef { slot: self.group.slots[lane % LANES], patch: PatchId(reference & !LEAF) });
            }
            self.below.start_at(reference, t_max);
            self.is_below = true;
        }
    }
}
