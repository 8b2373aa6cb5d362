//! Random control meshes, with and without hierarchical edits: the evaluation that dices grids against the slow
//! reference.
//!
//! `LAZYTESS_FUZZ=START..END cargo test --test fuzz_surface` tries other seeds. A failure is shrunk and printed as a
//! test.

use glam::DVec3;
use lazytess::ids::{FaceId, PatchId};
use lazytess::math::LatticeGrid;
use lazytess::mesh::ControlMesh;
use lazytess::mesh::random::{random_edits, random_mesh};
use lazytess::mesh::shrink::{as_test, shrink};
use lazytess::subdiv::dice::LATTICE_SHIFT;
use lazytess::subdiv::refine::{RefinedMesh, Sample, Tangents};
use lazytess::subdiv::surface::PatchPoints;
use lazytess::subdiv::{Dicer, Evaluator, PatchRates, SampleKind, Surface, SurfaceSample, snapped};

/// Where to compare.
#[derive(Clone, Copy)]
struct Places {
    points: &'static [[f64; 2]],
    /// Derivatives shorter than this share of the mesh's size may err as this long ones: deep down, where they come
    /// from differences, the reference has few digits left.
    short: f64,
}

/// Corners, edges, the middle, near a corner, and a place of no importance.
const USUAL: Places = Places {
    points: &[
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [0.5, 0.0],
        [0.0, 0.375],
        [0.5, 0.5],
        [0.015625, 0.03125],
        [0.8125, 0.6875],
    ],
    short: 1e-3,
};

/// A billionth of the patch from corners and edges, as whole numbers of what the reference can tell apart.
const NEAR_CORNERS: Places = Places {
    points: &[[A_BILLIONTH, 3.0 * A_BILLIONTH], [1.0 - A_BILLIONTH, 0.0], [0.25, 1.0 - A_BILLIONTH]],
    short: 0.03,
};
const A_BILLIONTH: f64 = 1.0 / (1u64 << 30) as f64;

/// Seeds beyond the usual ones that failed once.
const FAILED_ONCE: [u64; 1] = [
    // An edit on one half of an edge that leads back to its vertex.
    245,
];

fn seeds() -> impl Iterator<Item = u64> {
    let given = std::env::var("LAZYTESS_FUZZ").ok();
    let range = given.as_deref().and_then(|text| text.split_once(".."));
    let range = range.map_or(0..150, |(a, b)| a.parse().expect("START..END")..b.parse().expect("START..END"));
    FAILED_ONCE.into_iter().chain(range)
}

#[test]
fn diced_surface_is_the_reference_surface_on_random_meshes() {
    seeds().for_each(|seed| assert_same(seed, random_mesh(seed), USUAL));
}

#[test]
fn diced_surface_is_the_reference_surface_a_billionth_from_corners() {
    for seed in seeds().step_by(5) {
        let mesh = random_mesh(seed);
        let edits = if seed % 2 == 0 { random_edits(&mesh, seed) } else { Vec::new() };
        assert_same(seed, ControlMesh { edits, ..mesh }, NEAR_CORNERS);
    }
}

#[test]
fn diced_surface_is_the_reference_surface_under_random_edits() {
    for seed in seeds() {
        let mesh = random_mesh(seed);
        assert_same(seed, ControlMesh { edits: random_edits(&mesh, seed), ..mesh }, USUAL);
    }
}

fn assert_same(seed: u64, mesh: ControlMesh, places: Places) {
    if difference(&mesh, places).is_some() {
        let smallest = shrink(mesh, |m| difference(m, places).is_some());
        let why = difference(&smallest, places).expect("shrinking keeps the failure");
        panic!("seed {seed}: {why}\n{}", as_test(&smallest, &format!("seed_{seed}")));
    }
}

/// Where and how the two evaluations differ, if they do; a panic is a difference too.
fn difference(mesh: &ControlMesh, places: Places) -> Option<String> {
    std::panic::catch_unwind(|| compare(mesh, places)).unwrap_or_else(|_| Some("a panic, see above".into()))
}

fn compare(mesh: &ControlMesh, places: Places) -> Option<String> {
    let surface = Surface::new(mesh, 1).expect("the mesh is valid and small");
    let reference = RefinedMesh::from_control(mesh);
    let (mut points, mut evaluator) = (PatchPoints::default(), Evaluator::default());
    // Where all vertices are one point, f64 itself is the limit.
    let largest = mesh.bounds().max.abs().max(mesh.bounds().min.abs()).max_element();
    // Edits may lead far outside the control mesh's box.
    let half_extent = surface.lattice().step * f64::from(1 << 22);
    let tolerance = 1e-6 * mesh.bounds().diagonal().max(half_extent) + 1e-15 * largest;
    for (face, &size) in mesh.face_sizes.iter().enumerate() {
        let face = FaceId::from(face);
        for sub in 0..if size == 4 { 1 } else { size } {
            let patch = surface.patch_of(face, sub);
            if let Some(why) = diced_differs(&surface, patch, &mut points, &mut evaluator) {
                return Some(format!("face {face}, sub {sub}: {why}"));
            }
            for (uv, exact) in places.points.iter().zip(reference.limits_at(face, sub, places.points)) {
                let hidden = surface.edited().hide_point(patch, uv[0], uv[1]);
                if exact.is_some() == (hidden || !surface.is_visible(patch)) {
                    return Some(format!("face {face}, sub {sub}, uv {uv:?}: only one of the two has a surface"));
                }
                let Some(exact) = exact else { continue };
                surface.load(patch, &mut points);
                let sample = surface.sample(&mut points, &mut evaluator, uv[0], uv[1]);
                let distance = surface.lattice().to_object(sample.position).distance(exact.position);
                if distance.is_nan() || distance > tolerance {
                    return Some(format!("face {face}, sub {sub}, uv {uv:?}: {distance} away"));
                }
                if let Some(why) = tangents_differ(mesh, &surface, &sample, &exact, 1e6 * places.short * tolerance) {
                    return Some(format!("face {face}, sub {sub}, uv {uv:?}: {why}"));
                }
            }
        }
    }
    None
}

/// Vertices of a patch's grids are the surface's points, rounded to the lattice: half a step away, and a step where
/// rounding is left to the owner of a border.
fn diced_differs(
    surface: &Surface,
    patch: PatchId,
    points: &mut PatchPoints,
    evaluator: &mut Evaluator,
) -> Option<String> {
    if !surface.is_visible(patch) {
        return None;
    }
    let (mut dicer, mut grid) = (Dicer::default(), LatticeGrid::default());
    for n in [8, 12] {
        let rates = surface.uniform_rates(patch, n);
        dicer.dice(surface, patch, &rates, [0, rates.n_u], [0, rates.n_v], &mut grid);
        surface.load(patch, points);
        for (k, vertex) in grid.points().enumerate() {
            let [i, j] = [k as u32 % (rates.n_u + 1), k as u32 / (rates.n_u + 1)];
            let [u, v] = place_of(&rates, i, j);
            if surface.edited().hide_point(patch, u, v) {
                continue;
            }
            let exact = surface.sample(points, evaluator, u, v).position;
            let away = (DVec3::from_array(vertex.map(f64::from)) - LATTICE_SHIFT - exact).abs().max_element();
            if away.is_nan() || away > 1.0 {
                return Some(format!("vertex {i}, {j} at rate {n} is {away} steps away"));
            }
        }
    }
    None
}

/// Where vertex (i, j) of a grid is; on a side with fewer segments at one of its points.
fn place_of(rates: &PatchRates, i: u32, j: u32) -> [f64; 2] {
    let along = |i: u32, n: u32, rate: u32| f64::from(snapped(i, n, rate)) / f64::from(rate);
    let PatchRates { sides, n_u, n_v, .. } = *rates;
    let rate_of_u = if j == 0 {
        sides[0]
    } else if j == n_v {
        sides[2]
    } else {
        n_u
    };
    let rate_of_v = if i == n_u {
        sides[1]
    } else if i == 0 {
        sides[3]
    } else {
        n_v
    };
    [along(i, n_u, rate_of_u), along(j, n_v, rate_of_v)]
}

/// Derivatives may differ by 1e-4 of their length, or of `short` where that is more; directions by 1e-4.
fn tangents_differ(
    mesh: &ControlMesh,
    surface: &Surface,
    sample: &SurfaceSample,
    exact: &Sample,
    short: f64,
) -> Option<String> {
    let step = surface.lattice().step;
    let (found, wanted, least) = match (sample.kind, exact.tangents) {
        (SampleKind::Regular, Tangents::Derivatives(du, dv)) => ([step * sample.du, step * sample.dv], [du, dv], short),
        // Where vertices repeat, a tangent may be of no length, and its direction noise.
        (SampleKind::Extraordinary, Tangents::Directions(..)) if repeats_a_vertex(mesh) => return None,
        (SampleKind::Extraordinary, Tangents::Directions(du, dv)) => ([sample.du, sample.dv], [du, dv], 0.0),
        (SampleKind::PositionOnly, Tangents::Unknown) => return None,
        (kind, tangents) => return Some(format!("{kind:?} where the reference has {tangents:?}")),
    };
    let differs = |(a, b): (DVec3, DVec3)| a.distance(b) > 1e-4 * b.length().max(least);
    std::iter::zip(found, wanted).any(differs).then(|| format!("{found:?} instead of {wanted:?}"))
}

fn repeats_a_vertex(mesh: &ControlMesh) -> bool {
    mesh.faces().any(|face| (1..face.len()).any(|k| face[..k].contains(&face[k])))
}
