//! The plan library: one node per distinct ring, shared by all faces, levels and meshes with the same rules.

use super::draft::{Draft, Quarter, SplitDraft};
use super::local::{LocalMesh, RingWalker};
use super::route::route;
use super::rows::{RowStore, Span, SparseRows};
use super::rules::{self, CornerLimit, RefinedView, Row, RuleSet};
use crate::mesh::CreaseMethod;
use crate::topology::NONE;
use rustc_hash::FxHashMap;

/// A node of the library and a turn: its number in the upper bits, and in the lower two at which corner of the face the
/// node's corner 0 lies. So the four turns of a ring share a node. Polygons are not turned.
///
/// By the uniform method all semi-sharp edges and corners lose 1 a step, and as long as they are sharper than 1, a step
/// is the same whatever they are. So rings whose sharpness differs by whole steps share a node, made for the one that
/// is least sharp, and the bits between tell **how many steps** sharper than that a ring is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct NodeId(pub u32);

/// Bit of a node that is shared by rings of different sharpness, and the lowest of those that count steps: fewer than
/// 10, which is infinitely sharp.
const IS_SHARP: u32 = 1 << 2;
const STEP_SHIFT: u32 = 3;
const STEP_MASK: u32 = 15;
const INDEX_SHIFT: u32 = 7;

impl NodeId {
    /// The node itself.
    pub(super) fn unturned(index: usize) -> Self {
        NodeId((index as u32) << INDEX_SHIFT)
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 >> INDEX_SHIFT) as usize
    }

    /// How many steps sharper the ring is than that of the node.
    #[inline(always)]
    fn steps(self) -> u32 {
        (self.0 >> STEP_SHIFT) & STEP_MASK
    }

    /// For rings that are as much less sharp.
    fn less_sharp(self, steps: u32) -> Self {
        if self.0 & IS_SHARP == 0 { self } else { NodeId(self.0 - (steps << STEP_SHIFT)) }
    }

    /// For rings that are as much sharper.
    #[inline(always)]
    fn sharper(self, steps: u32) -> Self {
        if self.0 & IS_SHARP == 0 { self } else { NodeId(self.0 + (steps << STEP_SHIFT)) }
    }

    /// The corner of the face where the node's corner 0 lies.
    #[inline(always)]
    pub fn turn(self) -> u32 {
        self.0 & 3
    }

    /// The node for a face that is turned once more.
    #[inline(always)]
    pub fn turned(self, by: u32) -> Self {
        NodeId(self.0 & !3 | (self.0 + by) & 3)
    }
}

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
    /// A position. Tangents, if there are any, are found further down.
    Below(SparseRows),
    /// A position without tangents.
    Position(SparseRows),
    /// A position (row 0) and tangents along u and v (rows 1 and 2), of which only the directions count.
    Smooth(SparseRows),
}

impl Limit {
    /// The row of the position.
    #[inline(always)]
    pub fn position(&self) -> Option<SparseRows> {
        match *self {
            Limit::Regular => None,
            Limit::Below(rows) | Limit::Position(rows) | Limit::Smooth(rows) => Some(rows),
        }
    }
}

/// One Catmull-Clark step of a ring.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The refined points that children use. A polygon's first row is its face point, and the others count that as one
    /// more ring point.
    pub rows: SparseRows,
    /// If the ring is a pole, its points in a pole's order, and the rows are in the order of its step.
    pub pole: Option<Span>,
}

/// How the surface over a ring is found.
#[derive(Clone, Copy, Debug)]
pub enum Plan<'a> {
    /// Bicubic B-spline: 16 rows give the control points, u fastest, of the face from the corner that is the turn; if
    /// there is no row, the points are the control points.
    Regular(SparseRows, u32),
    /// One Catmull-Clark step, then the quarters (a polygon of n sides has n children).
    Split {
        /// Gives the refined points.
        step: Step,
        /// One child per corner. Quarters of quads keep the quad's orientation; children of polygons start at their
        /// corner.
        children: Children<'a>,
        /// Limits at the corners; none for polygons, of which only the children are evaluated.
        limits: Limits<'a>,
        /// Whether the surface lies in the convex hull of the ring (all weights from here on are non-negative).
        in_hull: bool,
    },
}

/// The children of a node, as a face has them.
#[derive(Clone, Copy, Debug)]
pub struct Children<'a> {
    all: &'a [Child],
    turn: u32,
    /// Steps by which they are sharper.
    steps: u32,
}

impl Children<'_> {
    /// The child at corner `k` of the face.
    #[inline(always)]
    pub fn get(&self, k: usize) -> Child {
        let Child { node, points } = self.all[unturned(k, self.turn)];
        Child { node: node.turned(self.turn).sharper(self.steps), points }
    }
}

/// The limits at a node's corners, as a face has them.
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    all: &'a [Limit],
    /// See [`NodeId::turn`]; u and v of tangents are those of the node.
    pub turn: u32,
}

impl Limits<'_> {
    /// The limit at corner `k` of the face; none at a polygon's.
    #[inline(always)]
    pub fn get(&self, k: usize) -> Option<Limit> {
        self.all.get(unturned(k, self.turn)).copied()
    }
}

/// Which corner of a node lies at corner `k` of a face that is turned.
#[inline(always)]
fn unturned(k: usize, turn: u32) -> usize {
    if turn == 0 { k } else { (k + 4 - turn as usize) % 4 }
}

/// A node as it is kept.
#[derive(Clone, Copy, Debug)]
struct Node {
    n_points: u32,
    rows: SparseRows,
    /// Where its ring's route starts, and how many points of [`Step::pole`] come before that.
    shape: Span,
    n_pole: u32,
    /// Where its children start, and how many there are: 0 for regular nodes, [`NONE`] as long as it is being made.
    children: u32,
    n_children: u32,
    /// Where its children start for rings that are sharper by one step; [`NONE`], here and in `children`, as long as no
    /// ring was.
    sharper: u32,
    /// By how many steps rings may be sharper, as bits: what is below those has been made.
    ready: u16,
    /// Where its limits start, four if there are four children.
    limits: u32,
    in_hull: bool,
    /// Whether it is regular, and its control points are points of its ring.
    is_listed: bool,
}

impl Default for Node {
    fn default() -> Self {
        let nothing = Span::default();
        Node {
            n_points: 0,
            rows: SparseRows::default(),
            shape: nothing,
            n_pole: 0,
            children: NONE,
            n_children: 0,
            sharper: NONE,
            ready: 0,
            limits: 0,
            in_hull: true,
            is_listed: false,
        }
    }
}

/// All nodes of meshes that share a [`RuleSet`].
#[derive(Debug)]
pub struct PlanLibrary {
    rules: RuleSet,
    rows: RowStore,
    nodes: Vec<Node>,
    children: Vec<Child>,
    limits: Vec<Limit>,
    by_key: FxHashMap<Vec<u32>, NodeId>,
    /// The node whose ring points are its control points.
    plain: Option<NodeId>,
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
            children: Vec::new(),
            limits: Vec::new(),
            by_key: FxHashMap::default(),
            plain: None,
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
        self.nodes[node.index()].n_points as usize
    }

    /// The route of a node's ring, which starts at the corner that is the turn; empty if there is none.
    #[inline]
    pub(super) fn route(&self, node: NodeId) -> Span {
        let Node { shape, n_pole, .. } = self.nodes[node.index()];
        shape.split_at(n_pole)[1]
    }

    /// A node's plan.
    #[inline]
    pub fn plan(&self, node: NodeId) -> Plan<'_> {
        let (turn, steps) = (node.turn(), node.steps());
        let node = &self.nodes[node.index()];
        if node.n_children == 0 {
            return Plan::Regular(node.rows, turn);
        }
        let (start, steps) = if steps == 0 { (node.children, 0) } else { (node.sharper, steps - 1) };
        let children = &self.children[start as usize..][..node.n_children as usize];
        let n_limits = if children.len() == 4 { 4 } else { 0 };
        let limits = &self.limits[node.limits as usize..][..n_limits];
        let (children, limits) = (Children { all: children, turn, steps }, Limits { all: limits, turn });
        let pole = (node.n_pole != 0).then(|| node.shape.split_at(node.n_pole)[0]);
        Plan::Split { step: Step { rows: node.rows, pole }, children, limits, in_hull: node.in_hull }
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
        self.rules.keeps_outer_tags()
    }

    /// Whether rings are found by the keys of less sharp ones.
    pub fn lowers(&self) -> bool {
        self.rules.lowers()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let keys: usize = self.by_key.keys().map(|k| 4 * k.len() + 40).sum();
        let nodes = size_of_val(&self.nodes[..]) + size_of_val(&self.children[..]) + size_of_val(&self.limits[..]);
        keys + self.rows.bytes() + nodes
    }

    /// Points of the largest ring.
    pub fn largest_ring(&self) -> usize {
        self.nodes.iter().map(|node| node.n_points as usize).max().unwrap_or(0)
    }

    /// Whether numbers of nodes, or of their rows, might not do for many more.
    pub(super) fn is_nearly_full(&self) -> bool {
        const MANY: usize = 1 << 20;
        self.nodes.len() + MANY > 1 << (u32::BITS - INDEX_SHIFT) || self.rows.is_nearly_full()
    }

    /// Forgets how nodes were found, once no more are needed.
    pub fn seal(&mut self) {
        self.by_key = FxHashMap::default();
        self.key = Vec::new();
        self.walker = RingWalker::default();
        self.rows.seal();
        self.nodes.shrink_to_fit();
        self.children.shrink_to_fit();
        self.limits.shrink_to_fit();
    }

    /// The node for a ring, made if it is new.
    pub fn node(&mut self, ring: &LocalMesh) -> NodeId {
        self.drafted_node(ring.clone(), None)
    }

    /// As [`node`](Self::node); `draft` is the ring's, if it is there already.
    pub(super) fn drafted_node(&mut self, mut ring: LocalMesh, draft: Option<Draft>) -> NodeId {
        let steps = if self.lowers() { ring.lower() } else { 0 };
        self.node_above(&mut ring, steps, draft)
    }

    /// The node for a ring that is so many steps sharper than this one, made if it is new. The draft is of the sharper
    /// one.
    fn node_above(&mut self, ring: &mut LocalMesh, steps: u32, draft: Option<Draft>) -> NodeId {
        let mut key = std::mem::take(&mut self.key);
        ring.key(&mut key);
        let (id, draft) = match self.by_key.get(&key) {
            Some(&id) => (id, draft),
            None => self.make_node(ring, &key, draft),
        };
        self.key = key;
        let id = id.sharper(steps);
        if !self.settle(id) {
            self.make_ready(id, ring, draft);
        }
        id
    }

    /// The node for a ring that is new, and its draft unless it was used. What is below it is not known yet if others
    /// can be sharper by some steps.
    fn make_node(&mut self, ring: &mut LocalMesh, key: &[u32], draft: Option<Draft>) -> (NodeId, Option<Draft>) {
        let is_sharp = self.rules.shares_sharper(ring);
        let id = NodeId(NodeId::unturned(self.nodes.len()).0 | if is_sharp { IS_SHARP } else { 0 });
        let nothing = self.rows.push([]);
        let n_points = ring.n_vertices() as u32;
        let shape = self.rows.push_indices(&route(ring));
        let node = Node { n_points, rows: nothing, shape, n_children: NONE, ..Node::default() };
        self.nodes.push(node);
        self.by_key.insert(key.to_vec(), id);
        if is_sharp {
            return (id, draft);
        }
        match draft.unwrap_or_else(|| Draft::new(self.rules, ring, false, &mut self.walker)) {
            Draft::Regular(rows) => {
                let node = &mut self.nodes[id.index()];
                (node.rows, node.n_children) = (self.rows.push(&rows), 0);
                node.is_listed = rows.iter().all(|row| matches!(row[..], [(_, 1.0)]));
            }
            Draft::Split(draft) => self.split(id, ring, draft),
        }
        (id, None)
    }

    fn split(&mut self, id: NodeId, ring: &LocalMesh, draft: SplitDraft) {
        let rows = self.rows.push(&draft.rows);
        if !draft.pole.is_empty() {
            let shape = self.rows.push_indices(&[&draft.pole[..], &route(ring)].concat());
            let node = &mut self.nodes[id.index()];
            (node.shape, node.n_pole) = (shape, draft.pole.len() as u32);
        }
        let (children, rings) = self.children_of(ring, &draft.quarters);
        self.finish(id, ring, rows, &children, draft.limits);
        self.nodes[id.index()].children = self.children.len() as u32;
        self.children.extend(&children);
        self.make_children_ready(ring, &draft.quarters, &children, rings);
    }

    /// Whether a node is one that rings which are as sharp can use: all below it is known. What is true of the children
    /// is true of it.
    fn settle(&mut self, id: NodeId) -> bool {
        if id.0 & IS_SHARP == 0 || self.nodes[id.index()].ready >> id.steps() & 1 == 1 {
            return true;
        }
        let node = self.nodes[id.index()];
        let (start, above) = if id.steps() == 0 { (node.children, 0) } else { (node.sharper, id.steps() - 1) };
        let is_settled = start != NONE
            && (start..start + node.n_children).all(|child| {
                let child = self.children[child as usize].node;
                self.settle(child.sharper(above))
            });
        self.nodes[id.index()].ready |= u16::from(is_settled) << id.steps();
        is_settled
    }

    /// Finds what is below a node that is not settled. `ring` is that of the node, and becomes the sharper one.
    fn make_ready(&mut self, id: NodeId, ring: &mut LocalMesh, draft: Option<Draft>) {
        let Node { children, sharper, .. } = self.nodes[id.index()];
        if id.steps() > 0 && sharper != NONE && children == NONE {
            // The way down from here ends at the node itself, most often: then its own ring is all that has to be
            // split.
            self.split_sharp(id.less_sharp(id.steps()), ring, None);
            if self.settle(id) {
                return;
            }
        }
        ring.raise(id.steps());
        self.split_sharp(id, ring, draft);
    }

    /// Finds what is below a ring whose node can be that of sharper ones, too. The first of them gives the node its
    /// rows: all have the same.
    fn split_sharp(&mut self, id: NodeId, ring: &LocalMesh, draft: Option<Draft>) {
        let is_first = self.nodes[id.index()].ready == 0;
        self.nodes[id.index()].ready |= 1 << id.steps();
        let draft = draft.unwrap_or_else(|| Draft::new(self.rules, ring, !is_first, &mut self.walker));
        let Draft::Split(draft) = draft else { unreachable!("nothing that is sharp is regular") };
        let rows = is_first.then(|| self.rows.push(&draft.rows));
        let (children, rings) = self.children_of(ring, &draft.quarters);
        if let Some(rows) = rows {
            self.finish(id, ring, rows, &children, draft.limits);
        }
        let node = &mut self.nodes[id.index()];
        let (start, above) = match id.steps() {
            0 => (&mut node.children, 0),
            steps => (&mut node.sharper, steps - 1),
        };
        if *start == NONE {
            *start = self.children.len() as u32;
            self.children.extend(children.iter().map(|c| Child { node: c.node.less_sharp(above), ..*c }));
        }
        self.make_children_ready(ring, &draft.quarters, &children, rings);
    }

    /// Gives a node all but its children.
    fn finish(&mut self, id: NodeId, ring: &LocalMesh, rows: SparseRows, children: &[Child], limits: Vec<CornerLimit>) {
        let n = ring.n_corners();
        let limits: Vec<Limit> =
            (0..).zip(limits).map(|(k, limit)| self.limit(id, ring, rows, &children[k as usize], k, limit)).collect();
        // Those of other vertices count only for edges to such corners.
        let semi_sharp = (0..n).any(|k| !ring.tags_at(k).semi_sharp.is_empty());
        let node = &mut self.nodes[id.index()];
        (node.rows, node.n_children) = (rows, n);
        node.in_hull = !(self.rules.crease_method == CreaseMethod::Chaikin && semi_sharp);
        node.limits = self.limits.len() as u32;
        self.limits.extend(limits);
    }

    /// The children of a ring, made if they are new, but not ready if they are shared by sharper rings; and those of
    /// their rings that were cut out for that.
    fn children_of(&mut self, ring: &LocalMesh, quarters: &[Quarter]) -> (Vec<Child>, Vec<Option<LocalMesh>>) {
        let mut refined = None;
        let child = |quarter: &Quarter| {
            let (mut cut_out, key) = (None, &quarter.key);
            let node = self.by_key.get(&key[..]).copied().unwrap_or_else(|| {
                let refined = refined.get_or_insert_with(|| RefinedView::new(self.rules, ring));
                let ring = cut_out.insert(self.cut_out(refined, quarter));
                self.make_node(ring, key, None).0
            });
            let (node, points) = (node.sharper(quarter.steps).turned(quarter.turn), &quarter.points);
            let plain = self.plain_child(node, points);
            (plain.unwrap_or_else(|| Child { node, points: self.rows.push_indices(points) }), cut_out)
        };
        quarters.iter().map(child).unzip()
    }

    /// The ring of a quarter, made less sharp.
    fn cut_out(&mut self, refined: &RefinedView<'_>, quarter: &Quarter) -> LocalMesh {
        let outer_tags = self.outer_tags();
        let mut ring = self.walker.extract(refined, quarter.start, outer_tags).mesh.clone();
        if self.lowers() {
            ring.lower();
        }
        ring
    }

    /// Finds what is below children that are not settled.
    fn make_children_ready(
        &mut self,
        ring: &LocalMesh,
        quarters: &[Quarter],
        children: &[Child],
        rings: Vec<Option<LocalMesh>>,
    ) {
        let mut refined = None;
        for ((quarter, child), cut_out) in quarters.iter().zip(children).zip(rings) {
            if !self.settle(child.node) {
                let refined = refined.get_or_insert_with(|| RefinedView::new(self.rules, ring));
                let mut ring = cut_out.unwrap_or_else(|| self.cut_out(refined, quarter));
                self.make_ready(child.node.turned(4 - quarter.turn), &mut ring, None);
            }
        }
    }

    /// The child at a regular node whose control points are points of its ring: those are all the points it has then.
    fn plain_child(&mut self, node: NodeId, points: &[u32]) -> Option<Child> {
        let Node { rows, n_children: 0, is_listed: true, .. } = self.nodes[node.index()] else { return None };
        let point = |i: u8| points[self.rows.first_column(rows, i.into())];
        let control = TURNED_CONTROL[node.turn() as usize].map(point);
        let points = self.rows.push_indices(&control);
        let node = self.plain.unwrap_or_else(|| self.push_plain());
        self.plain = Some(node);
        Some(Child { node, points })
    }

    fn push_plain(&mut self) -> NodeId {
        let id = NodeId::unturned(self.nodes.len());
        let (rows, shape) = (self.rows.push([]), self.rows.push_indices(&[]));
        self.nodes.push(Node { n_points: 16, rows, shape, ..Node::default() });
        id
    }

    fn limit(
        &mut self,
        id: NodeId,
        ring: &LocalMesh,
        rows: SparseRows,
        child: &Child,
        k: u32,
        limit: CornerLimit,
    ) -> Limit {
        match limit {
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
            // How far down it is differs among the rings of this node.
            _ if id.0 & IS_SHARP != 0 => Limit::Regular,
            CornerLimit::Iterate | CornerLimit::Descend => self.pull_back(rows, child, k),
        }
    }

    /// A child's limit at its corner, in terms of this ring's points. Only of its position: to walk down for tangents
    /// takes longer, but they are asked for one by one, and would be most of what libraries of semi-sharp meshes hold.
    fn pull_back(&mut self, rows: SparseRows, child: &Child, corner: u32) -> Limit {
        if child.node.0 & IS_SHARP != 0 {
            return Limit::Regular;
        }
        let limit = match self.plan(child.node) {
            Plan::Regular(..) => Limit::Regular,
            Plan::Split { limits, .. } => limits.get(corner as usize).expect("quarters have four corners"),
        };
        let Some(position) = limit.position() else { return Limit::Regular };
        let row = self.compose(rows, child, position);
        if matches!(limit, Limit::Position(_)) { Limit::Position(row) } else { Limit::Below(row) }
    }

    /// The first of a child's rows, as a row over this ring's points.
    fn compose(&mut self, rows: SparseRows, child: &Child, of_child: SparseRows) -> SparseRows {
        let store = &self.rows;
        let terms = store.row(of_child, 0).into_iter().flat_map(|(c, w)| {
            let point = store.index(child.points, c as usize);
            store.row(rows, point).into_iter().map(move |(p, x)| (p, x * w))
        });
        let row = rules::merge(terms.collect());
        self.rows.push([&row])
    }

    /// The limit of corner `k` of a node whose quarter there is the node itself: the row of the corner after many
    /// steps.
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

/// For each control point of a face, which one it is of a node that starts at the face's corner `turn`: the node's u
/// runs from there to the next corner.
pub(super) const TURNED_CONTROL: [[u8; 16]; 4] = [
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
    [12, 8, 4, 0, 13, 9, 5, 1, 14, 10, 6, 2, 15, 11, 7, 3],
    [15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0],
    [3, 7, 11, 15, 2, 6, 10, 14, 1, 5, 9, 13, 0, 4, 8, 12],
];
