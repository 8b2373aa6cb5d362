//! How long from a file on disk to a mesh that can be traced? `cargo bench --bench load`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::DAffine3;
use lazytess::io::obj::read_obj;
use lazytess::io::obj_write::write_obj;
use lazytess::mesh::{ControlMesh, shapes};
use lazytess::scene::rate::DicingRate;
use lazytess::scene::world::WorldMesh;

fn main() {
    divan::main();
}

/// A torus of 2 n x n quads.
fn torus(n: u32) -> ControlMesh {
    shapes::torus(2 * n, n, 3.0, 1.0)
}

/// Reading an OBJ file.
#[divan::bench(args = [20, 200])]
fn read(bencher: Bencher, n: u32) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("torus.obj");
    write_obj(&path, |out| out.mesh(&torus(n))).expect("room on the disk");
    bencher.counter(ItemsCount::new(2 * n * n)).bench(|| black_box(read_obj(&path)).expect("a sound file"));
}

/// Topology, plans, boxes and tree of a mesh that has been read.
#[divan::bench(args = [20, 200])]
fn prepare(bencher: Bencher, n: u32) {
    bencher
        .counter(ItemsCount::new(2 * n * n))
        .with_inputs(|| torus(n))
        .bench_values(|mesh| WorldMesh::new(mesh, DAffine3::IDENTITY, DicingRate::Fixed(8), 1).expect("a sound mesh"));
}
