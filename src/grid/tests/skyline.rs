//! Skylines of sheets that are put together from patches on a cylinder.

use super::slow::{meet, triangles};
use super::support::{Piece, Random, whole};
use crate::grid::{LatticeRay, SeenFrom, Skyline, SkylineSheet, SkylineView, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, Portable};
use glam::{DVec3, IVec3};

const PATCH: PatchId = PatchId(3);

/// Radius of the cylinder, in lattice steps.
const RADIUS: f64 = 1e6;

/// A patch of 8 x 8 cells on a cylinder about the y axis, over these angles in degrees and heights in radii; from
/// outside it is seen counterclockwise.
fn on_cylinder(angles: [f64; 2], heights: [f64; 2]) -> Vec<[i32; 3]> {
    let between = |[a, b]: [f64; 2], k: usize| a + (b - a) * k as f64 / 8.0;
    let places = (0..=8).flat_map(|j| (0..=8).map(move |i| (i, j)));
    let points = places.map(|(i, j)| {
        let (sin, cos) = between(angles, i).to_radians().sin_cos();
        RADIUS * DVec3::new(sin, between(heights, j), cos)
    });
    points.map(|p| p.round().as_ivec3().to_array()).collect()
}

/// The skyline of the first of these patches, on the side to which a ray from the middle leaves along `direction`.
fn skyline_of(patches: &[Vec<[i32; 3]>], direction: DVec3) -> Option<Skyline> {
    view_from(patches, direction, SeenFrom::Patch).map(|view| view.skyline())
}

/// What is seen from there.
fn view_from(patches: &[Vec<[i32; 3]>], direction: DVec3, seen_from: SeenFrom) -> Option<SkylineView> {
    let pieces: Vec<Piece> = patches.iter().map(|vertices| Piece::new(vertices, whole(8, 8))).collect();
    let start = TriangleId::new(PATCH, 4, 4, 0);
    let ray = LatticeRay::new(IVec3::from_array(patches[0][40]).as_dvec3(), direction, f32::INFINITY, start);
    let mut sheet = SkylineSheet::new(&[pieces[0].view()], &ray, seen_from)?;
    for piece in &pieces[1..] {
        assert!(sheet.add(&[piece.view()]));
    }
    Some(sheet.view())
}

fn is_cleared(skyline: Option<Skyline>, direction: DVec3, cell: [u16; 2], lift: f32) -> bool {
    let Some(words) = skyline.map(Skyline::to_words) else { return false };
    let DVec3 { x, y, z } = direction;
    Skyline::is_cleared_by(Portable, Portable.load4(&[x, y, z, 0.0]), cell, lift, |word| words[word])
}

/// Nine patches of a cylinder, `width` degrees each, the one in the middle first.
fn nine(width: f64) -> Vec<Vec<[i32; 3]>> {
    let order = [(0, 0), (-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    let range = |k: i32, width: f64| [-0.5, 0.5].map(|end| width * (f64::from(k) + end));
    order.map(|(i, j)| on_cylinder(range(i, width), range(j, width.to_radians()))).to_vec()
}

#[test]
fn a_patch_is_left_straight_up_if_its_neighbours_are_around_it() {
    for width in [1.0, 10.0, 25.0] {
        let patches = nine(width);
        for cell in [[0, 0], [4, 4], [7, 3]] {
            assert!(is_cleared(skyline_of(&patches, DVec3::Z), DVec3::Z, cell, 0.0), "outwards, {width}");
            assert!(is_cleared(skyline_of(&patches, -DVec3::Z), -DVec3::Z, cell, 0.0), "inwards, {width}");
            assert!(!is_cleared(skyline_of(&patches, DVec3::Z), -DVec3::Z, cell, 0.0), "on the wrong side, {width}");
        }
        let steep = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y].map(|aside| DVec3::Z + 2.0 * aside);
        let skyline = skyline_of(&patches, DVec3::Z);
        assert!(
            steep.iter().all(|direction| is_cleared(skyline, *direction, [4, 4], 0.0)),
            "nothing is there, {width}"
        );
    }
}

#[test]
fn a_patch_without_its_neighbours_is_not_left_at_its_sides() {
    let patches = nine(20.0);
    // Its own border enters every clearing that is larger than the patch.
    assert!(!is_cleared(skyline_of(&patches[..1], DVec3::Z), DVec3::Z, [0, 0], 0.0));
    // Those at corners alone are not joined to it.
    let at_corners = [0, 1, 3, 6, 8].map(|k| patches[k].clone());
    assert!(!is_cleared(skyline_of(&at_corners, DVec3::Z), DVec3::Z, [0, 0], 0.0));
    // A neighbour whose side is cut otherwise is not either.
    let mut gap = patches.clone();
    gap[5][4 * 9][0] += 1;
    assert!(!is_cleared(skyline_of(&gap, DVec3::Z), DVec3::Z, [7, 4], 0.0));
}

#[test]
fn what_is_seen_from_outside_is_open() {
    let open = |patches: &[Vec<[i32; 3]>], side: f64| skyline_of(patches, side * DVec3::Z).map_or(0, |s| s.openness());
    let (outside, inside) = (open(&nine(10.0), 1.0), open(&nine(30.0), -1.0));
    assert!((80..=100).contains(&outside) && inside < outside, "{outside} {inside}");
    assert_eq!(Skyline::NONE.openness(), 0);
}

#[test]
fn rays_start_no_higher_than_the_lift() {
    let skyline = skyline_of(&nine(20.0), DVec3::Z);
    let side = RADIUS * 20f64.to_radians();
    assert!(is_cleared(skyline, DVec3::Z, [4, 4], (side / 40.0) as f32));
    assert!(!is_cleared(skyline, DVec3::Z, [4, 4], (side / 25.0) as f32));
    assert!(!is_cleared(skyline, DVec3::Z, [4, 4], f32::NAN));
}

/// How open the skylines of all parts are, and that of the patch.
fn openness(patches: &[Vec<[i32; 3]>]) -> [u32; 2] {
    let of_part = |number: usize| {
        let view = view_from(patches, DVec3::Z, SeenFrom::Part { number, lift: 100.0 });
        view.map_or(0, |view| view.part_skyline().openness())
    };
    let all = (0..16).map(of_part).sum::<u32>() / 16;
    [all, skyline_of(patches, DVec3::Z).map_or(0, |skyline| skyline.openness())]
}

#[test]
fn parts_of_a_patch_that_bends_see_more_than_the_patch() {
    for (width, least) in [(10.0, 90), (40.0, 85), (60.0, 80), (90.0, 70)] {
        let [of_parts, of_patch] = openness(&nine(width));
        assert!(of_parts >= least && of_parts >= of_patch, "{width}: {of_parts}, {of_patch}");
    }
}

#[test]
fn directions_of_any_length_are_cleared_or_none() {
    let skyline = skyline_of(&nine(20.0), DVec3::Z);
    for exponent in [-300, -150, -40, -22, -15, 0, 15, 22, 40, 300] {
        let length = 10f64.powi(exponent);
        let is_ordinary = exponent.abs() < 20;
        assert_eq!(is_cleared(skyline, length * DVec3::Z, [4, 4], 0.0), is_ordinary, "{exponent}");
        assert!(!is_cleared(skyline, length * DVec3::X, [4, 4], 0.0), "{exponent}");
    }
    for odd in [f64::NAN, f64::INFINITY, 0.0] {
        assert!(!is_cleared(skyline, odd * DVec3::Z, [4, 4], 0.0), "{odd}");
        assert!(!is_cleared(skyline, DVec3::new(odd, 0.0, 1.0), [4, 4], 0.0) || odd == 0.0, "{odd}");
    }
}

/// On the inner side of a cylinder what is around stands high: near patches, patches of the sheet beyond the clearing,
/// and patches that are not of the sheet.
#[test]
fn rays_above_the_walls_of_a_valley_meet_none_of_them() {
    let mut random = Random(0x0001_a11e);
    let (mut n_cleared, mut n_open) = (0, 0);
    for width in [5.0, 15.0, 30.0] {
        let mut patches = nine(width);
        let more = [[1.5, 2.5], [-2.5, -1.5], [2.5, 3.5]].map(|angles| angles.map(|angle| width * angle));
        patches.extend(more.map(|angles| on_cylinder(angles, [-0.5, 0.5].map(|y| width.to_radians() * y))));
        let skyline = skyline_of(&patches, -DVec3::Z);
        let all: Vec<(TriangleId, [DVec3; 3])> =
            patches.iter().flat_map(|vertices| triangles(vertices, whole(8, 8), PATCH)).collect();
        let own = triangles(&patches[0], whole(8, 8), PATCH);
        for _ in 0..2000 {
            let (id, [a, b, c]) = own[(random.unit() * own.len() as f64) as usize];
            let inwards = -(b - a).cross(c - a).normalize();
            let origin = (a + b + c) / 3.0 + 20.0 * inwards;
            let direction = inwards + random.point(1.2);
            let ray = LatticeRay::new(origin, direction, f32::INFINITY, id);
            let meets = direction.dot(inwards) <= 0.0
                || all
                    .iter()
                    .any(|(other, t)| *other != id && meet(&ray, *t).is_some_and(|m| m.t > 0.0 && m.inside > 0.0));
            let cell = [id.i(), id.j()].map(|k| k as u16);
            if is_cleared(skyline, direction, cell, 21.0) {
                assert!(!meets, "{width}, {cell:?}, {origin} along {direction}");
                n_cleared += 1;
            }
            n_open += usize::from(!meets);
        }
    }
    assert!(2 * n_cleared > n_open, "only {n_cleared} of {n_open} are known to meet nothing");
}
