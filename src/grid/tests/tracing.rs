//! Hits against the slow tracer, and the kernels against each other.

use super::slow::{Meeting, meet, triangles};
use super::support::{Piece, Random, sheet, whole};
use crate::grid::{LatticeHit, LatticeRay, PieceView, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, Portable, Task, run};
use glam::{DVec3, IVec3};

const PATCH: PatchId = PatchId(7);

/// Closest hit and occlusion of a ray in a piece.
struct Trace<'a>(PieceView<'a>, &'a LatticeRay);

impl Task for Trace<'_> {
    type Output = (LatticeHit, bool);
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> (LatticeHit, bool) {
        let mut hit = LatticeHit::none(self.1.t_max());
        self.0.closest(kernel, self.1, PATCH, &mut hit);
        (hit, self.0.occluded(kernel, self.1, PATCH))
    }
}

fn trace(piece: PieceView, ray: &LatticeRay) -> LatticeHit {
    let (hit, is_occluded) = run(Trace(piece, ray));
    let portable = Trace(piece, ray).run(Portable);
    assert_eq!((hit, is_occluded), portable, "the kernels differ: {ray:?}");
    assert_eq!(hit.is_some(), is_occluded, "closest and occluded differ: {ray:?}");
    hit
}

fn open_ray(origin: DVec3, direction: DVec3) -> LatticeRay {
    LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE)
}

/// A ray that is aimed at a vertex, an edge, or somewhere in a sheet; some along an axis, some grazing, some from a
/// vertex.
fn aimed(random: &mut Random, vertices: &[[i32; 3]], width: f64, round: usize) -> LatticeRay {
    let mut vertex = || IVec3::from_array(vertices[(random.unit() * vertices.len() as f64) as usize]).as_dvec3();
    let (a, b, c) = (vertex(), vertex(), vertex());
    let target = match round % 3 {
        0 => a,
        1 => 0.5 * (a + b),
        _ => a + 0.3 * (b - a) + 0.4 * (c - a),
    };
    match round / 3 % 5 {
        0 => {
            let origin = target + random.point(4.0 * width);
            open_ray(origin, target - origin)
        }
        1 => open_ray(c, target - c),
        2 => {
            let axis = [DVec3::X, DVec3::NEG_Y, DVec3::new(-0.0, 0.0, -1.0)][round / 15 % 3];
            open_ray(target - width * axis, axis)
        }
        3 => {
            let origin = target + (b - c) + 1e-7 * random.point(width);
            open_ray(origin, target - origin)
        }
        _ => {
            let origin = random.point(1.6e7);
            open_ray(origin, target - origin)
        }
    }
}

/// How far, across the ray, the kernels may be off: the perturbation of vertices in `LatticeRay`'s argument, and a
/// little.
fn blur(ray: &LatticeRay, width: f64) -> f64 {
    let far = ray.near_origin[..3].iter().fold(0.0f64, |m, o| m.max(f64::from(o.abs())));
    (far + 1.7e7) * 8.0 * f64::powi(2.0, -24) + 1e-6 * width
}

/// What is wrong with `hit`, if anything.
fn objection(ray: &LatticeRay, hit: &LatticeHit, meetings: &[(TriangleId, Meeting)], blur: f64) -> Option<String> {
    let slack = |m: &Meeting| 4.0 * blur * m.t_per_unit + 1e-6 * m.t.abs();
    let missed = meetings.iter().find(|(id, m)| {
        *id != ray.skip && m.inside > blur * m.t_per_unit && m.t > slack(m) && m.t < f64::from(hit.t) - slack(m)
    });
    if let Some((id, m)) = missed {
        return Some(format!("{id:?} at {} was passed, hit {hit:?}", m.t));
    }
    let (_, m) = meetings.iter().find(|(id, _)| *id == hit.triangle)?;
    let is_near = m.inside > -blur * m.t_per_unit && (m.t - f64::from(hit.t)).abs() <= slack(m);
    (!is_near).then(|| format!("{hit:?} but t {}, inside {}, blur {blur}", m.t, m.inside))
}

#[test]
fn the_nearest_triangle_is_hit_whatever_the_ray() {
    let mut random = Random(11);
    for sheet_nr in 0..60 {
        let (n_u, n_v) = (1 + sheet_nr % 8, 1 + sheet_nr / 8 % 8);
        let width = [600.0, 2e4, 3e6][sheet_nr % 3];
        let vertices = sheet(&mut random, n_u, n_v, width);
        let piece = Piece::new(&vertices, whole(n_u as u16, n_v as u16));
        let all = triangles(&vertices, whole(n_u as u16, n_v as u16), PATCH);
        for round in 0..900 {
            let ray = aimed(&mut random, &vertices, width, round);
            let hit = trace(piece.view(), &ray);
            let meetings: Vec<_> = all.iter().filter_map(|(id, t)| meet(&ray, *t).map(|m| (*id, m))).collect();
            let objection = objection(&ray, &hit, &meetings, blur(&ray, width));
            assert_eq!(objection, None, "sheet {sheet_nr}, round {round}: {ray:?}");
        }
    }
}

#[test]
fn weights_and_normal_belong_to_the_triangle() {
    let mut random = Random(12);
    let vertices = sheet(&mut random, 8, 8, 3e6);
    let piece = Piece::new(&vertices, whole(8, 8));
    let mut n_hits = 0;
    for (id, [a, b, c]) in triangles(&vertices, whole(8, 8), PATCH) {
        let target = a + 0.2 * (b - a) + 0.3 * (c - a);
        let normal = (b - a).cross(c - a);
        let ray = open_ray(target + 3e5 * normal.normalize(), -normal);
        let hit = trace(piece.view(), &ray);
        if hit.triangle == id {
            n_hits += 1;
            let [s, t] = hit.barycentrics;
            assert!((s - 0.2).abs() < 1e-4 && (t - 0.3).abs() < 1e-4, "{hit:?}");
            assert_eq!(hit.normal, normal);
            let corner = [f64::from(id.i()), f64::from(id.j())];
            let expected = if id.half() == 0 { [0.2, 0.3] } else { [0.8, 0.7] };
            let in_cells = hit.in_cells().map(f64::from);
            assert!((0..2).all(|k| (in_cells[k] - corner[k] - expected[k]).abs() < 1e-4), "{in_cells:?} {id:?}");
        }
    }
    assert!(n_hits > 60, "{n_hits} of 128 triangles are seen from in front");
}

#[test]
fn the_smaller_triangle_wins_a_tie() {
    // A flat square, hit exactly at its vertices: every t is the same.
    let vertices: Vec<[i32; 3]> = (0..81).map(|v| [v % 9 * 100, v / 9 * 100, 0]).collect();
    let piece = Piece::new(&vertices, whole(8, 8));
    for (v, &[x, y, _]) in vertices.iter().enumerate() {
        let hit = trace(piece.view(), &open_ray(DVec3::new(x.into(), y.into(), 500.0), DVec3::NEG_Z));
        let (i, j) = (v as u32 % 9, v as u32 / 9);
        // Of the triangles around the vertex, the first is in the cell below and to the left, if there is one.
        let half = u32::from(i > 0 && j > 0);
        let expected = TriangleId::new(PATCH, i.saturating_sub(1), j.saturating_sub(1), half);
        assert_eq!((hit.triangle, hit.t), (expected, 500.0), "vertex ({i}, {j})");
    }
}

#[test]
fn the_triangle_to_skip_is_skipped_and_no_other() {
    let vertices: Vec<[i32; 3]> = (0..81).map(|v| [v % 9 * 100, v / 9 * 100, 0]).collect();
    let piece = Piece::new(&vertices, whole(8, 8));
    for (id, [a, b, c]) in triangles(&vertices, whole(8, 8), PATCH) {
        let from = (a + b + c) / 3.0 + 50.0 * DVec3::Z;
        let first = trace(piece.view(), &open_ray(from, DVec3::NEG_Z));
        assert_eq!(first.triangle, id);
        let skipping = LatticeRay::new(from, DVec3::NEG_Z, f32::INFINITY, id);
        assert!(!trace(piece.view(), &skipping).is_some());
        let skipping_another =
            LatticeRay::new(from, DVec3::NEG_Z, f32::INFINITY, TriangleId::new(PatchId(8), id.i(), id.j(), id.half()));
        assert_eq!(trace(piece.view(), &skipping_another).triangle, id);
    }
}

#[test]
fn a_point_of_a_piece_is_never_hit() {
    let piece = Piece::new(&[[5; 3]; 81], whole(8, 8));
    for direction in [DVec3::X, DVec3::NEG_Z, DVec3::ONE, DVec3::new(0.1, -0.7, 0.2)] {
        let ray = open_ray(DVec3::splat(5.0) - 64.0 * direction, direction);
        assert!(!trace(piece.view(), &ray).is_some());
    }
}
