//! Which nodes of the binary tree become lanes of the wide one: least surface-area cost by dynamic programming
//! (Ylitie, Karras, Laine: "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1).

use super::LANES;
use obvhs::bvh2::Bvh2;

/// Cost of visiting a wide node, as multiples of that of visiting a leaf, per area.
const NODE_COST: f32 = 2.0;

/// For every binary node, how its subtree is best shared out among a number of lanes.
pub(super) struct Collapse {
    plans: Vec<Plan>,
}

/// How a binary node is best spread over at most i lanes, for i = 1..=7 (index i - 1).
#[derive(Clone, Copy, Default)]
struct Plan {
    cost: [f32; LANES - 1],
    /// Lanes for the first child; 0 if the node stays one lane. Index 7 is the split of a wide node's eight lanes.
    first: [u8; LANES],
}

impl Collapse {
    /// `order` is that of [`parents_first`].
    pub fn new(tree: &Bvh2, order: &[u32]) -> Self {
        let mut plans = vec![Plan::default(); tree.nodes.len()];
        for &n in order.iter().rev() {
            let node = &tree.nodes[n as usize];
            let area = node.aabb().half_area();
            plans[n as usize] = if node.is_leaf() {
                Plan { cost: [area; LANES - 1], first: [0; LANES] }
            } else {
                let child = node.first_index as usize;
                Plan::of_inner(area, &plans[child], &plans[child + 1])
            };
        }
        Self { plans }
    }

    /// The binary nodes that are the lanes of the wide node over `root`, 1 to 8 of them.
    pub fn lanes(&self, tree: &Bvh2, root: usize) -> Vec<usize> {
        let mut lanes = Vec::with_capacity(LANES);
        if tree.nodes[root].is_leaf() {
            lanes.push(root);
        } else {
            self.split(tree, root, LANES, &mut lanes);
        }
        lanes
    }

    fn split(&self, tree: &Bvh2, node: usize, n_lanes: usize, lanes: &mut Vec<usize>) {
        let child = tree.nodes[node].first_index as usize;
        let first = usize::from(self.plans[node].first[n_lanes - 1]);
        for (child, n_lanes) in [(child, first), (child + 1, n_lanes - first)] {
            if self.plans[child].first[n_lanes - 1] == 0 {
                lanes.push(child);
            } else {
                self.split(tree, child, n_lanes, lanes);
            }
        }
    }
}

impl Plan {
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
