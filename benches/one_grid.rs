//! What does it cost to tessellate a patch, by the valence of its worst corner and by rate, and to build its blocks on
//! a cache miss? `cargo bench --bench one_grid`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::DVec3;
use lazytess::grid::{CellRect, PieceLayout, encode_node, node_bytes};
use lazytess::ids::{PatchId, VertexId};
use lazytess::math::{Envelope, LatticeGrid};
use lazytess::mesh::{ControlMesh, Crease, shapes};
use lazytess::subdiv::{Dicer, EqualParts, PatchRates, Surface};

/// Cells of a piece along its sides.
const PIECE: u32 = 8;

fn main() {
    divan::main();
}

/// All pieces of a patch with one corner of this valence, diced one by one as rays would ask for them.
#[divan::bench(args = [3, 4, 5, 8, 32, 128], consts = [8, 16, 64])]
fn dice<const RATE: u32>(bencher: Bencher, valence: u32) {
    let surface = Surface::new(&shapes::quad_pole(valence), 1).expect("a sound mesh");
    let (mut dicer, mut vertices) = (Dicer::default(), LatticeGrid::default());
    let rates = surface.uniform_rates(PatchId(0), RATE);
    bencher.counter(ItemsCount::new(rates.n_triangles())).bench_local(|| {
        for j in (0..RATE).step_by(PIECE as usize) {
            for i in (0..RATE).step_by(PIECE as usize) {
                dicer.dice(&surface, PatchId(0), &rates, [i, i + PIECE], [j, j + PIECE], &mut vertices);
                black_box(vertices.point(0, 0));
            }
        }
    });
}

/// Meshes whose patches are all of one kind, and many more than a dicer remembers.
fn mesh_of(kind: &str) -> ControlMesh {
    match kind {
        "regular" => shapes::torus(16, 12, 1.0, 0.4),
        "valence 3" => copies(&shapes::cube_sphere(2), 8),
        "valence 5" => copies(&shapes::quad_pole(5), 40),
        "crease" => copies(&shapes::crease_loop_cube(2.5), 32),
        _ => unreachable!("no such kind"),
    }
}

const KINDS: [&str; 4] = ["regular", "valence 3", "valence 5", "crease"];

/// `n` copies of a mesh beside each other.
fn copies(one: &ControlMesh, n: u32) -> ControlMesh {
    let n_vertices = one.positions.len() as u32;
    let mut all = one.clone();
    for k in 1..n {
        let moved = |v: &VertexId| VertexId(v.0 + k * n_vertices);
        all.positions.extend(one.positions.iter().map(|p| p + f64::from(k) * DVec3::X));
        all.face_sizes.extend(&one.face_sizes);
        all.face_vertices.extend(one.face_vertices.iter().map(moved));
        let creases = one.creases.iter().map(|c| Crease { edge: [moved(&c.edge[0]), moved(&c.edge[1])], ..*c });
        all.creases.extend(creases);
    }
    all
}

/// Rate of the patches whose blocks are built: a node and four pieces each.
const RATE: u32 = 16;

/// What a thread needs to build blocks.
#[derive(Default)]
struct Builder {
    dicer: Dicer,
    vertices: LatticeGrid,
    envelopes: Vec<Envelope>,
    block: Vec<u64>,
}

impl Builder {
    fn new() -> Self {
        Self { block: vec![0; 128], ..Default::default() }
    }

    /// The node over a patch.
    fn node(&mut self, surface: &Surface, patch: PatchId, rates: &PatchRates) {
        self.envelopes.clear();
        let parts = EqualParts { from: [0, 0], n: [2, 2], side: PIECE };
        assert!(self.dicer.envelopes_of_parts(surface, patch, rates, parts, 4, &mut self.envelopes));
        let cells = CellRect { i0: 0, j0: 0, i1: RATE as u16, j1: RATE as u16 };
        let children = [2, 2];
        let block = &mut bytemuck::cast_slice_mut(&mut self.block)[..node_bytes(children)];
        encode_node(cells, children, &self.envelopes, block);
        black_box(&self.block);
    }

    /// A piece.
    fn piece(&mut self, surface: &Surface, patch: PatchId, rates: &PatchRates, i: u32, j: u32) {
        self.dicer.dice(surface, patch, rates, [i, i + PIECE], [j, j + PIECE], &mut self.vertices);
        let [i0, j0, i1, j1] = [i, j, i + PIECE, j + PIECE].map(|x| x as u16);
        let layout = PieceLayout::new(&self.vertices, CellRect { i0, j0, i1, j1 }, [RATE as u16; 2]);
        layout.encode(&self.vertices, &mut bytemuck::cast_slice_mut(&mut self.block)[..layout.bytes()]);
        black_box(&self.block);
    }
}

/// The node and the pieces of every patch of a mesh, one patch after the other; an item is a block.
#[divan::bench(args = KINDS)]
fn blocks(bencher: Bencher, kind: &str) {
    let surface = Surface::new(&mesh_of(kind), 1).expect("a sound mesh");
    let mut builder = Builder::new();
    bencher.counter(ItemsCount::new(5 * surface.n_patches())).bench_local(|| {
        for patch in surface.visible_patches() {
            let rates = surface.uniform_rates(patch, RATE);
            builder.node(&surface, patch, &rates);
            for (i, j) in [(0, 0), (PIECE, 0), (0, PIECE), (PIECE, PIECE)] {
                builder.piece(&surface, patch, &rates, i, j);
            }
        }
    });
}

/// Only the nodes.
#[divan::bench(args = KINDS)]
fn nodes(bencher: Bencher, kind: &str) {
    let surface = Surface::new(&mesh_of(kind), 1).expect("a sound mesh");
    let mut builder = Builder::new();
    bencher.counter(ItemsCount::new(surface.n_patches())).bench_local(|| {
        for patch in surface.visible_patches() {
            builder.node(&surface, patch, &surface.uniform_rates(patch, RATE));
        }
    });
}
