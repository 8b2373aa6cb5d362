//! What can be told of a ring's node before it is among others: its rows, its limits, and the keys of its quarters.
//!
//! Making this is most of the work of making a node and needs no library, so that it can be done for many rings at
//! once.

use super::local::{LocalMesh, RingWalker};
use super::pole::Pole;
use super::rows::sort_by_weight;
use super::rules::{self, CornerLimit, Origin, RefinedView, Row, RuleSet};
use crate::topology::NONE;
use std::sync::Arc;

/// A ring's node, on its own.
pub(super) enum Draft {
    /// The rows of its 16 control points, as of [`rules::regular_rows`], one after the other.
    Regular(Vec<Row>),
    /// One Catmull-Clark step.
    Split(SplitDraft),
}

/// A node that is split, on its own.
pub(super) struct SplitDraft {
    /// The refined points that children use.
    pub rows: Vec<Row>,
    /// See [`Step::pole`](super::plan::Step::pole).
    pub pole: Vec<u32>,
    /// One for each corner.
    pub quarters: Vec<Quarter>,
    /// Those at the corners, if there are four.
    pub limits: Vec<CornerLimit>,
}

/// A quarter that will be a child.
pub(super) struct Quarter {
    /// The key of its ring, made less sharp; shared with the quarter before if they are equal, as those of a polygon
    /// are.
    pub key: Arc<[u32]>,
    /// The half-edge of the refined ring where its own starts.
    pub start: u32,
    /// How many steps sharper it is than the ring with the key.
    pub steps: u32,
    /// See [`NodeId::turn`](super::plan::NodeId::turn).
    pub turn: u32,
    /// Its points among the refined ones.
    pub points: Vec<u32>,
}

impl Draft {
    /// The draft for a ring; `is_dry` if its rows are known already and only counted. `walker` is scratch.
    pub fn new(rules: RuleSet, ring: &LocalMesh, is_dry: bool, walker: &mut RingWalker) -> Self {
        let n = ring.n_corners();
        let may_be_regular = n == 4 && !rules.shares_sharper(ring);
        if may_be_regular && let Some(rows) = rules::regular_rows(ring) {
            return Draft::Regular(rows.into_iter().flatten().collect());
        }
        let refined = RefinedView::new(rules, ring);
        let (mut rows, pole) = RefinedRows::new(rules, ring, &refined, is_dry);
        let mut quarters: Vec<Quarter> = Vec::with_capacity(n as usize);
        for k in 0..n {
            let quarter = quarter(rules, &refined, child_start(n, k), quarters.last(), &mut rows, walker);
            quarters.push(quarter);
        }
        let n_limits = if n == 4 && !is_dry { 4 } else { 0 };
        let limits = (0..n_limits).map(|k| rules::corner_limit(ring, k)).collect();
        Draft::Split(SplitDraft { rows: rows.rows, pole, quarters, limits })
    }
}

/// The quarter that starts at a half-edge, in terms of `rows`, which become more by those that are not there yet.
fn quarter(
    rules: RuleSet,
    refined: &RefinedView<'_>,
    start: u32,
    before: Option<&Quarter>,
    rows: &mut RefinedRows<'_>,
    walker: &mut RingWalker,
) -> Quarter {
    let look = walker.look(refined, start);
    let start = start & !3 | (start + look.turn) & 3;
    let mut key = Vec::new();
    let (steps, sources) = walker.key(refined, start, look, rules.keeps_outer_tags(), rules.lowers(), &mut key);
    let points = sources.iter().map(|&v| rows.place_of(refined, v)).collect();
    let key = before
        .map(|quarter| &quarter.key)
        .filter(|before| before[..] == key[..])
        .cloned()
        .unwrap_or_else(|| key.into());
    Quarter { key, start, steps, turn: look.turn, points }
}

/// The rows of a ring's refined points, each made when it is first asked for.
struct RefinedRows<'a> {
    rules: RuleSet,
    ring: &'a LocalMesh,
    /// For each refined point its row, or [`NONE`].
    place: Vec<u32>,
    rows: Vec<Row>,
    /// Whether rows are only counted.
    is_dry: bool,
}

impl<'a> RefinedRows<'a> {
    /// With the face point, if the target is a polygon, or all of a pole's, with the ring in a pole's order.
    fn new(rules: RuleSet, ring: &'a LocalMesh, refined: &RefinedView<'_>, is_dry: bool) -> (Self, Vec<u32>) {
        let mut rows = RefinedRows { rules, ring, place: vec![NONE; refined.origin.len()], rows: Vec::new(), is_dry };
        if ring.n_corners() != 4 {
            rows.place_of(refined, refined.face_vertex(0));
        }
        if let Some(pole) = Pole::new(ring)
            && let Some(points) = pole.refined(refined)
        {
            points.into_iter().for_each(|v| _ = rows.place_of(refined, v));
            return (rows, pole.ring());
        }
        (rows, Vec::new())
    }

    fn place_of(&mut self, refined: &RefinedView<'_>, v: u32) -> u32 {
        let place = &mut self.place[v as usize];
        if *place == NONE {
            *place = self.rows.len() as u32;
            let origin = corner_origin(self.ring, refined.origin[v as usize]);
            let mut row = if self.is_dry { Row::new() } else { rules::refined_row(&self.rules, self.ring, origin) };
            // As they will be kept: to sort them is much of the work of that.
            sort_by_weight(&mut row);
            self.rows.push(row);
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
