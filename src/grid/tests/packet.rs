//! Packets against their rays one by one.

use super::support::{Piece, Random, sheet, whole};
use crate::grid::{LatticeHit, LatticeRay, PACKET, PieceView, RayPacket, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, Portable, Task, run};
use glam::{DVec3, IVec3};

const PATCH: PatchId = PatchId(5);

/// What the rays of a packet hit in a piece and where, in the caller's units; `None` if they are no packet.
struct Together<'a> {
    piece: PieceView<'a>,
    origin: DVec3,
    directions: &'a [DVec3; PACKET],
    t_max: &'a [f32; PACKET],
    /// Those that are asked about, as bits.
    rays: u32,
}

type Hits = [Option<(LatticeHit, f32)>; PACKET];

impl Task for Together<'_> {
    type Output = Option<Hits>;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Self::Output {
        let Self { piece, origin, directions, t_max, rays } = self;
        let directions = [0, 1, 2].map(|axis| directions.map(|d| d[axis]));
        let mut packet = RayPacket::default();
        let origin = kernel.load4(&[origin.x, origin.y, origin.z, f64::NAN]);
        packet.set(kernel, origin, &directions, t_max).then(|| {
            piece.closest_of_packet(kernel, &mut packet, rays, PATCH);
            std::array::from_fn(|i| packet.hit(i).map(|hit| (*hit, packet.caller_t(i, hit.t))))
        })
    }
}

/// The same of one ray.
struct Alone<'a>(PieceView<'a>, &'a LatticeRay);

impl Task for Alone<'_> {
    type Output = Option<(LatticeHit, f32)>;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Self::Output {
        let mut hit = LatticeHit::none(self.1.t_max());
        self.0.closest(kernel, self.1, PATCH, &mut hit);
        hit.is_some().then(|| (hit, self.1.caller_t(hit.t)))
    }
}

/// Checks a packet against its rays; returns how many hit something, `None` if it is no packet.
fn check(
    piece: PieceView,
    origin: DVec3,
    directions: &[DVec3; PACKET],
    t_max: &[f32; PACKET],
    rays: u32,
) -> Option<usize> {
    let together = || Together { piece, origin, directions, t_max, rays };
    let hits = run(together());
    assert_eq!(hits, together().run(Portable), "the kernels differ: {origin} {directions:?}");
    let alone: Hits = std::array::from_fn(|i| {
        let ray = LatticeRay::new(origin, directions[i], t_max[i], TriangleId::NONE);
        run(Alone(piece, &ray)).filter(|_| rays >> i & 1 == 1)
    });
    assert_eq!(hits?, alone, "{origin} {directions:?} {t_max:?} {rays:b}");
    Some(alone.iter().flatten().count())
}

#[test]
fn packets_hit_what_their_rays_hit() {
    let mut random = Random(21);
    let (mut n_packets, mut n_hits) = (0, 0);
    for round in 0..4000 {
        let (n_u, n_v) = (1 + round % 8, 1 + round / 8 % 8);
        let width = [600.0, 2e4, 3e6][round % 3];
        let vertices = sheet(&mut random, n_u, n_v, width);
        let piece = Piece::new(&vertices, whole(n_u as u16, n_v as u16));
        let mut vertex = || IVec3::from_array(vertices[(random.unit() * vertices.len() as f64) as usize]).as_dvec3();
        let (a, b) = (vertex(), vertex());
        let origin = a + [0.3, 3.0, 100.0][round / 3 % 3] * random.point(width);
        let spread = [0.0, 0.01, 1.0][round / 9 % 3] * width;
        let scale = 10f64.powi(round as i32 % 7 - 3);
        // At a vertex, along an edge, or somewhere; some have an end on the sheet.
        let target = [a, 0.5 * (a + b), b + random.point(width)][round / 27 % 3];
        let directions = [(); PACKET].map(|()| scale * (target + random.point(spread) - origin));
        let ends = [f32::INFINITY, 1.0 / scale as f32, 0.0, -1.0, f32::NAN];
        let t_max = [(); PACKET].map(|()| ends[((random.unit() * 10.0) as usize).saturating_sub(5)]);
        let rays = if round % 2 == 0 { u32::MAX } else { random.bits() as u32 } & 0xff;
        if let Some(hits) = check(piece.view(), origin, &directions, &t_max, rays) {
            n_packets += 1;
            n_hits += hits;
        }
    }
    assert!(n_packets > 1500 && n_hits > 2500, "{n_packets} packets of 4000 with {n_hits} hits");
}

#[test]
fn rays_of_different_ways_or_extreme_ones_are_no_packet() {
    let vertices: Vec<[i32; 3]> = (0..81).map(|v| [v % 9 * 100, v / 9 * 100, 0]).collect();
    let piece = Piece::new(&vertices, whole(8, 8));
    let eye = DVec3::new(350.0, 250.0, 5000.0);
    let along = DVec3::new(0.1, 0.2, -1.0);
    let with = |origin: DVec3, odd: DVec3| {
        let directions = std::array::from_fn(|i| if i == 6 { odd } else { along });
        check(piece.view(), origin, &directions, &[f32::INFINITY; PACKET], 0xff)
    };
    assert_eq!(with(eye, along), Some(0));
    assert_eq!(with(eye, DVec3::new(1e-9, 1e-9, -1.0)), Some(1));
    let odd_ones = [
        DVec3::new(-0.1, 0.2, -1.0),
        DVec3::new(0.1, 0.2, 1.0),
        DVec3::new(2.0, 0.2, -1.0),
        DVec3::new(0.1, 2.0, -1.0),
        DVec3::new(0.1, 0.0, -1.0),
        DVec3::new(0.1, 1e-30, -1.0),
        DVec3::new(0.1, f64::NAN, -1.0),
        DVec3::new(0.1, 0.2, f64::NEG_INFINITY),
        along * 1e300,
        along * 1e-300,
        DVec3::ZERO,
    ];
    for odd in odd_ones {
        assert_eq!(with(eye, odd), None, "{odd}");
    }
    for far in [DVec3::new(0.0, 0.0, 4e7), DVec3::splat(f64::NAN), DVec3::new(f64::INFINITY, 0.0, 0.0)] {
        assert_eq!(with(far, along), None, "{far}");
    }
}
