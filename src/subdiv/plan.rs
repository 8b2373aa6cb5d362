//! The plan library: one node per distinct ring, shared by all faces, levels and meshes with the same rules.

use super::local::{LocalMesh, RingWalker};
use super::rows::{RowStore, Span, SparseRows};
use super::rules::{self, CornerLimit, Origin, RefinedView, Row, RuleSet};
use crate::mesh::CreaseMethod;
use crate::topology::NONE;
use rustc_hash::FxHashMap;

/// A node of the library.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct NodeId(pub u32);

/// A quarter of a split face.
#[derive(Clone, Copy, Debug)]
pub struct Child {
    /// Its node.
    pub node: NodeId,
    /// Which refined point each of the child's ring points is.
    pub points: Span,
}

/// What is known of the limit at a corner of a node.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    /// The surface is regular there sooner or later: walk down.
    Regular,
    /// A position without tangents.
    Position(SparseRows),
    /// A position (row 0) and tangents along u and v (rows 1 and 2), of which only the directions count.
    Smooth(SparseRows),
}

/// How the surface over a ring is found.
#[derive(Clone, Debug)]
pub enum Plan {
    /// Bicubic B-spline: 16 rows give the control points, u fastest.
    Regular(SparseRows),
    /// One Catmull-Clark step, then the quarters (a polygon of n sides has n children).
    Split {
        /// The refined points that children use. A polygon's first row is its face point, and the others count that as
        /// one more ring point.
        rows: SparseRows,
        /// One child per corner. Quarters of quads keep the quad's orientation; children of polygons start at their corner.
        children: Box<[Child]>,
        /// Limits at the corners; none for polygons, of which only the children are evaluated.
        limits: Box<[Limit]>,
        /// Whether the surface lies in the convex hull of the ring (all weights from here on are non-negative).
        in_hull: bool,
    },
}

/// All nodes of meshes that share a [`RuleSet`].
#[derive(Debug)]
pub struct PlanLibrary {
    rules: RuleSet,
    rows: RowStore,
    nodes: Vec<Option<Plan>>,
    n_points: Vec<u32>,
    by_key: FxHashMap<Vec<u32>, NodeId>,
    /// Scratch.
    key: Vec<u32>,
    walker: RingWalker,
}

impl PlanLibrary {
    /// An empty library.
    pub fn new(rules: RuleSet) -> Self {
        Self {
            rules,
            rows: RowStore::default(),
            nodes: Vec::new(),
            n_points: Vec::new(),
            by_key: FxHashMap::default(),
            key: Vec::new(),
            walker: RingWalker::default(),
        }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether no node was made yet.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Number of ring points of a node.
    pub fn n_points(&self, node: NodeId) -> usize {
        self.n_points[node.0 as usize] as usize
    }

    /// A node's plan.
    #[inline]
    pub fn plan(&self, node: NodeId) -> &Plan {
        self.nodes[node.0 as usize].as_ref().expect("nodes are complete once the library is built")
    }

    /// The rows of all nodes.
    #[inline(always)]
    pub fn rows(&self) -> &RowStore {
        &self.rows
    }

    /// The options that all its meshes share.
    pub fn rules(&self) -> RuleSet {
        self.rules
    }

    /// Whether rings keep the semi-sharp edges of vertices that are not corners of their target.
    pub fn outer_tags(&self) -> bool {
        self.rules.crease_method == CreaseMethod::Chaikin
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let keys: usize = self.by_key.keys().map(|k| 4 * k.len() + 40).sum();
        keys + self.rows.bytes() + self.nodes.iter().flatten().map(plan_bytes).sum::<usize>()
    }

    /// Forgets how nodes were found, once no more are needed.
    pub fn seal(&mut self) {
        self.by_key = FxHashMap::default();
        self.key = Vec::new();
        self.walker = RingWalker::default();
        self.rows.seal();
    }

    /// The node for a ring, if it is known.
    pub fn find(&self, key: &[u32]) -> Option<NodeId> {
        self.by_key.get(key).copied()
    }

    /// The node for a ring, made if it is new.
    pub fn node(&mut self, ring: &LocalMesh) -> NodeId {
        let mut key = std::mem::take(&mut self.key);
        ring.key(&mut key);
        let id = self.find(&key).unwrap_or_else(|| self.make_node(ring, &key));
        self.key = key;
        id
    }

    /// The node for a ring that is new.
    fn make_node(&mut self, ring: &LocalMesh, key: &[u32]) -> NodeId {
        let id = NodeId(self.nodes.len() as u32);
        self.nodes.push(None);
        self.n_points.push(ring.n_vertices() as u32);
        self.by_key.insert(key.to_vec(), id);
        let regular = if ring.n_corners() == 4 { rules::regular_rows(ring) } else { None };
        let plan = match regular {
            Some(rows) => Plan::Regular(self.rows.push(rows.iter().flatten())),
            None => self.split(id, ring),
        };
        self.nodes[id.0 as usize] = Some(plan);
        id
    }

    fn split(&mut self, id: NodeId, ring: &LocalMesh) -> Plan {
        let n = ring.n_corners();
        let (rows, quarters) = self.quarters(ring);
        let packed = self.rows.push(&rows);
        let children: Box<[Child]> = quarters
            .into_iter()
            .map(|(node, points)| Child {
                node: node.unwrap_or_else(|ring| self.node(&ring)),
                points: self.rows.push_indices(&points),
            })
            .collect();
        let n_limits = if n == 4 { 4 } else { 0 };
        let limits = (0..n_limits).map(|k| self.limit(id, ring, packed, &children[k as usize], k)).collect();
        let semi_sharp = ring.tags.iter().any(|t| !t.semi_sharp.is_empty());
        let in_hull = !(self.outer_tags() && semi_sharp);
        Plan::Split { rows: packed, children, limits, in_hull }
    }

    /// Rows of the refined points that any quarter uses, and each quarter: its node, or its ring if that is new, and its
    /// points in terms of those rows.
    fn quarters(&mut self, ring: &LocalMesh) -> (Vec<Row>, Vec<Quarter>) {
        let refined = RefinedView::new(self.rules, ring);
        let mut rows =
            RefinedRows { rules: self.rules, ring, place: vec![NONE; refined.origin.len()], rows: Vec::new() };
        let n = ring.n_corners();
        if n != 4 {
            rows.place_of(&refined, refined.face_vertex(0));
        }
        let (mut walker, mut key) = (std::mem::take(&mut self.walker), Vec::new());
        let quarters = (0..n).map(|k| {
            let child = walker.extract(&refined, child_start(n, k), self.outer_tags());
            let points = child.sources.iter().map(|&v| rows.place_of(&refined, v)).collect();
            child.mesh.key(&mut key);
            (self.find(&key).ok_or_else(|| walker.take().mesh), points)
        });
        let quarters = quarters.collect();
        self.walker = walker;
        (rows.rows, quarters)
    }

    fn limit(&mut self, id: NodeId, ring: &LocalMesh, rows: SparseRows, child: &Child, k: u32) -> Limit {
        match rules::corner_limit(ring, k) {
            CornerLimit::Regular => Limit::Regular,
            CornerLimit::Position(row) => Limit::Position(self.rows.push([&row])),
            CornerLimit::Smooth(position, [along, next]) => {
                let negated = |row: &Row| -> Row { row.iter().map(|&(p, w)| (p, -w)).collect() };
                let [du, dv] = match k {
                    0 => [along, next],
                    1 => [negated(&next), along],
                    2 => [negated(&along), negated(&next)],
                    _ => [next, negated(&along)],
                };
                Limit::Smooth(self.rows.push([&position, &du, &dv]))
            }
            CornerLimit::Iterate if child.node == id => Limit::Position(self.iterate(ring, rows, child, k)),
            CornerLimit::Iterate | CornerLimit::Descend => self.pull_back(rows, child, k),
        }
    }

    /// A child's limit at its corner, in terms of this ring's points.
    fn pull_back(&mut self, rows: SparseRows, child: &Child, corner: u32) -> Limit {
        let limit = match self.plan(child.node) {
            Plan::Regular(_) => Limit::Regular,
            Plan::Split { limits, .. } => limits[corner as usize],
        };
        match limit {
            Limit::Regular => Limit::Regular,
            Limit::Position(row) => Limit::Position(self.compose(rows, child, row)),
            Limit::Smooth(three) => Limit::Smooth(self.compose(rows, child, three)),
        }
    }

    /// Rows over a child's points, as rows over this ring's.
    fn compose(&mut self, rows: SparseRows, child: &Child, of_child: SparseRows) -> SparseRows {
        let store = &self.rows;
        let composed: Vec<Row> = (0..of_child.len())
            .map(|i| {
                let terms = store.row(of_child, i).into_iter().flat_map(|(c, w)| {
                    let point = store.index(child.points, c as usize);
                    store.row(rows, point).into_iter().map(move |(p, x)| (p, x * w))
                });
                rules::merge(terms.collect())
            })
            .collect();
        self.rows.push(&composed)
    }

    /// The limit of corner `k` of a node whose quarter there is the node itself: the row of the corner after many steps.
    ///
    /// The part of the row that has not converged shrinks by the subdominant eigenvalue each step, at most 0.75 for the
    /// rings that have no closed form, so that 200 steps leave less than 1e-24 of it.
    fn iterate(&mut self, ring: &LocalMesh, rows: SparseRows, child: &Child, k: u32) -> SparseRows {
        const STEPS: usize = 200;
        let n = ring.n_vertices();
        let mut limit = vec![0.0; n];
        limit[ring.vertex[k as usize] as usize] = 1.0;
        for _ in 0..STEPS {
            let mut before = vec![0.0; n];
            for (c, &w) in limit.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let point = self.rows.index(child.points, c);
                self.rows.row(rows, point).into_iter().for_each(|(p, x)| before[p as usize] += x * w);
            }
            limit = before;
        }
        let row: Row = limit.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(p, &w)| (p as u32, w)).collect();
        self.rows.push([&row])
    }
}

/// A quarter's node, or its ring, and its points.
type Quarter = (Result<NodeId, LocalMesh>, Vec<u32>);

/// The rows of a ring's refined points, each made when it is first asked for.
struct RefinedRows<'a> {
    rules: RuleSet,
    ring: &'a LocalMesh,
    /// For each refined point its row, or [`NONE`].
    place: Vec<u32>,
    rows: Vec<Row>,
}

impl RefinedRows<'_> {
    fn place_of(&mut self, refined: &RefinedView<'_>, v: u32) -> u32 {
        let place = &mut self.place[v as usize];
        if *place == NONE {
            *place = self.rows.len() as u32;
            let origin = corner_origin(self.ring, refined.origin[v as usize]);
            self.rows.push(rules::refined_row(&self.rules, self.ring, origin));
        }
        *place
    }
}

/// Child `k`'s first half-edge in the refined ring: quarters of quads are turned so that their corner k is the face's.
pub(super) fn child_start(n_corners: u32, k: u32) -> u32 {
    if n_corners == 4 { 4 * k + (4 - k) % 4 } else { 4 * k }
}

/// Vertex rows are asked by a corner of the target: any other spoke would see another fan.
fn corner_origin(ring: &LocalMesh, origin: Origin) -> Origin {
    match origin {
        Origin::Vertex(h) => {
            let v = ring.vertex[h as usize];
            let corner = (0..ring.n_corners()).find(|&k| ring.vertex[k as usize] == v);
            Origin::Vertex(corner.expect("children use the points of the target's corners only"))
        }
        other => other,
    }
}

fn plan_bytes(plan: &Plan) -> usize {
    size_of::<Option<Plan>>()
        + size_of::<u32>()
        + match plan {
            Plan::Regular(_) => 0,
            Plan::Split { children, limits, .. } => size_of_val::<[Child]>(children) + size_of_val::<[Limit]>(limits),
        }
}
