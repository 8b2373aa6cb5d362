//! Which nodes of the binary tree become lanes of the wide one: least surface-area cost by dynamic programming (Ylitie,
//! Karras, Laine: "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1).

use super::LANES;
use super::groups::Group;
use super::slabs::{aabb, half_area};
use crate::math::Bounds;
use obvhs::bvh2::Bvh2;

/// Cost of visiting a wide node, as multiples of that of visiting a leaf, per area.
const NODE_COST: f32 = 2.0;

/// For every node of a binary tree over groups, how its subtree is best shared out among a number of lanes.
pub(super) struct Collapse<'t> {
    tree: &'t Bvh2,
    groups: &'t [Group],
    plans: Vec<Plan>,
}

/// What is in a lane.
#[derive(Clone, Copy)]
pub(super) enum Lane {
    /// A box, by its number.
    Box(u32),
    /// A wide node, by the binary node that it is made of.
    Node(usize),
}

/// How a binary node is best spread over at most i lanes, for i = 1..=7 (index i - 1).
#[derive(Clone, Copy, Default)]
struct Plan {
    cost: [f32; LANES - 1],
    /// Lanes for the first child; 0 if the node stays one lane. Index 7 is the split of a wide node's eight lanes. A
    /// group is taken apart where this is not 0.
    first: [u8; LANES],
}

impl<'t> Collapse<'t> {
    /// `order` is that of [`parents_first`].
    pub fn new(tree: &'t Bvh2, order: &[u32], groups: &'t [Group], boxes: &[Bounds]) -> Self {
        let mut plans = vec![Plan::default(); tree.nodes.len()];
        for &n in order.iter().rev() {
            let node = &tree.nodes[n as usize];
            let area = node.aabb().half_area();
            let first = node.first_index as usize;
            plans[n as usize] = if node.is_leaf() {
                let group = &groups[tree.primitive_indices[first] as usize];
                let area_of = |&number: &u32| half_area(&aabb(&boxes[number as usize]));
                Plan::of_group(area, group.numbers().len(), group.numbers().iter().map(area_of).sum())
            } else {
                Plan::of_inner(area, &plans[first], &plans[first + 1])
            };
        }
        Self { tree, groups, plans }
    }

    /// The lanes of the wide node over the binary node `root`, 1 to 8 of them, in place of what was in `lanes`.
    pub fn lanes(&self, root: usize, lanes: &mut Vec<Lane>) {
        lanes.clear();
        self.split(root, LANES, lanes);
    }

    /// The box of a binary node.
    pub fn bounds(&self, node: usize) -> Bounds {
        let aabb = self.tree.nodes[node].aabb();
        Bounds { min: aabb.min.into(), max: aabb.max.into() }
    }

    fn split(&self, node: usize, n_lanes: usize, lanes: &mut Vec<Lane>) {
        let below = self.tree.nodes[node].first_index as usize;
        if self.tree.nodes[node].is_leaf() {
            let group = &self.groups[self.tree.primitive_indices[below] as usize];
            lanes.extend(group.numbers().iter().map(|&number| Lane::Box(number)));
            return;
        }
        let first = usize::from(self.plans[node].first[n_lanes - 1]);
        for (child, n_lanes) in [(below, first), (below + 1, n_lanes - first)] {
            if self.plans[child].first[n_lanes - 1] == 0 {
                lanes.push(Lane::Node(child));
            } else {
                self.split(child, n_lanes, lanes);
            }
        }
    }
}

impl Plan {
    /// A group of `n` boxes, their areas added up: a node, or, where there are lanes enough, a lane each.
    fn of_group(area: f32, n: usize, areas: f32) -> Self {
        let mut plan = Plan { cost: [NODE_COST * area + areas; LANES - 1], first: [0; LANES] };
        for n_lanes in n..LANES {
            plan.cost[n_lanes - 1] = areas;
            plan.first[n_lanes - 1] = 1;
        }
        plan
    }

    fn of_inner(area: f32, a: &Plan, b: &Plan) -> Self {
        let mut plan = Plan::default();
        // Best split of n lanes between the children.
        let best = |n: usize| {
            let split = |k: usize| a.cost[k - 1] + b.cost[n - k - 1];
            (1..n).map(|k| (split(k), k as u8)).reduce(|x, y| if y.0 < x.0 { y } else { x }).expect("two lanes or more")
        };
        let (below, first) = best(LANES);
        plan.first[LANES - 1] = first;
        plan.cost[0] = below + NODE_COST * area;
        for n in 2..LANES {
            let (cost, first) = best(n);
            let stays = plan.cost[n - 2] <= cost;
            (plan.cost[n - 1], plan.first[n - 1]) =
                if stays { (plan.cost[n - 2], plan.first[n - 2]) } else { (cost, first) };
        }
        plan
    }
}

/// All nodes, each after its parent.
pub(super) fn parents_first(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    order.push(0);
    let mut next = 0;
    while next < order.len() {
        let node = &tree.nodes[order[next] as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        next += 1;
    }
    order
}
