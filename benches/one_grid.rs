//! What does it cost to tessellate a patch, by the valence of its worst corner and by rate? `cargo bench --bench one_grid`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use lazytess::ids::PatchId;
use lazytess::math::LatticeGrid;
use lazytess::mesh::shapes;
use lazytess::subdiv::{Dicer, Surface};

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
