//! Boxes to wide tree, from the root down: ranges of boxes are split by binned surface-area cost (Wald 2007) until a node has its eight lanes.
//!
//! Why not obvhs, which serves well elsewhere: its clustering merges one pair a round where neighbours are equally near, as along a ribbon of equal
//! boxes or among copies of one box, and then takes quadratic time and makes a tree as deep as it has boxes. Here every range is cut, by its
//! middle if nothing else tells boxes apart, and 48 bytes a box are all the memory it takes.

use super::{EMPTY, LANES, LEAF, TopLevel, WideNode};
use crate::math::Bounds;
use glam::Vec3A;
use std::cmp::Ordering;
use std::ops::Range;

/// Memory that [`TopLevel::build`] takes while it runs, for each patch; what stays is [`TopLevel::bytes`].
pub const BUILD_BYTES_PER_PATCH: usize = size_of::<Item>();

/// Bins along each axis.
const BINS: usize = 16;

/// Below this depth ranges are cut by their middle, so that no arrangement of boxes makes the tree deep.
const DEEPEST_BY_COST: usize = 40;

/// A patch to be placed.
#[derive(Clone, Copy)]
struct Item {
    extent: Extent,
    patch: u32,
}

/// A box whose sides are vectors of four lanes, which are faster.
#[derive(Clone, Copy)]
struct Extent {
    low: Vec3A,
    high: Vec3A,
}

impl Extent {
    const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    #[inline(always)]
    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Half the surface.
    #[inline(always)]
    fn half_area(self) -> f32 {
        let d = self.high - self.low;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Twice the midpoint.
    #[inline(always)]
    fn centre(self) -> Vec3A {
        self.low + self.high
    }
}

/// Items that share a lane.
#[derive(Clone)]
struct Part {
    items: Range<usize>,
    extent: Extent,
}

impl Part {
    fn new(all: &[Item], items: Range<usize>) -> Self {
        let extent = all[items.clone()].iter().fold(Extent::EMPTY, |e, item| e.union(item.extent));
        Self { items, extent }
    }

    /// By surface, and where that is equal by number.
    fn cmp_by_area(&self, other: &Self) -> Ordering {
        let by_area = self.extent.half_area().total_cmp(&other.extent.half_area());
        by_area.then(self.items.len().cmp(&other.items.len()))
    }
}

impl WideNode {
    const NOTHING: Self = Self {
        planes: [
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
        ],
        refs: [EMPTY; LANES],
    };

    fn set(&mut self, lane: usize, extent: &Extent, reference: u32) {
        for k in 0..3 {
            self.planes[k][lane] = extent.low[k];
            self.planes[k + 3][lane] = extent.high[k];
        }
        self.refs[lane] = reference;
    }
}

/// A wide node whose lanes are to be filled.
struct Pending {
    node: usize,
    part: Part,
    depth: usize,
}

impl TopLevel {
    /// The tree over `patches`: boxes in lattice units, finite, that hold every lattice vertex of the patch. At most 2^28 of them.
    pub fn build(patches: &[Bounds]) -> Self {
        let item = |(patch, b): (usize, &Bounds)| {
            debug_assert!(b.min.is_finite() && b.max.is_finite(), "box {patch} is finite");
            Item { extent: Extent { low: b.min.into(), high: b.max.into() }, patch: patch as u32 }
        };
        let mut items: Vec<Item> = patches.iter().enumerate().map(item).collect();
        let mut tree = Self { nodes: vec![WideNode::NOTHING], stack_need: LANES };
        let mut pending = vec![Pending { node: 0, part: Part::new(&items, 0..items.len()), depth: 1 }];
        while let Some(next) = pending.pop() {
            tree.stack_need = tree.stack_need.max((LANES - 1) * next.depth + 1);
            tree.fill(next, &mut items, &mut pending);
        }
        tree.nodes.shrink_to_fit();
        tree
    }

    /// Shares a part out among the lanes of its node. Inner nodes below it become neighbours in memory.
    fn fill(&mut self, Pending { node, part, depth }: Pending, items: &mut [Item], pending: &mut Vec<Pending>) {
        for (lane, part) in lanes(items, part, depth).into_iter().enumerate() {
            if let [item] = &items[part.items.clone()] {
                self.nodes[node].set(lane, &item.extent, LEAF | item.patch);
            } else {
                let child = self.nodes.len();
                self.nodes.push(WideNode::NOTHING);
                self.nodes[node].set(lane, &part.extent, child as u32);
                pending.push(Pending { node: child, part, depth: depth + 1 });
            }
        }
    }
}

/// Cuts a part into at most eight: first the largest of those that would not fill a node, then, to save nodes, the smallest into single items.
fn lanes(items: &mut [Item], part: Part, depth: usize) -> Vec<Part> {
    let mut parts = Vec::with_capacity(LANES);
    if !part.items.is_empty() {
        parts.push(part);
    }
    while parts.len() < LANES {
        let large = parts.iter().enumerate().filter(|(_, p)| p.items.len() > LANES);
        let Some((largest, _)) = large.max_by(|(_, a), (_, b)| a.cmp_by_area(b)) else { break };
        let [low, high] = halves(items, &parts[largest], depth);
        parts[largest] = low;
        parts.push(high);
    }
    while let Some(smallest) = dissolvable(&parts) {
        let part = parts.swap_remove(smallest);
        parts.extend(part.items.map(|i| Part { items: i..i + 1, extent: items[i].extent }));
    }
    parts
}

/// The smallest part of several items of which each can have its own lane.
fn dissolvable(parts: &[Part]) -> Option<usize> {
    let several = (0..parts.len()).filter(|p| parts[*p].items.len() > 1);
    let smallest = several.min_by_key(|p| parts[*p].items.len())?;
    (parts.len() - 1 + parts[smallest].items.len() <= LANES).then_some(smallest)
}

/// Cuts a part in two where the surface-area cost is least.
fn halves(items: &mut [Item], part: &Part, depth: usize) -> [Part; 2] {
    let range = part.items.clone();
    let cut = if depth < DEEPEST_BY_COST { Cut::best(&items[range.clone()]) } else { None };
    let middle =
        cut.map_or(range.start + range.len() / 2, |cut| range.start + cut.partition(&mut items[range.clone()]));
    [Part::new(items, range.start..middle), Part::new(items, middle..range.end)]
}

/// A plane between two bins: items in bins below `first_high` go low.
struct Cut {
    binning: Binning,
    axis: usize,
    first_high: usize,
}

/// From the centre of an item to a bin on each axis.
struct Binning {
    low: Vec3A,
    scale: Vec3A,
}

impl Binning {
    /// `None` if all centres are one point.
    fn new(items: &[Item]) -> Option<Self> {
        let point = |item: &Item| Extent { low: item.extent.centre(), high: item.extent.centre() };
        let all = items.iter().fold(Extent::EMPTY, |e, item| e.union(point(item)));
        let size = all.high - all.low;
        // A little less than the number of bins, so that the highest centre is in the last one; 0 for an axis without extent.
        let scale = Vec3A::select(size.cmpgt(Vec3A::ZERO), Vec3A::splat(BINS as f32 * 0.9999) / size, Vec3A::ZERO);
        (size.max_element() > 0.0).then_some(Self { low: all.low, scale })
    }

    #[inline(always)]
    fn bins(&self, item: &Item) -> [usize; 3] {
        let bins = ((item.extent.centre() - self.low) * self.scale).to_array();
        // Casts saturate: whatever rounding or overflow did, the bin exists.
        bins.map(|b| (b as usize).min(BINS - 1))
    }
}

/// What is in a bin.
#[derive(Clone, Copy)]
struct Bin {
    extent: Extent,
    n: u32,
}

impl Bin {
    const EMPTY: Self = Self { extent: Extent::EMPTY, n: 0 };

    fn union(self, other: Self) -> Self {
        Self { extent: self.extent.union(other.extent), n: self.n + other.n }
    }

    fn cost(self) -> f32 {
        if self.n == 0 { f32::INFINITY } else { self.extent.half_area() * self.n as f32 }
    }
}

impl Cut {
    /// The cheapest cut with items on both sides; `None` if there is none.
    fn best(items: &[Item]) -> Option<Self> {
        let binning = Binning::new(items)?;
        let mut bins = [[Bin::EMPTY; BINS]; 3];
        for item in items {
            for (axis, bin) in binning.bins(item).into_iter().enumerate() {
                let bin = &mut bins[axis][bin];
                *bin = bin.union(Bin { extent: item.extent, n: 1 });
            }
        }
        let on_axis = |axis: usize| {
            let (cost, first_high) = cheapest(&bins[axis])?;
            Some((cost, axis, first_high))
        };
        let (_, axis, first_high) = (0..3).filter_map(on_axis).min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Self { binning, axis, first_high })
    }

    /// Brings the low items to the front and counts them.
    fn partition(&self, items: &mut [Item]) -> usize {
        let mut n_low = 0;
        for i in 0..items.len() {
            if self.binning.bins(&items[i])[self.axis] < self.first_high {
                items.swap(i, n_low);
                n_low += 1;
            }
        }
        n_low
    }
}

/// Cost and place of the cheapest cut between bins; `None` if all items are in one.
fn cheapest(bins: &[Bin; BINS]) -> Option<(f32, usize)> {
    let mut above = [f32::INFINITY; BINS];
    let mut high = Bin::EMPTY;
    for k in (1..BINS).rev() {
        high = high.union(bins[k]);
        above[k] = high.cost();
    }
    let mut low = Bin::EMPTY;
    let mut best = None;
    for k in 1..BINS {
        low = low.union(bins[k - 1]);
        let cost = low.cost() + above[k];
        if cost < best.map_or(f32::INFINITY, |(c, _)| c) {
            best = Some((cost, k));
        }
    }
    best
}
