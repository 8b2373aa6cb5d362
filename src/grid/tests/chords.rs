//! Cones against every chord, and against rays that leave.

use super::slow::{meet, triangles};
use super::support::{Piece, Random, sheet, whole};
use crate::grid::{CellRect, ChordCone, LatticeRay, TriangleId};
use crate::ids::PatchId;
use glam::{DVec3, IVec3};

const PATCH: PatchId = PatchId(3);

/// A sheet of n_u x n_v cells like [`sheet`], with bumps of `bump` cells and a bend that rises by `bend` cells from the middle to the ends along u.
fn smooth(random: &mut Random, n_u: usize, n_v: usize, width: f64, bump: f64, bend: f64) -> Vec<[i32; 3]> {
    let flat = sheet(random, 2, 2, width);
    let at = |k: usize| IVec3::from_array(flat[k]).as_dvec3();
    let u = (at(1) - at(0)).normalize();
    let w = u.cross(at(3) - at(0)).normalize();
    let v = w.cross(u) + (random.unit() - 0.5) * u;
    let places = (0..=n_v).flat_map(|j| (0..=n_u).map(move |i| (i as f64, j as f64)));
    let points = places.map(|(i, j)| {
        let from_middle = 2.0 * i / n_u as f64 - 1.0;
        at(4) + width / 8.0 * (i * u + j * v + (bump * random.unit() + bend * from_middle * from_middle) * w)
    });
    points.map(|p| p.round().as_ivec3().to_array()).collect()
}

/// A cone's axis, and the tangent of its angle.
fn decoded(cone: ChordCone) -> Option<(DVec3, f64)> {
    let [x, y, z, sine] = cone.to_bits().to_le_bytes();
    let axis = DVec3::from_array([x, y, z].map(|x| f64::from(x.cast_signed()))).normalize();
    let sine = f64::from(sine) / 384.0;
    (cone != ChordCone::NONE).then(|| (axis, sine / (1.0 - sine * sine).sqrt()))
}

/// The steepest chord between any two points of the sheet that are looked at: all vertices, and points of triangles.
fn steepest(random: &mut Random, vertices: &[[i32; 3]], cells: CellRect, axis: DVec3) -> f64 {
    let mut points: Vec<DVec3> = vertices.iter().map(|v| IVec3::from_array(*v).as_dvec3()).collect();
    for (_, [a, b, c]) in triangles(vertices, cells, PATCH) {
        points.push(a + random.unit() * (b - a) * 0.5 + random.unit() * (c - a) * 0.5);
    }
    let mut steepest = 0.0f64;
    for (k, p) in points.iter().enumerate() {
        for q in &points[..k] {
            let height = axis.dot(q - p);
            steepest = steepest.max(height.abs() / (q - p - height * axis).length().max(1e-9));
        }
    }
    steepest
}

#[test]
fn no_chord_is_steeper_than_the_cone() {
    let mut random = Random(0xc0_4e5);
    let mut n_known = 0;
    for round in 0..300 {
        let (n_u, n_v) = (1 + round % 8, 1 + round / 8 % 8);
        let width = [60.0, 3000.0, 1e5, 1e6][round % 4];
        let (bump, bend) = ([0.0, 0.05, 0.15, 0.3][round / 2 % 4], [0.0, 0.5, 2.0][round % 3]);
        let (vertices, cells) = (smooth(&mut random, n_u, n_v, width, bump, bend), whole(n_u as u16, n_v as u16));
        let piece = Piece::new(&vertices, cells);
        let Some((axis, slope)) = decoded(ChordCone::of_pieces(std::iter::once(piece.view()))) else { continue };
        n_known += 1;
        let steepest = steepest(&mut random, &vertices, cells, axis);
        assert!(steepest <= slope, "round {round}: a chord of {steepest} in a cone of {slope}");
    }
    assert!(n_known > 150, "only {n_known} cones");
}

#[test]
fn no_edge_is_forgotten() {
    let mut random = Random(0xc0_4e9);
    for (n_u, n_v) in [(8, 8), (5, 3), (1, 8), (8, 1), (7, 6)] {
        let (flat, cells) = (smooth(&mut random, n_u, n_v, 3000.0, 0.0, 0.0), whole(n_u as u16, n_v as u16));
        let at = |k: usize| IVec3::from_array(flat[k]).as_dvec3();
        let (u, v) = ((at(1) - at(0)).normalize(), (at(n_u + 1) - at(0)).normalize());
        let up = 100.0 * u.cross(v).normalize();
        // Cells are stretched, so that one of the edges at the bump is steeper than the others.
        for (k, along) in (0..flat.len()).flat_map(|k| [(k, u), (k, v)]) {
            let stretched =
                |n: usize| at(n) + 4.0 * along.dot(at(n) - at(0)) * along + if n == k { up } else { DVec3::ZERO };
            let vertices: Vec<[i32; 3]> = (0..flat.len()).map(|n| stretched(n).round().as_ivec3().to_array()).collect();
            let piece = Piece::new(&vertices, cells);
            let cone = ChordCone::of_pieces(std::iter::once(piece.view()));
            let (axis, slope) = decoded(cone).expect("one bump leaves a cone");
            let steepest = steepest(&mut random, &vertices, cells, axis);
            assert!(
                0.02 < steepest && steepest <= slope,
                "{n_u} x {n_v}, {k}: a chord of {steepest} in a cone of {slope}"
            );
        }
    }
}

/// A grid with sides of `n` cells, cut into pieces.
fn pieces_of(vertices: &[[i32; 3]], n: usize) -> Vec<Piece> {
    let starts = || (0..n).step_by(8).map(|i| (i, (i + 8).min(n)));
    let of = |(i0, i1): (usize, usize), (j0, j1): (usize, usize)| {
        let places = (j0..=j1).flat_map(|j| (i0..=i1).map(move |i| j * (n + 1) + i));
        let part: Vec<[i32; 3]> = places.map(|k| vertices[k]).collect();
        Piece::new(&part, CellRect { i0: i0 as u16, j0: j0 as u16, i1: i1 as u16, j1: j1 as u16 })
    };
    starts().flat_map(|v| starts().map(move |u| of(u, v))).collect()
}

#[test]
fn pieces_of_one_grid_have_a_cone_together() {
    let mut random = Random(0xc0_4e6);
    for n in [9, 13, 16, 30] {
        let vertices = smooth(&mut random, n, n, 3000.0, 0.05, 1.0);
        let pieces = pieces_of(&vertices, n);
        let (axis, slope) =
            decoded(ChordCone::of_pieces(pieces.iter().map(Piece::view))).expect("a gentle sheet has a cone");
        let steepest = steepest(&mut random, &vertices, whole(n as u16, n as u16), axis);
        assert!(steepest <= slope, "{n}: a chord of {steepest} in a cone of {slope}");
        assert!(slope < 3.0 * steepest + 0.05, "{n}: {slope} for {steepest}");
    }
}

#[test]
fn rays_that_leave_by_the_cone_meet_nothing() {
    let mut random = Random(0xc0_4e7);
    let [mut n_left, mut n_met] = [0, 0];
    for round in 0..120 {
        let bend = [-2.0, 0.0, 1.0][round % 3];
        let (vertices, cells) = (smooth(&mut random, 8, 8, 1e5, 0.2, bend), whole(8, 8));
        let piece = Piece::new(&vertices, cells);
        let cone = ChordCone::of_pieces(std::iter::once(piece.view()));
        let all = triangles(&vertices, cells, PATCH);
        for _ in 0..40 {
            let (id, [a, b, c]) = all[(random.unit() * all.len() as f64) as usize];
            let (s, t) = (0.1 + 0.4 * random.unit(), 0.1 + 0.4 * random.unit());
            let side = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            let normal = side * (b - a).cross(c - a).normalize();
            let height = [1e-3, 1.0, 1e3, 1e5][(random.unit() * 4.0) as usize];
            let direction = random.point(1.0);
            let direction = direction * direction.dot(normal).signum();
            let start = a + s * (b - a) + t * (c - a) + height * normal;
            let ray = LatticeRay::new(start, direction, f32::INFINITY, id);
            let is_met = all.iter().any(|(other, corners)| {
                *other != id && meet(&ray, *corners).is_some_and(|m| m.t > 0.0 && m.inside > 0.0)
            });
            assert!(!(is_met && cone.is_left_by(&ray)), "round {round}, {height} above {id:?}: {direction}");
            n_left += usize::from(cone.is_left_by(&ray));
            n_met += usize::from(is_met);
        }
    }
    assert!(n_left > 1000 && n_met > 100, "{n_left} rays left, {n_met} met the sheet");
}

#[test]
fn surfaces_without_a_cone_are_not_left() {
    let up = LatticeRay::new(DVec3::ZERO, DVec3::Z, f32::INFINITY, TriangleId::NONE);
    let cone_of = |vertices: &[[i32; 3]]| {
        let piece = Piece::new(vertices, whole(2, 1));
        ChordCone::of_pieces(std::iter::once(piece.view()))
    };
    let flat = [[0, 0, 0], [10, 0, 0], [20, 0, 0], [0, 10, 0], [10, 10, 0], [20, 10, 0]];
    assert!(cone_of(&flat).is_left_by(&up));
    // A point, a line, a fold, a fan of edges that cross, and one too wide for floats.
    let [mut fold, mut crossed, mut wide] = [flat; 3];
    (fold[2], fold[5]) = ([10, 0, 10], [10, 10, 10]);
    crossed.swap(0, 2);
    wide[0] = [-(1 << 24), 0, 0];
    wide[2] = [1 << 24, 0, 0];
    let line = flat.map(|[x, _, _]| [x, x, 0]);
    for vertices in [[[5; 3]; 6], line, fold, crossed, wide] {
        let cone = cone_of(&vertices);
        assert!(cone == ChordCone::NONE && !cone.is_left_by(&up), "{vertices:?}: {cone:?}");
    }
}

#[test]
fn cones_come_back_from_their_bits() {
    let mut random = Random(0xc0_4e8);
    for _ in 0..50 {
        let piece = Piece::new(&smooth(&mut random, 5, 7, 1e4, 0.2, 0.3), whole(5, 7));
        let cone = ChordCone::of_pieces(std::iter::once(piece.view()));
        assert_eq!(ChordCone::from_bits(cone.to_bits()), cone);
        assert_ne!(cone.to_bits(), u32::MAX);
    }
    assert_eq!(ChordCone::from_bits(ChordCone::NONE.to_bits()), ChordCone::NONE);
}
