//! Footprints: the pixels that a patch may reach, known before anything is tessellated.
//!
//! Every patch is cut into **parts** of about a block of pixels. A part's box holds the vertices that dicing would give, so
//! the rectangle that the box covers on the picture holds every pixel that a ray through it could hit the part at. Proxies
//! promise no such thing: a proxy may miss a pixel that its patch covers, and so lose a small object.
//!
//! A **block** of 8 x 8 pixels lists the parts that may reach it, each with its nearest depth and its **side**: towards the
//! eye with its outside or with its inside all over, or mixed, when there may be a silhouette or a mesh's border within.
//!
//! # Invariants
//! 1. A pixel without footprints is missed by every ray through it.
//! 2. A set of pixels all of whose footprints show one side and belong to patches next to one another shows one connected
//!    piece of surface, silhouettes included.

use super::patches::PatchNumbers;
use super::settings::RenderSettings;
use super::tiles::PixelRect;
use crate::ids::PatchId;
use crate::math::Bounds;
use crate::scene::camera::Camera;
use crate::scene::world::{World, WorldMesh};
use crate::subdiv::{Dicer, PatchRates, SampleKind};
use crate::topology::{HalfEdges, NONE};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Side of a block in pixels; parts are about as large.
const BLOCK: u32 = 8;

/// Most parts along a side of a patch.
const MAX_PARTS: u32 = 64;

/// Depth that boxes are clipped at, in distances between the eye and what it looks at: nothing nearer is taken into account.
const NEAR: f64 = 1e-7;

/// Boxes on the picture are this much larger, in pixels, than computed.
const ROUNDING: f64 = 1e-3;

/// Quarters of irregular parts that boxes look into: each more makes boxes tighter, and finding them slower.
const BOX_DEPTH: u32 = 1;

/// A part counts as seen from one side if its normals are so much further from edge-on, as a cosine, than they vary.
const SIDE_MARGIN: f64 = 0.02;

/// Footprints of all patches on a whole picture.
pub struct Footprints {
    columns: u32,
    rows: u32,
    /// First footprint of each block, then the total.
    first: Vec<u32>,
    footprints: Vec<Footprint>,
    pub(super) numbers: PatchNumbers,
}

/// A part of a patch in a block.
#[derive(Clone, Copy)]
struct Footprint {
    /// Number of the patch.
    patch: u32,
    /// No point of it is nearer; depth along the camera's forward direction.
    nearest: f32,
    /// Pixels within the block: x0, y0, x1, y1, the last two not included.
    rect: [u8; 4],
    side: Side,
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
    /// Patches that rays have hit, by number.
    pub hits: &'a [u32],
    /// Whether their outside was seen.
    pub outside: bool,
    /// Depth of the farthest hit: what lies behind is hidden.
    pub farthest: f32,
}

impl Footprints {
    /// Bytes that the footprints of a picture take at most while they are sorted; scenes with more are not worth grouping.
    pub fn max_bytes(settings: &RenderSettings) -> usize {
        max_footprints(settings) * (size_of::<Footprint>() + 2 * size_of::<(u32, Footprint)>())
    }

    /// Projects all patches. `None` if there are too many for groups to pay: patches of a few pixels, or ids beyond 32 bits.
    pub fn new(world: &World, camera: &Camera, settings: &RenderSettings, threads: usize) -> Option<Self> {
        let numbers = PatchNumbers::new(world)?;
        let [columns, rows] = settings.size.map(|n| n.div_ceil(BLOCK) + BLOCK);
        let n_footprints = AtomicUsize::new(0);
        let limit = max_footprints(settings);
        let meshes: Vec<MeshView> = world.meshes().iter().map(|mesh| MeshView::new(mesh, camera)).collect();
        let new = || Projector {
            camera,
            size: settings.size,
            blocks: [columns, rows],
            dicer: Dicer::default(),
            cosines: Vec::new(),
            found: Vec::new(),
        };
        let parts = numbers.for_each(world, threads, new, |projector, mesh, patch| {
            if n_footprints.load(Ordering::Relaxed) <= limit {
                let before = projector.found.len();
                projector.patch(&meshes[mesh.idx()], world.mesh(mesh), patch, numbers.number(mesh, patch));
                n_footprints.fetch_add(projector.found.len() - before, Ordering::Relaxed);
            }
        });
        if n_footprints.into_inner() > limit {
            return None;
        }
        let (first, footprints) = sorted_by_block((columns * rows) as usize, parts.iter().flat_map(|p| &p.found));
        Some(Self { columns, rows, first, footprints, numbers })
    }

    /// Whether no patch reaches any of these pixels.
    pub(super) fn is_empty(&self, pixels: PixelRect) -> bool {
        !self.reaches_beyond(pixels) && self.over(pixels).next().is_none()
    }

    /// Whether nothing but connected surface, as claimed, can be seen at these pixels.
    pub(super) fn agree(&self, world: &World, pixels: PixelRect, claim: &Claim<'_>) -> bool {
        let side = if claim.outside { Side::Outside } else { Side::Inside };
        self.over(pixels).filter(|f| f.nearest <= claim.farthest).all(|f| {
            f.side == side
                && (claim.hits.contains(&f.patch) || claim.hits.iter().any(|&hit| self.touch(world, hit, f.patch)))
        })
    }

    /// Whether pixels lie outside of the blocks, where nothing is known.
    fn reaches_beyond(&self, pixels: PixelRect) -> bool {
        pixels.x1 > self.columns * BLOCK || pixels.y1 > self.rows * BLOCK
    }

    fn over(&self, pixels: PixelRect) -> impl Iterator<Item = &Footprint> {
        let columns = pixels.x0 / BLOCK..pixels.x1.div_ceil(BLOCK).min(self.columns);
        let rows = pixels.y0 / BLOCK..pixels.y1.div_ceil(BLOCK).min(self.rows);
        rows.flat_map(move |row| columns.clone().map(move |column| (column, row))).flat_map(move |(column, row)| {
            let block = (row * self.columns + column) as usize;
            let range = self.first[block] as usize..self.first[block + 1] as usize;
            let (x, y) = (column * BLOCK, row * BLOCK);
            self.footprints[range].iter().filter(move |f| {
                let [x0, y0, x1, y1] = f.rect.map(u32::from);
                x + x0 < pixels.x1 && x + x1 > pixels.x0 && y + y0 < pixels.y1 && y + y1 > pixels.y0
            })
        })
    }

    /// Whether two patches' faces have a vertex in common.
    fn touch(&self, world: &World, a: u32, b: u32) -> bool {
        let [(mesh_a, a), (mesh_b, b)] = [a, b].map(|number| self.numbers.patch(number));
        if mesh_a != mesh_b {
            return false;
        }
        let surface = world.mesh(mesh_a).surface();
        let vertices = |patch| {
            let (first, n) = surface.face_corners(surface.face_of(patch).0);
            (first..first + n).map(|h| surface.topology().vertex(h))
        };
        vertices(a).any(|vertex| vertices(b).any(|other| other == vertex))
    }
}

fn max_footprints(settings: &RenderSettings) -> usize {
    settings.size.iter().map(|&n| n as usize).product::<usize>() / 4 + (1 << 16)
}

fn sorted_by_block<'a>(
    n_blocks: usize,
    found: impl Iterator<Item = &'a (u32, Footprint)> + Clone,
) -> (Vec<u32>, Vec<Footprint>) {
    let mut first = vec![0u32; n_blocks + 1];
    found.clone().for_each(|(block, _)| first[*block as usize + 1] += 1);
    for block in 0..n_blocks {
        first[block + 1] += first[block];
    }
    let mut next = first.clone();
    let nothing = Footprint { patch: 0, nearest: 0.0, rect: [0; 4], side: Side::Mixed };
    let mut footprints = vec![nothing; first[n_blocks] as usize];
    for &(block, footprint) in found {
        footprints[next[block as usize] as usize] = footprint;
        next[block as usize] += 1;
    }
    (first, footprints)
}

/// A mesh as the camera sees it.
struct MeshView {
    view_from_lattice: DAffine3,
    view_from_lattice_normal: DMat3,
}

impl MeshView {
    fn new(mesh: &WorldMesh, camera: &Camera) -> Self {
        let view = |p: DVec3| {
            let object = mesh.surface().object_from_lattice(p);
            camera.view_from_world(mesh.world_from_object().transform_point3(object))
        };
        let origin = view(DVec3::ZERO);
        let axes = DVec3::AXES.map(|axis| view(axis) - origin);
        let normals = DVec3::AXES.map(|axis| camera.view_from_world_vector(*mesh.world_from_object_normal() * axis));
        Self {
            view_from_lattice: DAffine3::from_mat3_translation(DMat3::from_cols(axes[0], axes[1], axes[2]), origin),
            view_from_lattice_normal: DMat3::from_cols(normals[0], normals[1], normals[2]),
        }
    }
}

/// One thread's work.
struct Projector<'a> {
    camera: &'a Camera,
    size: [u32; 2],
    blocks: [u32; 2],
    dicer: Dicer,
    /// Cosine between the normal and the direction to the eye at the corners of parts; NaN where there is no normal.
    cosines: Vec<f64>,
    found: Vec<(u32, Footprint)>,
}

/// What a box covers on the picture.
#[derive(Clone, Copy)]
struct ScreenBox {
    min: DVec2,
    max: DVec2,
    nearest: f64,
}

impl Projector<'_> {
    fn patch(&mut self, view: &MeshView, mesh: &WorldMesh, patch: PatchId, number: u32) {
        let rates = mesh.patch_rates(patch);
        let Some(whole) = self.part_box(view, mesh, patch, &rates, [0, rates.n_u], [0, rates.n_v]) else { return };
        if self.pixels(&whole).is_none() {
            return;
        }
        let visible = (whole.max.min(DVec2::from(self.size.map(f64::from))) - whole.min.max(DVec2::ZERO)).max_element();
        let n_parts = (visible / f64::from(BLOCK)).ceil() as u32;
        let [n_u, n_v] = [rates.n_u, rates.n_v].map(|n| n_parts.clamp(1, n.min(MAX_PARTS)));
        let [us, vs] = [(n_u, rates.n_u), (n_v, rates.n_v)].map(|(parts, cells)| move |k: u32| k * cells / parts);
        self.find_cosines(view, mesh, patch, (n_u, n_v), |a, b| {
            (f64::from(us(a)) / f64::from(rates.n_u), f64::from(vs(b)) / f64::from(rates.n_v))
        });
        let open = open_sides(mesh, patch);
        for b in 0..n_v {
            for a in 0..n_u {
                let part = if n_u * n_v == 1 {
                    Some(whole)
                } else {
                    self.part_box(view, mesh, patch, &rates, [us(a), us(a + 1)], [vs(b), vs(b + 1)])
                };
                let on_border =
                    [b == 0, a + 1 == n_u, b + 1 == n_v, a == 0].iter().zip(open).any(|(&at, open)| at && open);
                let side = if on_border { Side::Mixed } else { self.side(a, b, n_u) };
                if let Some(part) = part {
                    self.add(&part, number, side);
                }
            }
        }
    }

    fn part_box(
        &mut self,
        view: &MeshView,
        mesh: &WorldMesh,
        patch: PatchId,
        rates: &PatchRates,
        i: [u32; 2],
        j: [u32; 2],
    ) -> Option<ScreenBox> {
        // A part's cells are a part of the patch: as many splits lead to a quarter of its size.
        let largest = (i[1] - i[0]).max(j[1] - j[0]);
        let depth = (rates.n_u.max(rates.n_v) / largest).ilog2() + BOX_DEPTH;
        let bounds = self.dicer.bounds(mesh.surface(), patch, rates, i, j, depth);
        self.project(view, bounds)
    }

    /// `None` if all of the box lies behind the eye.
    fn project(&self, view: &MeshView, b: Bounds) -> Option<ScreenBox> {
        let near = NEAR * self.camera.focus_distance();
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let corners: [DVec3; 8] = std::array::from_fn(|k| {
            let pick = |axis: usize, a: f64, b: f64| if k >> axis & 1 == 0 { a } else { b };
            let p = DVec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z));
            view.view_from_lattice.transform_point3(p)
        });
        let mut screen = ScreenBox {
            min: DVec2::splat(f64::INFINITY),
            max: DVec2::splat(f64::NEG_INFINITY),
            nearest: f64::INFINITY,
        };
        for (k, &a) in corners.iter().enumerate() {
            if a.z >= near {
                screen.grow(self.camera.raster_from_view(a, self.size), a.z);
            }
            for axis in 0..3 {
                let b = corners[k | 1 << axis];
                if (a.z >= near) != (b.z >= near) {
                    let on_plane = a.lerp(b, (near - a.z) / (b.z - a.z));
                    screen.grow(self.camera.raster_from_view(DVec3 { z: near, ..on_plane }, self.size), near);
                }
            }
        }
        (screen.nearest < f64::INFINITY).then_some(screen)
    }

    fn find_cosines(
        &mut self,
        view: &MeshView,
        mesh: &WorldMesh,
        patch: PatchId,
        (n_u, n_v): (u32, u32),
        place: impl Fn(u32, u32) -> (f64, f64),
    ) {
        self.cosines.clear();
        for b in 0..=n_v {
            for a in 0..=n_u {
                let (u, v) = place(a, b);
                let sample = self.dicer.sample(mesh.surface(), patch, u, v);
                let normal = view.view_from_lattice_normal * sample.du.cross(sample.dv);
                let to_eye = -view.view_from_lattice.transform_point3(sample.position);
                let known = sample.kind != SampleKind::PositionOnly;
                self.cosines.push(if known { normal.normalize().dot(to_eye.normalize()) } else { f64::NAN });
            }
        }
    }

    fn side(&self, a: u32, b: u32, n_u: u32) -> Side {
        let at = |da: u32, db: u32| self.cosines[((b + db) * (n_u + 1) + a + da) as usize];
        let corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
        if corners.iter().any(|c| c.is_nan()) {
            return Side::Mixed;
        }
        let (min, max) = corners.iter().fold((1.0_f64, -1.0_f64), |(min, max), &c| (min.min(c), max.max(c)));
        let needed = max - min + SIDE_MARGIN;
        match (min > needed, -max > needed) {
            (true, _) => Side::Outside,
            (_, true) => Side::Inside,
            _ => Side::Mixed,
        }
    }

    fn add(&mut self, part: &ScreenBox, patch: u32, side: Side) {
        let Some(pixels) = self.pixels(part) else { return };
        // Depths are compared with those of hits, which are f32 too.
        let nearest = (part.nearest * (1.0 - 1e-6)) as f32;
        for row in pixels.y0 / BLOCK..pixels.y1.div_ceil(BLOCK) {
            for column in pixels.x0 / BLOCK..pixels.x1.div_ceil(BLOCK) {
                let (x, y) = (column * BLOCK, row * BLOCK);
                let within = |value: u32, origin: u32| value.saturating_sub(origin).min(BLOCK) as u8;
                let rect = [within(pixels.x0, x), within(pixels.y0, y), within(pixels.x1, x), within(pixels.y1, y)];
                self.found.push((row * self.blocks[0] + column, Footprint { patch, nearest, rect, side }));
            }
        }
    }

    /// Pixels that a box reaches.
    fn pixels(&self, part: &ScreenBox) -> Option<PixelRect> {
        let [width, height] = self.blocks.map(|n| n * BLOCK);
        // Casts take what lies outside of the range of integers to its ends.
        let first = |min: f64| (min - ROUNDING).floor() as u32;
        let end = |max: f64, limit: u32| ((max + ROUNDING).floor() + 1.0).clamp(0.0, f64::from(limit)) as u32;
        let rect = PixelRect {
            x0: first(part.min.x),
            y0: first(part.min.y),
            x1: end(part.max.x, width),
            y1: end(part.max.y, height),
        };
        (rect.x0 < rect.x1 && rect.y0 < rect.y1).then_some(rect)
    }
}

impl ScreenBox {
    fn grow(&mut self, p: DVec2, depth: f64) {
        self.min = self.min.min(p);
        self.max = self.max.max(p);
        self.nearest = self.nearest.min(depth);
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
        twin == NONE || topology.is_hidden(crate::ids::FaceId(topology.face(twin)))
    };
    if n == 4 { [0, 1, 2, 3].map(is_open) } else { [is_open(sub), false, false, is_open(sub + n - 1)] }
}
