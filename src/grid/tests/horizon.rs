//! Horizons against every chord, and against rays that leave.

use super::slow::{meet, triangles};
use super::support::{Piece, Random, sheet, whole};
use crate::grid::{Borders, CellRect, Horizon, LatticeRay, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::{self, Kernel, Portable, Task};
use glam::{DVec2, DVec3, IVec3};

const PATCH: PatchId = PatchId(3);

/// A triangle that every grid has.
fn first() -> TriangleId {
    TriangleId::new(PATCH, 0, 0, 0)
}

/// A sheet of n_u x n_v cells like [`sheet`], with bumps of `bump` cells and a bend that rises by `bend` cells from the
/// middle to the ends along u.
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

/// Rays from all over a sheet, up and down, so that horizons of both sides are asked for.
fn from_somewhere(random: &mut Random, vertices: &[[i32; 3]], cells: CellRect) -> LatticeRay {
    let all = triangles(vertices, cells, PATCH);
    let (id, [a, b, c]) = all[(random.unit() * all.len() as f64) as usize];
    LatticeRay::new((a + b + c) / 3.0, random.point(1.0), f32::INFINITY, id)
}

fn horizon_of(pieces: &[Piece], cells: CellRect, ray: &LatticeRay) -> Horizon {
    Horizon::of_pieces(pieces.iter().map(Piece::view), &Borders { cells, moved: Default::default() }, ray)
}

/// A horizon in f64.
struct Decoded {
    ways: [DVec3; 2],
    up: DVec3,
    parts_per_cell: [f64; 2],
    rises: [[[f64; 4]; 2]; 2],
    /// By 4 u + v.
    is_ravine: [bool; 16],
}

/// What nobody clears.
const NEVER: f64 = 126.0;

impl Decoded {
    fn new(horizon: Horizon) -> Self {
        let bytes: Vec<u8> = horizon.to_words().into_iter().flat_map(u64::to_ne_bytes).collect();
        let vector = |at: usize| DVec3::from_array(std::array::from_fn(|k| f64::from(bytes[at + k]) - 128.0));
        let (u, v) = (vector(0), vector(4));
        let is_ravine = std::array::from_fn(|k| bytes[8 + k] & 1 != 0);
        let up = if bytes[3] >= 128 { v.cross(u) } else { u.cross(v) };
        let rise =
            |axis: usize, way: usize, part: usize| f64::from(bytes[8 + 8 * axis + 4 * way + part].cast_signed() & !1);
        let rises = [0, 1].map(|axis| [0, 1].map(|way| [0, 1, 2, 3].map(|part| rise(axis, way, part))));
        Self {
            ways: [u, v],
            up,
            parts_per_cell: [bytes[3] & 127, bytes[7]].map(|n| f64::from(n) / 64.0),
            rises,
            is_ravine,
        }
    }

    /// How high the line along `way` is over the horizon from a cell, in the length of the way; `None` if nobody clears
    /// it.
    fn height(&self, cell: [u32; 2], way: DVec3) -> Option<f64> {
        let mut height = self.up.dot(way);
        let part = |axis: usize| (f64::from(cell[axis]) * self.parts_per_cell[axis]) as usize;
        if self.is_ravine[4 * part(0) + part(1)] {
            return None;
        }
        for axis in 0..2 {
            let part = part(axis);
            let along = self.ways[axis].dot(way);
            let rise = self.rises[axis][usize::from(along < 0.0)][part];
            if rise == NEVER {
                return None;
            }
            height -= rise * along.abs();
        }
        Some(height / (self.up.length() * way.length()))
    }
}

/// How high the highest chord is over the horizon, of those between all vertices of triangles and points of them that
/// are looked at, as far as rays from where it starts may clear the horizon.
fn highest_chord(random: &mut Random, vertices: &[[i32; 3]], cells: CellRect, horizon: Horizon) -> f64 {
    let decoded = Decoded::new(horizon);
    let of_triangle = |(id, [a, b, c]): (TriangleId, [DVec3; 3])| {
        let inside = a + random.unit() * (b - a) * 0.5 + random.unit() * (c - a) * 0.5;
        [a, b, c, inside].map(|p| ([id.i(), id.j()], p))
    };
    let points: Vec<_> = triangles(vertices, cells, PATCH).into_iter().flat_map(of_triangle).collect();
    let mut highest = f64::NEG_INFINITY;
    for (cell, p) in &points {
        for (_, q) in points.iter().filter(|(_, q)| q != p) {
            highest = highest.max(decoded.height(*cell, q - p).unwrap_or(f64::NEG_INFINITY));
        }
    }
    highest
}

#[test]
fn no_chord_is_above_the_horizon() {
    let mut random = Random(0xc0_4e5);
    let mut n_known = 0;
    for round in 0..300 {
        let (n_u, n_v) = (1 + round % 8, 1 + round / 8 % 8);
        let width = [60.0, 3000.0, 1e5, 1e6][round % 4];
        let (bump, bend) = ([0.0, 0.05, 0.15, 0.3][round / 2 % 4], [0.0, 0.5, 2.0, -2.0][round / 3 % 4]);
        let (vertices, cells) = (smooth(&mut random, n_u, n_v, width, bump, bend), whole(n_u as u16, n_v as u16));
        let ray = from_somewhere(&mut random, &vertices, cells);
        let horizon = horizon_of(&[Piece::new(&vertices, cells)], cells, &ray);
        n_known += usize::from(horizon != Horizon::NONE);
        let highest = highest_chord(&mut random, &vertices, cells, horizon);
        assert!(highest <= 0.0, "round {round}: a chord of {highest}: {horizon:?}");
    }
    assert!(n_known > 200, "only {n_known} horizons");
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
            let ray = LatticeRay::new(at(0) + up, if k % 2 == 0 { up } else { -up }, f32::INFINITY, first());
            let horizon = horizon_of(&[Piece::new(&vertices, cells)], cells, &ray);
            assert_ne!(horizon, Horizon::NONE, "one bump leaves a horizon");
            let highest = highest_chord(&mut random, &vertices, cells, horizon);
            assert!(-0.1 < highest && highest <= 0.0, "{n_u} x {n_v}, {k}: a chord of {highest}: {horizon:?}");
        }
    }
}

/// A grid of `n_u` x `n_v` cells, cut into pieces.
fn pieces_of(vertices: &[[i32; 3]], [n_u, n_v]: [usize; 2]) -> Vec<Piece> {
    let starts = |n: usize| (0..n).step_by(8).map(move |i| (i, (i + 8).min(n)));
    let of = |(i0, i1): (usize, usize), (j0, j1): (usize, usize)| {
        let places = (j0..=j1).flat_map(|j| (i0..=i1).map(move |i| j * (n_u + 1) + i));
        let part: Vec<[i32; 3]> = places.map(|k| vertices[k]).collect();
        Piece::new(&part, CellRect { i0: i0 as u16, j0: j0 as u16, i1: i1 as u16, j1: j1 as u16 })
    };
    starts(n_v).flat_map(|v| starts(n_u).map(move |u| of(u, v))).collect()
}

#[test]
fn pieces_of_one_grid_have_a_horizon_together() {
    let mut random = Random(0xc0_4e6);
    for (n, bend) in [(9, 1.0), (13, -1.0), (16, 3.0), (30, -3.0)] {
        let (vertices, cells) = (smooth(&mut random, n, n, 3000.0, 0.05, bend), whole(n as u16, n as u16));
        let ray = from_somewhere(&mut random, &vertices, cells);
        let horizon = horizon_of(&pieces_of(&vertices, [n, n]), cells, &ray);
        assert_ne!(horizon, Horizon::NONE, "a gentle sheet has a horizon");
        let highest = highest_chord(&mut random, &vertices, cells, horizon);
        assert!(-0.05 < highest && highest <= 0.0, "{n}: a chord of {highest}: {horizon:?}");
    }
}

/// A bent sheet whose sides have fewer segments than its grid: as patches have beside coarser ones.
#[test]
fn sides_with_fewer_segments_do_not_spoil_the_horizon() {
    let mut random = Random(0xc0_4eb);
    let [mut n_known, mut n_cleared] = [0, 0];
    for round in 0..200 {
        let n = [0, 1].map(|_| 1 + (random.unit() * 20.0) as u32);
        let sides = [0, 1, 2, 3].map(|side| {
            let n = n[side % 2];
            if random.unit() < 0.3 { n } else { 1 + (random.unit() * f64::from(n)) as u32 }
        });
        let moved = [0, 1, 2, 3].map(|side| {
            let (n, rate) = (n[side % 2], sides[side]);
            let place = |k: u32| f64::from((2 * k * rate + n) / (2 * n) * n) / f64::from(rate);
            if rate == n { Vec::new() } else { (0..=n).map(place).collect() }
        });
        let place = |[i, j]: [u32; 2]| {
            let mut place = DVec2::new(f64::from(i), f64::from(j));
            let sides = [(j == 0, 0), (i == n[0], 1), (j == n[1], 2), (i == 0, 3)];
            for (_, side) in sides.into_iter().filter(|(is_there, side)| *is_there && !moved[*side].is_empty()) {
                place[side % 2] = moved[side][[i, j][side % 2] as usize];
            }
            place
        };
        let (bend, twist) = (2.0 * random.unit() - 1.0, random.unit() - 0.5);
        let [ridge, at_x, at_y] = [0, 1, 2].map(|_| random.unit() - 0.5);
        let point = |at: DVec2| {
            let [x, y] = [at.x / f64::from(n[0]) - 0.5, at.y / f64::from(n[1]) - 0.5];
            let fold = ridge * ((x - at_x).clamp(0.0, 0.25) + (y - at_y).clamp(0.0, 0.25));
            1e5 * DVec3::new(x + 0.2 * y, y, bend * x * x + twist * x * y + fold)
        };
        let of = |[i, j]: [u32; 2]| point(place([i, j])).round().as_ivec3().to_array();
        let vertices: Vec<[i32; 3]> = (0..=n[1]).flat_map(|j| (0..=n[0]).map(move |i| [i, j])).map(of).collect();
        let cells = whole(n[0] as u16, n[1] as u16);
        let ray = from_somewhere(&mut random, &vertices, cells);
        let pieces = pieces_of(&vertices, n.map(|n| n as usize));
        let borders = Borders { cells, moved };
        let horizon = Horizon::of_pieces(pieces.iter().map(Piece::view), &borders, &ray);
        n_known += usize::from(horizon != Horizon::NONE);
        let highest = highest_chord(&mut random, &vertices, cells, horizon);
        assert!(highest <= 0.0, "round {round}, {n:?}, {sides:?}: a chord of {highest}: {horizon:?}");
        let up = LatticeRay::new(DVec3::ZERO, DVec3::Z, f32::INFINITY, first());
        n_cleared += usize::from(horizon.is_cleared_by(Portable, &up));
    }
    // Half of the horizons are those of the other side.
    assert!(n_known > 150 && n_cleared > 60, "{n_known} horizons, {n_cleared} cleared");
}

#[test]
fn rays_that_clear_the_horizon_meet_nothing() {
    let mut random = Random(0xc0_4e7);
    let [mut n_left, mut n_met, mut n_rays] = [0, 0, 0];
    for round in 0..160 {
        let bend = [-4.0, -2.0, 0.0, 1.0, 3.0][round % 5];
        let (vertices, cells) = (smooth(&mut random, 8, 8, 1e5, 0.2, bend), whole(8, 8));
        let pieces = [Piece::new(&vertices, cells)];
        let all = triangles(&vertices, cells, PATCH);
        let mut horizon = None;
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
            // The first ray says for which side.
            let horizon = *horizon.get_or_insert_with(|| horizon_of(&pieces, cells, &ray));
            let is_cleared = horizon.is_cleared_by(Portable, &ray);
            assert_eq!(is_cleared, simd::run(IsCleared(horizon, &ray)));
            let is_met = all.iter().any(|(other, corners)| {
                *other != id && meet(&ray, *corners).is_some_and(|m| m.t > 0.0 && m.inside > 0.0)
            });
            assert!(!(is_met && is_cleared), "round {round}, {height} above {id:?}: {direction}: {horizon:?}");
            n_left += usize::from(is_cleared);
            n_met += usize::from(is_met);
            n_rays += 1;
        }
    }
    // Half of them are on the other side.
    assert!(n_left * 4 > n_rays && n_met > 100, "{n_left} of {n_rays} rays left, {n_met} met the sheet");
}

struct IsCleared<'a>(Horizon, &'a LatticeRay);

impl Task for IsCleared<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> bool {
        self.0.is_cleared_by(k, self.1)
    }
}

/// A cylinder seen from outside: no ray that leaves upwards meets it, and only where a part bends are there some that
/// are kept.
#[test]
fn convex_surfaces_are_left_by_nearly_all_rays() {
    let at = |i: usize, j: usize| {
        let angle = (i as f64 / 16.0 - 0.5) * 1.2;
        1e5 * DVec3::new(angle.sin(), j as f64 / 16.0, angle.cos())
    };
    let vertices: Vec<[i32; 3]> =
        (0..=16).flat_map(|j| (0..=16).map(move |i| at(i, j).round().as_ivec3().to_array())).collect();
    let (pieces, cells) = (pieces_of(&vertices, [16, 16]), whole(16, 16));
    let mut random = Random(0xc0_4ea);
    let outwards = LatticeRay::new(at(0, 0), at(0, 0), f32::INFINITY, first());
    let horizon = horizon_of(&pieces, cells, &outwards);
    let all = triangles(&vertices, cells, PATCH);
    let n_left = (0..1000).filter(|_| {
        let (id, [a, b, c]) = all[(random.unit() * all.len() as f64) as usize];
        let normal = (b - a).cross(c - a).normalize();
        // As many as a diffuse surface sends.
        let direction = normal + random.point(1.0).normalize();
        let start = (a + b + c) / 3.0 + normal * normal.dot(a).signum();
        let ray = LatticeRay::new(start, direction * normal.dot(a).signum(), f32::INFINITY, id);
        horizon.is_cleared_by(Portable, &ray)
    });
    assert!(n_left.count() > 950);
}

/// A point above one wall of a ravine, along the wall's normal, may be behind the other wall.
#[test]
fn steep_ravines_are_not_left() {
    for (slope, up, is_left) in [(0.5, 1.0, true), (0.5, -1.0, true), (1.8, 1.0, false), (1.8, -1.0, false)] {
        let at = |i: i32, j: i32| [10_000 * i, 10_000 * j, (f64::from((i - 4).abs()) * 1e4 * slope * up) as i32];
        let vertices: Vec<[i32; 3]> = (0..=8).flat_map(|j| (0..=8).map(move |i| at(i, j))).collect();
        let (cells, from) = (whole(8, 8), TriangleId::new(PATCH, 2, 4, 0));
        let [a, b, c] = triangles(&vertices, cells, PATCH).into_iter().find(|(id, _)| *id == from).unwrap().1;
        let start = (a + b + c) / 3.0 + 6e4 * up * (b - a).cross(c - a).normalize();
        let ray = LatticeRay::new(start, DVec3::new(-1.0, 0.0, 3.0 * up), f32::INFINITY, from);
        let horizon = horizon_of(&[Piece::new(&vertices, cells)], cells, &ray);
        let meets = |(_, corners)| meet(&ray, corners).is_some_and(|m| m.t > 0.0 && m.inside > 0.0);
        assert_eq!(triangles(&vertices, cells, PATCH).into_iter().any(meets), !is_left);
        assert_eq!(horizon.is_cleared_by(Portable, &ray), is_left, "{slope}, {up}: {horizon:?}");
    }
}

/// The same where the other wall is so steep that nobody clears it, while the way to this side is free.
#[test]
fn ravines_with_one_wall_too_steep_to_clear_are_not_left() {
    let at = |i: i32, j: i32| match i {
        0..=4 => [10_000 * i, 10_000 * j, 10_000 * (4 - i)],
        _ => [40_000 + 2_500 * (i - 4), 10_000 * j, 10_000 * (i - 4)],
    };
    let vertices: Vec<[i32; 3]> = (0..=8).flat_map(|j| (0..=8).map(move |i| at(i, j))).collect();
    let (cells, from) = (whole(8, 8), TriangleId::new(PATCH, 3, 4, 0));
    let [a, b, c] = triangles(&vertices, cells, PATCH).into_iter().find(|(id, _)| *id == from).unwrap().1;
    let start = (a + b + c) / 3.0 + 1.7e4 * (b - a).cross(c - a).normalize();
    let ray = LatticeRay::new(start, DVec3::new(-1.0, 0.0, 1.5), f32::INFINITY, from);
    let horizon = horizon_of(&[Piece::new(&vertices, cells)], cells, &ray);
    let meets = |(_, corners)| meet(&ray, corners).is_some_and(|m| m.t > 0.0 && m.inside > 0.0);
    assert!(triangles(&vertices, cells, PATCH).into_iter().any(meets));
    assert!(!horizon.is_cleared_by(Portable, &ray), "{horizon:?}");
}

#[test]
fn surfaces_without_a_horizon_are_not_left() {
    let up = LatticeRay::new(DVec3::ZERO, DVec3::Z, f32::INFINITY, first());
    let horizon_of = |vertices: &[[i32; 3]]| horizon_of(&[Piece::new(vertices, whole(2, 1))], whole(2, 1), &up);
    let flat = [[0, 0, 0], [10, 0, 0], [20, 0, 0], [0, 10, 0], [10, 10, 0], [20, 10, 0]];
    assert!(horizon_of(&flat).is_cleared_by(Portable, &up));
    // A point, a line, a fold, a fan of edges that cross, and one too wide for floats.
    let [mut fold, mut crossed, mut wide] = [flat; 3];
    (fold[2], fold[5]) = ([5, 0, 10], [5, 10, 10]);
    crossed.swap(0, 2);
    wide[0] = [-(1 << 24), 0, 0];
    wide[2] = [1 << 24, 0, 0];
    let line = flat.map(|[x, _, _]| [x, x, 0]);
    for vertices in [[[5; 3]; 6], line, fold, crossed, wide] {
        let horizon = horizon_of(&vertices);
        assert!(!horizon.is_cleared_by(Portable, &up), "{vertices:?}: {horizon:?}");
    }
    assert!(!Horizon::NONE.is_cleared_by(Portable, &up));
}

#[test]
fn triangles_that_are_not_there_stop_nothing() {
    let piece = Piece::new(&smooth(&mut Random(0xc0_4e8), 5, 7, 1e4, 0.1, 0.3), whole(5, 7));
    for (i, j) in [(5, 0), (0, 7), (4095, 4095)] {
        let ray = LatticeRay::new(DVec3::ZERO, DVec3::Z, f32::INFINITY, TriangleId::new(PATCH, i, j, 1));
        let horizon = horizon_of(std::slice::from_ref(&piece), whole(5, 7), &ray);
        assert_eq!(Horizon::from_words(horizon.to_words()), horizon);
        horizon.is_cleared_by(Portable, &ray);
    }
}
