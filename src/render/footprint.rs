//! Footprints: the pixels that a patch may reach, known before anything is tessellated.
//!
//! A box that holds every vertex that dicing would give covers a rectangle of the picture that holds every pixel at
//! which a ray could hit the patch. Proxies promise no such thing: a proxy may miss a pixel that its patch covers, and
//! so lose a small object. The boxes of whole patches are those of the tree that rays go through. A **part** of a patch
//! is a rectangle of its cells; it is made when someone has to look closer, down to about 8 x 8 pixels. Each has its
//! nearest depth and its **side**: towards the eye with its outside or with its inside all over, or mixed, when there
//! may be a silhouette or a mesh's border within.
//!
//! Footprints are found for a tile at a time, so their memory is that of a tile, whatever the scene.
//!
//! # Invariants
//! 1. A pixel that is not covered is missed by every ray through it.
//! 2. A set of pixels all of whose footprints show one side and belong to patches next to one another shows one
//!    connected piece of surface, silhouettes included.

use super::cells::TILE_SIDE;
use super::projection::{MeshView, ScreenBox};
use super::settings::RenderSettings;
use super::tiles::PixelRect;
use crate::ids::{FaceId, MeshId, PatchId};
use crate::math::Bounds;
use crate::scene::camera::Camera;
use crate::scene::world::{World, WorldMesh};
use crate::subdiv::{AskedCells, Dicer, PatchRates, SampleKind};
use crate::topology::{HalfEdges, NONE};
use glam::DVec3;

/// Side, in pixels, of parts that are not cut further.
const SMALL: f32 = 9.0;

/// Side, in pixels, of parts that are marked as a whole: marking a pixel too many costs a camera ray.
const COARSE: f32 = 20.0;

/// Side, in pixels, of the largest parts that show in four corners which side is seen of them.
const MAX_SIDED: f32 = 36.0;

/// Most parts that one is cut into, along each side. With 4, cuts are fewer and boxes that nobody asks about more: 4 to
/// 6 % more time on trex, monsterfrog and bigguy, for 2 % fewer rays.
const PIECES: u32 = 2;

/// Patches of a tile in which grouping pays: with more there is one for every six pixels, or many behind one another.
const MAX_WHOLE: usize = 640;

/// Parts of a tile that are cut. What takes more to know is better traced.
const MAX_CUT: u32 = 1000;

/// Parts of a tile.
const MAX_PARTS: usize = MAX_WHOLE + (MAX_CUT * PIECES * PIECES) as usize;

/// Boxes on the picture are this much larger, in pixels, than computed.
const ROUNDING: f64 = 1e-3;

/// Quarters of irregular parts that boxes look into: each more makes boxes tighter, and finding them slower.
const BOX_DEPTH: u32 = 1;

/// A part counts as seen from one side if its normals are so much further from edge-on, as a cosine, than they vary.
const SIDE_MARGIN: f64 = 0.02;

/// Pixels along a side of what a tile knows: its own, and those right beside and below it, which have probes.
const REACH: u32 = TILE_SIDE + 1;

/// Side, in pixels, of the blocks that patches are looked up by.
const BLOCK_SIDE: usize = 8;

/// Blocks along a side of what a tile knows.
const BLOCKS: usize = (REACH as usize).div_ceil(BLOCK_SIDE);

/// Parts of a cell along each side, at most: where cells are large, parts are smaller than they.
const IN_CELL: u32 = 16;

/// What rounding a vertex to the lattice may move it by, and more, in lattice units.
const SNAP: f32 = 2.0;

/// A scene as a camera sees it.
pub(super) struct Scenery<'a> {
    world: &'a World,
    camera: &'a Camera,
    size: [u32; 2],
    views: Vec<MeshView>,
}

/// What may be seen in a tile, and the means to find out.
pub(super) struct Footprints<'a> {
    scenery: &'a Scenery<'a>,
    origin: [u32; 2],
    /// A bit for each pixel, row by row.
    covered: [u128; REACH as usize],
    /// Those of whole patches first.
    parts: Vec<Part>,
    /// Numbers of the whole patches that reach each block, row by row.
    blocks: Vec<Vec<u16>>,
    /// Whether there are more patches than are remembered.
    is_crowded: bool,
    /// Parts that were cut.
    n_cut: u32,
    dicer: Dicer,
}

/// Cells of a patch.
#[derive(Clone, Copy)]
struct Part {
    mesh: MeshId,
    patch: PatchId,
    /// First column and row, and the ends, in cells over [`IN_CELL`]; `None` for the whole patch.
    cells: Option<[[u32; 2]; 2]>,
    /// No point of it is nearer; depth along the camera's forward direction.
    nearest: f32,
    /// Pixels within the tile's reach: x0, y0, x1, y1, the last two not included.
    rect: [u8; 4],
    /// Pixels along its longer side.
    extent: f32,
    side: Option<Side>,
    children: Children,
}

/// What a part was cut into.
#[derive(Clone, Copy)]
enum Children {
    Unknown,
    /// It is small, has one cell, or enough was cut.
    None,
    Some {
        first: u16,
        n: u8,
    },
}

/// Which side of a part the eye sees.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Side {
    Outside,
    Inside,
    Mixed,
}

/// What a piece of surface has to look like to be trusted.
pub(super) struct Claim<'a> {
    /// Patches that rays have hit.
    pub hits: &'a [(MeshId, PatchId)],
    /// Whether their outside was seen.
    pub outside: bool,
    /// Depth of the farthest hit: what lies behind is hidden.
    pub farthest: f32,
}

impl Claim<'_> {
    fn side(&self) -> Side {
        if self.outside { Side::Outside } else { Side::Inside }
    }
}

impl Part {
    /// Whether some of it may be seen at these pixels, not hidden behind what lies at depth `farthest`.
    fn is_seen(&self, [left, top, right, bottom]: [u8; 4], farthest: f32) -> bool {
        let [x0, y0, x1, y1] = self.rect;
        x0 < right && x1 > left && y0 < bottom && y1 > top && self.nearest <= farthest
    }
}

impl<'a> Scenery<'a> {
    pub fn new(world: &'a World, camera: &'a Camera, settings: &RenderSettings) -> Self {
        let views = world.meshes().iter().map(|mesh| MeshView::new(mesh, camera)).collect();
        Self { world, camera, size: settings.size, views }
    }

    fn project(&self, mesh: MeshId, b: &Bounds) -> Option<ScreenBox> {
        self.views[mesh.idx()].project(b, self.camera, self.size)
    }
}

impl<'a> Footprints<'a> {
    /// Bytes for a tile, at most.
    pub const BYTES: usize =
        MAX_PARTS * size_of::<Part>() + BLOCKS * BLOCKS * MAX_WHOLE * size_of::<u16>() + size_of::<Self>();

    pub fn new(scenery: &'a Scenery<'a>) -> Self {
        Self {
            scenery,
            origin: [0; 2],
            covered: [0; REACH as usize],
            parts: Vec::new(),
            blocks: vec![Vec::new(); BLOCKS * BLOCKS],
            is_crowded: false,
            n_cut: 0,
            dicer: Dicer::default(),
        }
    }

    /// Turns to another tile.
    pub fn find(&mut self, origin: [u32; 2]) {
        self.origin = origin;
        self.covered.fill(0);
        self.parts.clear();
        self.is_crowded = false;
        self.n_cut = 0;
        let scenery = self.scenery;
        for (k, mesh) in scenery.world.meshes().iter().enumerate() {
            let id = MeshId::from(k);
            let reaches = |b: &Bounds| scenery.project(id, b).and_then(|screen| reached(origin, &screen)).is_some();
            mesh.visit_patches(reaches, |patch, b| self.add_whole(id, patch, b));
        }
        self.sort_into_blocks();
        (0..self.parts.len()).for_each(|k| self.cover(k));
    }

    fn sort_into_blocks(&mut self) {
        self.blocks.iter_mut().for_each(Vec::clear);
        for (k, part) in self.parts.iter().enumerate() {
            blocks(part.rect).for_each(|block| self.blocks[block].push(k as u16));
        }
    }

    fn add_whole(&mut self, mesh: MeshId, patch: PatchId, b: &Bounds) {
        let Some(part) = self.part(mesh, patch, None, b) else { return };
        if self.parts.len() < MAX_WHOLE {
            self.parts.push(part);
        } else {
            self.is_crowded = true;
            mark(&mut self.covered, part.rect);
        }
    }

    fn part(&self, mesh: MeshId, patch: PatchId, cells: Option<[[u32; 2]; 2]>, b: &Bounds) -> Option<Part> {
        let screen = self.scenery.project(mesh, b)?;
        let rect = reached(self.origin, &screen)?;
        let extent = (screen.max - screen.min).max_element() as f32;
        // Depths are compared with those of hits, which are f32 too.
        let nearest = (screen.nearest * (1.0 - 1e-6)) as f32;
        Some(Part { mesh, patch, cells, nearest, rect, extent, side: None, children: Children::Unknown })
    }

    /// Marks the pixels of a part, looking no closer than what others have marked asks for.
    fn cover(&mut self, part: usize) {
        if is_marked(&self.covered, self.parts[part].rect) {
            return;
        }
        let children =
            if self.is_crowded || self.parts[part].extent <= COARSE { Children::None } else { self.children(part) };
        match children {
            Children::Some { first, n } => (0..usize::from(n)).for_each(|k| self.cover(usize::from(first) + k)),
            _ => mark(&mut self.covered, self.parts[part].rect),
        }
    }

    /// Whether no patch reaches the tile.
    pub fn is_bare(&self) -> bool {
        self.covered == [0; REACH as usize]
    }

    /// Whether there are too many patches to know more than which pixels they reach.
    pub fn is_crowded(&self) -> bool {
        self.is_crowded
    }

    /// Whether no patch reaches any of these pixels, all within the tile.
    pub fn is_empty(&self, pixels: PixelRect) -> bool {
        let [x, y] = self.origin;
        !rows([pixels.x0 - x, pixels.y0 - y, pixels.x1 - x, pixels.y1 - y])
            .any(|(row, bits)| self.covered[row] & bits != 0)
    }

    /// Whether nothing but connected surface, as claimed, can be seen at these pixels, all within the tile.
    pub fn agree(&mut self, pixels: PixelRect, claim: &Claim<'_>) -> bool {
        let [x, y] = self.origin;
        let pixels = [pixels.x0 - x, pixels.y0 - y, pixels.x1 - x, pixels.y1 - y].map(|n| n as u8);
        // What disagrees is often known already: look there before anything is cut.
        let blocks = || blocks(pixels);
        blocks().all(|block| self.blocks[block].iter().all(|&part| self.may_agree(usize::from(part), pixels, claim)))
            && blocks().all(|block| {
                (0..self.blocks[block].len())
                    .all(|k| self.agrees(usize::from(self.blocks[block][k]), pixels, claim, None))
            })
    }

    /// As [`agrees`](Self::agrees), as far as that is known already.
    fn may_agree(&self, k: usize, pixels: [u8; 4], claim: &Claim<'_>) -> bool {
        let part = &self.parts[k];
        if !part.is_seen(pixels, claim.farthest) {
            return true;
        }
        let is_small = part.extent <= SMALL;
        match part.children {
            Children::Unknown if !is_small => true,
            Children::Some { first, n } => {
                (first..first + u16::from(n)).all(|child| self.may_agree(usize::from(child), pixels, claim))
            }
            _ => {
                part.side.is_none_or(|side| side == claim.side())
                    && self.scenery.touches_any(part.mesh, part.patch, claim.hits)
            }
        }
    }

    /// Whether what may be seen of a part is as claimed; `touches`, if known, whether its patch touches one that was
    /// hit.
    fn agrees(&mut self, k: usize, pixels: [u8; 4], claim: &Claim<'_>, touches: Option<bool>) -> bool {
        let part = &self.parts[k];
        if !part.is_seen(pixels, claim.farthest) {
            return true;
        }
        let touches = touches.unwrap_or_else(|| self.scenery.touches_any(part.mesh, part.patch, claim.hits));
        if touches && part.extent <= MAX_SIDED && self.side(k) == claim.side() {
            return true;
        }
        let Children::Some { first, n } = self.children(k) else { return false };
        (0..usize::from(n)).all(|child| self.agrees(usize::from(first) + child, pixels, claim, Some(touches)))
    }

    /// Cuts a part into some that are about small, if it makes sense.
    fn children(&mut self, k: usize) -> Children {
        if matches!(self.parts[k].children, Children::Unknown) {
            self.parts[k].children = if self.parts[k].extent <= SMALL { Children::None } else { self.cut(k) };
        }
        self.parts[k].children
    }

    fn cut(&mut self, k: usize) -> Children {
        let Part { mesh: id, patch, cells, .. } = self.parts[k];
        let mesh = self.scenery.world.mesh(id);
        let rates = mesh.patch_rates(patch);
        let [i, j] = cells.unwrap_or([rates.n_u, rates.n_v].map(|n| [0, n * IN_CELL]));
        let is_flat = has_flat_cells(&rates);
        let [n_i, n_j] = [i, j].map(|[from, to]| pieces(to - from, is_flat));
        if n_i * n_j == 1 || self.n_cut == MAX_CUT {
            return Children::None;
        }
        self.n_cut += 1;
        let first = self.parts.len();
        for (a, b) in (0..n_j).flat_map(|b| (0..n_i).map(move |a| (a, b))) {
            let (i, j) = (piece(i, n_i, a), piece(j, n_j, b));
            let bounds = part_box(&mut self.dicer, mesh, patch, &rates, i, j);
            self.parts.extend(self.part(id, patch, Some([i, j]), &bounds));
        }
        Children::Some { first: first as u16, n: (self.parts.len() - first) as u8 }
    }

    fn side(&mut self, k: usize) -> Side {
        if let Some(side) = self.parts[k].side {
            return side;
        }
        let part = self.parts[k];
        let mesh = self.scenery.world.mesh(part.mesh);
        let rates = mesh.patch_rates(part.patch);
        let ends = [rates.n_u, rates.n_v].map(|n| n * IN_CELL);
        let [i, j] = part.cells.unwrap_or(ends.map(|end| [0, end]));
        let on_border = [j[0] == 0, i[1] == ends[0], j[1] == ends[1], i[0] == 0];
        let is_open = on_border.iter().zip(open_sides(mesh, part.patch)).any(|(&at, open)| at && open);
        let view = &self.scenery.views[part.mesh.idx()];
        if is_in_cell(i, j) && has_flat_cells(&rates) && !is_open {
            let cell = CellCorners::new(&mut self.dicer, mesh, part.patch, &rates, i, j);
            let side = cell.side(view, i, j);
            self.parts[k].side = Some(side);
            return side;
        }
        let [[i0, i1], [j0, j1]] = [cells_around(i), cells_around(j)];
        let cosines = [[i0, j0], [i1, j0], [i1, j1], [i0, j1]].map(|[i, j]| {
            let (u, v) = (f64::from(i) / f64::from(rates.n_u), f64::from(j) / f64::from(rates.n_v));
            let sample = self.dicer.sample(mesh.surface(), part.patch, u, v);
            let known = sample.kind != SampleKind::PositionOnly;
            if known { view.cosine(sample.position, sample.du.cross(sample.dv)) } else { f64::NAN }
        });
        let side = if is_open { Side::Mixed } else { side_of(cosines) };
        self.parts[k].side = Some(side);
        side
    }
}

/// Pixels in reach of the tile at `origin` that a box reaches.
fn reached(origin: [u32; 2], screen: &ScreenBox) -> Option<[u8; 4]> {
    let within = |x: f64, origin: u32| (x.floor() - f64::from(origin)).clamp(0.0, f64::from(REACH)) as u8;
    let first = screen.min - ROUNDING;
    let end = screen.max + ROUNDING + 1.0;
    let rect @ [x0, y0, x1, y1] =
        [within(first.x, origin[0]), within(first.y, origin[1]), within(end.x, origin[0]), within(end.y, origin[1])];
    (x0 < x1 && y0 < y1).then_some(rect)
}

/// Rows of a rectangle, each with the bits of its columns.
fn rows([x0, y0, x1, y1]: [u32; 4]) -> impl Iterator<Item = (usize, u128)> {
    let bits = (1u128 << x1) - (1u128 << x0);
    (y0 as usize..y1 as usize).map(move |row| (row, bits))
}

/// Numbers of the blocks that a rectangle reaches.
fn blocks([x0, y0, x1, y1]: [u8; 4]) -> impl Iterator<Item = usize> {
    let range = |from: u8, to: u8| usize::from(from) / BLOCK_SIDE..usize::from(to).div_ceil(BLOCK_SIDE);
    range(y0, y1).flat_map(move |row| range(x0, x1).map(move |column| row * BLOCKS + column))
}

fn mark(covered: &mut [u128], rect: [u8; 4]) {
    rows(rect.map(u32::from)).for_each(|(row, bits)| covered[row] |= bits);
}

fn is_marked(covered: &[u128], rect: [u8; 4]) -> bool {
    rows(rect.map(u32::from)).all(|(row, bits)| covered[row] & bits == bits)
}

/// Whether each cell's two triangles have the limit points of its corners, with no coarser neighbour's among them.
fn has_flat_cells(rates: &PatchRates) -> bool {
    rates.sides == [rates.n_u, rates.n_v, rates.n_u, rates.n_v]
}

/// How many pieces a range is cut into: of whole cells while there are several, then of one.
fn pieces(length: u32, is_flat: bool) -> u32 {
    let smallest = if is_flat { 1 } else { IN_CELL };
    (length / smallest).clamp(1, PIECES)
}

/// One of `n` pieces of a range.
fn piece([from, to]: [u32; 2], n: u32, k: u32) -> [u32; 2] {
    let unit = if to - from > IN_CELL { IN_CELL } else { 1 };
    [k, k + 1].map(|k| from + k * ((to - from) / unit) / n * unit)
}

/// The cells that a range reaches.
fn cells_around([from, to]: [u32; 2]) -> [u32; 2] {
    [from / IN_CELL, to.div_ceil(IN_CELL)]
}

fn part_box(
    dicer: &mut Dicer,
    mesh: &WorldMesh,
    patch: PatchId,
    rates: &PatchRates,
    i: [u32; 2],
    j: [u32; 2],
) -> Bounds {
    if is_in_cell(i, j) && has_flat_cells(rates) {
        return CellCorners::new(dicer, mesh, patch, rates, i, j).bounds(i, j);
    }
    let [i, j] = [i, j].map(cells_around);
    // A part's cells are a part of the patch: as many splits lead to a quarter of its size.
    let largest = (i[1] - i[0]).max(j[1] - j[0]);
    let depth = (rates.n_u.max(rates.n_v) / largest).ilog2() + BOX_DEPTH;
    dicer.bounds(mesh.surface(), patch, AskedCells { rates, i, j, depth })
}

fn is_in_cell(i: [u32; 2], j: [u32; 2]) -> bool {
    let is_within = |[from, to]: [u32; 2]| from / IN_CELL == (to - 1) / IN_CELL;
    is_within(i) && is_within(j)
}

/// The vertices of one cell, (0,0), (1,0), (0,1) and (1,1), in lattice units, before they are rounded.
///
/// Its two triangles meet from (1,0) to (0,1). Parts of it are halves of halves, so that this line passes through
/// corners of a part or misses it.
struct CellCorners([DVec3; 4]);

impl CellCorners {
    /// Of the cell that a part lies in.
    fn new(dicer: &mut Dicer, mesh: &WorldMesh, patch: PatchId, rates: &PatchRates, i: [u32; 2], j: [u32; 2]) -> Self {
        let (column, row) = (i[0] / IN_CELL, j[0] / IN_CELL);
        let place = |k: u32, n: u32| f64::from(k) / f64::from(n);
        Self([[0, 0], [1, 0], [0, 1], [1, 1]].map(|[a, b]| {
            dicer.sample(mesh.surface(), patch, place(column + a, rates.n_u), place(row + b, rates.n_v)).position
        }))
    }

    /// A box of a part of the cell: its corners tell all.
    fn bounds(&self, i: [u32; 2], j: [u32; 2]) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for [s, t] in [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[a, b]| [within_cell(i)[a], within_cell(j)[b]]) {
            bounds.grow(self.point(s, t).as_vec3());
        }
        Bounds { min: bounds.min - SNAP, max: bounds.max + SNAP }
    }

    fn point(&self, s: f64, t: f64) -> DVec3 {
        let [v00, v10, v01, v11] = self.0;
        if s + t <= 1.0 {
            v00 + s * (v10 - v00) + t * (v01 - v00)
        } else {
            v11 + (1.0 - s) * (v01 - v11) + (1.0 - t) * (v10 - v11)
        }
    }

    /// The side that the eye sees of the triangles that a part of the cell has to do with.
    fn side(&self, view: &MeshView, i: [u32; 2], j: [u32; 2]) -> Side {
        let [v00, v10, v01, v11] = self.0;
        let ([s0, s1], [t0, t1]) = (within_cell(i), within_cell(j));
        let halves = [(s0 + t0 < 1.0, v00, v10, v01), (s1 + t1 > 1.0, v11, v01, v10)];
        let (mut outside, mut inside) = (true, true);
        for (_, a, b, c) in halves.into_iter().filter(|(is_reached, ..)| *is_reached) {
            let cosine = view.cosine(a, (b - a).cross(c - a));
            outside &= cosine > SIDE_MARGIN;
            inside &= cosine < -SIDE_MARGIN;
        }
        match (outside, inside) {
            (true, false) => Side::Outside,
            (false, true) => Side::Inside,
            _ => Side::Mixed,
        }
    }
}

/// Where a range within a cell begins and ends, 0 to 1.
fn within_cell(range: [u32; 2]) -> [f64; 2] {
    let first = range[0] / IN_CELL * IN_CELL;
    range.map(|at| f64::from(at - first) / f64::from(IN_CELL))
}

fn side_of(cosines: [f64; 4]) -> Side {
    if cosines.iter().any(|c| c.is_nan()) {
        return Side::Mixed;
    }
    let (min, max) = cosines.iter().fold((1.0_f64, -1.0_f64), |(min, max), &c| (min.min(c), max.max(c)));
    let needed = max - min + SIDE_MARGIN;
    match (min > needed, -max > needed) {
        (true, _) => Side::Outside,
        (_, true) => Side::Inside,
        _ => Side::Mixed,
    }
}

impl Scenery<'_> {
    /// Whether a patch's face has a vertex in common with the face of one of the others.
    fn touches_any(&self, mesh: MeshId, patch: PatchId, others: &[(MeshId, PatchId)]) -> bool {
        if others.contains(&(mesh, patch)) {
            return true;
        }
        let surface = self.world.mesh(mesh).surface();
        let vertices = |patch| {
            let (first, n) = surface.face_corners(surface.face_of(patch).0);
            (first..first + n).map(|h| surface.topology().vertex(h))
        };
        let touches = |other| vertices(patch).any(|vertex| vertices(other).any(|other| other == vertex));
        others.iter().any(|&(of, other)| of == mesh && touches(other))
    }
}

/// Which sides of a patch (v = 0, u = 1, v = 1, u = 0) no other visible patch goes on from.
fn open_sides(mesh: &WorldMesh, patch: PatchId) -> [bool; 4] {
    let surface = mesh.surface();
    let topology = surface.topology();
    let (face, sub) = surface.face_of(patch);
    let (first, n) = surface.face_corners(face);
    let is_open = |k: u32| {
        let twin = topology.twin(first + k % n);
        twin == NONE || topology.is_hidden(FaceId(topology.face(twin)))
    };
    if n == 4 { [0, 1, 2, 3].map(is_open) } else { [is_open(sub), false, false, is_open(sub + n - 1)] }
}
