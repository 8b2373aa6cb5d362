//! How high a tessellated surface rises, seen from itself: so that rays that leave it need not be tested against it.
//!
//! A **chord** runs from any point p of a patch's surface to any other. A ray that starts at p and is higher over its
//! way than every chord from there does not meet the surface again: all that it could meet is on chords. (Horizon maps,
//! Max 1988, know as much of single points of height fields.)
//!
//! # What is known
//! Two vectors, m_u and m_v, and n = m_u x m_v. Of a chord C, m_u·C and m_v·C are its **ways** along u and v, n·C is
//! its **height**. Four
//! **rises** say how much height a way along u or v brings at most, to where u (or v) grows or shrinks:
//!
//! n·C <= rise_u |m_u·C| + rise_v |m_v·C|,
//!
//! with the rises for the signs of the ways. They may be negative: a convex surface falls away from every point of it.
//! They hold for chords that start in one of four **parts** of the patch's cells along u, and one of four along v.
//!
//! # How it is found
//! Let u and v run over the cells of a grid. On each of a cell's two triangles the surface is linear in u and v, with
//! two of the cell's edges as derivatives. So a chord is a sum of u-edges times what u changes and of v-edges times
//! what v changes, all of u's shares of one sign and all of v's, and its edges are those of cells between its ends. If
//! each edge of the sum, turned with its share's sign, is below the **plane** n·W = s_u m_u·W + s_v m_v·W, the chord
//! is. (s has the sign of u's or v's shares; each of the four combinations is a plane, and what is below one of them is
//! below the highest, which is the inequality above.)
//!
//! Of a u-edge, let r be its height and k how far it leads **astray** along v, both for each unit of its way along u.
//! It is below the plane if s_u >= r + |s_v| k. With K_u and K_v the greatest k of u- and v-edges, R the greatest |r|
//! of each, S_u = R_u + S_v K_u and S_v = R_v + S_u K_v, which has a solution where K_u K_v < 1, the slope r + S_v k is
//! enough for a u-edge, and none is above S_u; likewise along v.
//!
//! Where a side has fewer segments than the grid has cells, its vertices have **moved** along it ([`Borders`]), and
//! edges from there to the next row lead far astray. Such triangles cover u and v as before, but for those of no area,
//! if each vertex is taken to be where it has moved to. So they are measured by their derivatives along u and v instead
//! of by edges (`strip.rs`). A triangle may reach beyond its cell's column or row, by less than vertices have moved at
//! most: what is ahead of a part begins so much earlier, twice, for where the ray starts and for what it meets.
//!
//! # Where the ray starts above p
//! That may be at any point above p along its triangle's normal N, to the side to which the ray leaves. It meets
//! nothing if N is not below any of the planes. The triangle's own plane is n·W = g_u m_u·W + g_v m_v·W, and N is
//! n - g_u m_u - g_v m_v. By its derivatives g_u m_u·W + g_v m_v·W <= (r + S_v k) m_u·W - S_v |m_v·W| for its W along
//! u: if |g_v| <= S_v, then g_u <= r + S_v k, and so on; by how much |g_u| exceeded S_u, |g_v| would exceed S_v by 1 /
//! K_u times, and |g_u| by 1 / (K_u K_v) times, so it does not. So the triangle's plane lies between those of chords
//! over its part, whoever is above these leaves to N's side, and N is above a plane if (n - g)·(n - s) >= 0 for all g
//! and s of the part's own slopes and of its planes. Where it is not, in **ravines**, nobody leaves.

mod borders;
mod edges;
mod strip;

pub use borders::Borders;

use super::frame::{self, Course, MARGIN_IN_HEIGHT, PACKED, PARTS, PackedFrame, part, parts_per_cell};
use super::{LatticeRay, PieceView, VertexFormat, leaves_below};
use crate::math::simd::{self, Kernel, Portable, Task};
use bytemuck::{Pod, Zeroable};
use edges::{Measure, Steepest};
use glam::{IVec3, Vec3};
use strip::Strip;

/// The rise of what nobody clears.
const NEVER: i8 = i8::MAX - 1;

/// This bit marks ravines.
const RAVINE: i8 = 1;

/// Products of slopes over |n| that are below minus this make ravines. (One would be enough, but for roundings.)
const MOST_STEEP: f32 = 0.9375;

/// Surfaces that are less steep have none, roundings included.
const GENTLE: f32 = 0.85;

/// One less K_u K_v, at least.
const LEAST_SHARE: f32 = 0.05;

/// How often bounds on slopes are made tighter.
const ROUNDS: usize = 2;

/// By how much a ray has to be higher than every chord, for the roundings of both: some 2^-20.
const MARGIN: f32 = 1.0 / 1024.0;

/// The slope of parts without cells.
const NO_EDGE: f32 = f32::MIN;

/// How high a patch rises above each part of itself, on one side.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Horizon {
    frame: PackedFrame,
    /// Along u and v, where it grows and where it shrinks, from each part, in units of n over those of m_u or m_v; even
    /// numbers. The lowest bits, one after the other, are set for parts (0, 0), (0, 1) and so on that are ravines.
    rises: [[[i8; PARTS]; 2]; 2],
}

impl Horizon {
    /// Of a surface that may be seen from itself anywhere.
    pub const NONE: Self = Self { frame: PackedFrame::NONE, rises: [[[0; PARTS]; 2]; 2] };

    /// The horizon of all pieces of one grid together, on the side to which the ray leaves it;
    /// [`NONE`](Self::NONE) if the surface is too steep.
    pub fn of_pieces<'a>(
        pieces: impl Iterator<Item = PieceView<'a>> + Clone,
        borders: &Borders,
        ray: &LatticeRay,
    ) -> Self {
        let is_turned = pieces.clone().any(|piece| leaves_below(&piece, ray));
        simd::run(OfPieces { pieces, borders, is_turned })
    }

    /// In three words.
    pub fn to_words(self) -> [u64; 3] {
        bytemuck::cast(self)
    }

    /// From [`to_words`](Self::to_words).
    #[inline(always)]
    pub fn from_words(words: [u64; 3]) -> Self {
        bytemuck::cast(words)
    }

    /// Whether the ray is so high that it does not meet the surface that it starts on, or above as said.
    #[inline(always)]
    pub fn is_cleared_by<K: Kernel>(self, k: K, ray: &LatticeRay) -> bool {
        let [u, v] = self.frame.part(ray.start_cell());
        let Course { ways, shrinks, height } = self.frame.course(k, k.div(k.splat(1.0), k.load(&ray.inv)));
        let (rise_u, rise_v) = (rise(self.rises[0], shrinks[0], u), rise(self.rises[1], shrinks[1], v));
        rise_u.max(rise_v) < NEVER
            && !self.is_ravine(u, v)
            && height > f32::from(rise_u) * ways[0] + f32::from(rise_v) * ways[1] + MARGIN_IN_HEIGHT
    }

    /// Whether the ray leaves to the side on which this is the horizon, roughly.
    pub fn is_on_side_of(self, ray: &LatticeRay) -> bool {
        let direction = ray.direction().as_vec3();
        let [x, y, z] = direction.to_array();
        let Course { height, .. } = self.frame.course(Portable, [x, y, z, 0.0, x, y, z, 0.0]);
        height > 0.0
    }

    /// Whether nobody leaves from part (u, v).
    #[inline(always)]
    fn is_ravine(self, u: u32, v: u32) -> bool {
        let rises = if u < 2 { self.rises[0] } else { self.rises[1] };
        byte(rises, PARTS as u32 * (u % 2) + v) & RAVINE != 0
    }
}

/// What a way along u or v brings at most, where it grows (0) or shrinks (1).
#[inline(always)]
fn rise(rises: [[i8; PARTS]; 2], way: u32, part: u32) -> i8 {
    byte(rises, PARTS as u32 * way + part) & !RAVINE
}

/// Not by index: that would wait for the words to be stored.
#[inline(always)]
fn byte(rises: [[i8; PARTS]; 2], k: u32) -> i8 {
    let all: u64 = bytemuck::cast(rises);
    (all.to_le() >> (8 * k)) as i8
}

struct OfPieces<'a, I> {
    pieces: I,
    borders: &'a Borders,
    is_turned: bool,
}

impl<'a, I: Iterator<Item = PieceView<'a>> + Clone> Task for OfPieces<'_, I> {
    type Output = Horizon;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Horizon {
        let Self { pieces, borders, is_turned } = self;
        // Corners of 32-bit pieces are no exact floats.
        if pieces.clone().any(|piece| piece.head.format == VertexFormat::Four as u8) {
            return Horizon::NONE;
        }
        let Some(frame) = Frame::of_pieces(pieces.clone()) else { return Horizon::NONE };
        let Some(strips) = Strip::of_pieces(pieces.clone(), borders) else { return Horizon::NONE };
        let by = [frame.measure_of(0), frame.measure_of(1)];
        let mut slopes = Slopes::new(borders, is_turned);
        for piece in pieces {
            edges::measure(k, by, &piece, borders.moved_sides(piece.cells()), &mut slopes);
        }
        for strip in strips {
            strip.measure(k, by, &mut slopes);
        }
        frame.horizon(&slopes)
    }
}

/// What a grid's edges are measured by.
struct Frame {
    /// m_u and m_v, as they are packed: whole numbers.
    along: [Vec3; 2],
    /// Their cross product, without error.
    up: Vec3,
}

/// How steep the surface is at most, along u in each column of cells and along v in each row.
struct Slopes {
    cells: [Vec<Steepest<f32>>; 2],
    /// Triangles reach so many cells beyond their own, or rays start there, along u and along v.
    reach: [usize; 2],
    /// What is fallen is risen.
    is_turned: bool,
}

impl Slopes {
    fn new(borders: &Borders, is_turned: bool) -> Self {
        let reach = borders.farthest().map(|far| (2.0 * far).ceil() as usize);
        Self { cells: borders.cells.size().map(|n| vec![Steepest::NONE; n]), reach, is_turned }
    }

    /// Takes in slopes along u (0) or v (1) of cell `cell` in that direction.
    #[inline(always)]
    fn add(&mut self, axis: usize, cell: usize, seen: Steepest<f32>) {
        self.cells[axis][cell].take_in(seen);
    }

    /// Bounds on the slopes of planes, by those of edges; `None` if there are none.
    fn bounds(&self) -> Option<[f32; 2]> {
        let [u, v] = self.cells.each_ref().map(|cells| {
            cells.iter().fold(Steepest::NONE, |mut all, cell| {
                all.take_in(*cell);
                all
            })
        });
        let ([r_u, r_v], share) = ([u, v].map(|s| s.rise.max(s.fall).max(0.0)), 1.0 - u.astray * v.astray);
        let mut most = [(r_u + r_v * u.astray) / share, (r_v + r_u * v.astray) / share].map(|s| s * (1.0 + MARGIN));
        // Infinite where the surface is folded.
        if share.is_nan() || share < LEAST_SHARE || !most.iter().all(|s| s.is_finite()) {
            return None;
        }
        // Bounds that no cell exceeds with them are bounds as well.
        for _ in 0..ROUNDS {
            let of = |axis: usize| {
                let cells = self.cells[axis].iter().map(|cell| cell.with(most[1 - axis]));
                cells.fold(0.0, |all, [rise, fall]| rise.max(fall).max(all))
            };
            most = [of(0).min(most[0]), of(1).min(most[1])];
        }
        Some(most)
    }

    /// Of planes along u or v, with a bound on slopes across.
    fn planes(&self, axis: usize, most: f32) -> Planes {
        let last = self.cells[axis].len() - 1;
        let parts = parts_per_cell(last + 1);
        let part = |cell: usize| part(cell as u32, parts) as usize;
        let (mut own, mut ahead) = ([[NO_EDGE; PARTS]; 2], [[NO_EDGE; PARTS]; 2]);
        for (cell, steepest) in self.cells[axis].iter().enumerate() {
            let mut ways = steepest.with(most);
            if self.is_turned {
                ways.reverse();
            }
            let [reach_back, reach_on] = [cell.saturating_sub(self.reach[axis]), (cell + self.reach[axis]).min(last)];
            for (way, (slope, far)) in ways.into_iter().zip([reach_on, reach_back]).enumerate() {
                own[way][part(cell)] = own[way][part(cell)].max(slope);
                ahead[way][part(far)] = ahead[way][part(far)].max(slope);
            }
        }
        let [to_more, to_less] = &mut ahead;
        (1..PARTS).for_each(|part| to_less[part] = to_less[part].max(to_less[part - 1]));
        (1..PARTS).rev().for_each(|part| to_more[part - 1] = to_more[part - 1].max(to_more[part]));
        Planes { parts, own, ahead }
    }
}

/// Slopes of planes along u or v, to where it grows and to where it shrinks.
struct Planes {
    parts: u8,
    /// Of those in each part.
    own: [[f32; PARTS]; 2],
    /// Of those that are ahead of each part.
    ahead: [[f32; PARTS]; 2],
}

impl Frame {
    /// By what u and v do on the whole; `None` for pieces without area.
    #[inline(always)]
    fn of_pieces<'a>(pieces: impl Iterator<Item = PieceView<'a>>) -> Option<Self> {
        let (mut of_u, mut of_v) = (Vec3::ZERO, Vec3::ZERO);
        for piece in pieces {
            let [n_u, n_v] = piece.cells().size();
            let at = |i, j| IVec3::from_array(piece.vertex(i, j));
            let [a, b, c, d] = [at(0, 0), at(n_u, 0), at(0, n_v), at(n_u, n_v)];
            of_u += (b - a).as_vec3() + (d - c).as_vec3();
            of_v += (c - a).as_vec3() + (d - b).as_vec3();
        }
        let along = frame::axes(of_u, of_v)?;
        Some(Self { along, up: along[0].cross(along[1]) })
    }

    fn measure_of(&self, axis: usize) -> Measure {
        const ERROR: f32 = 1.0 / 1_048_576.0;
        let errors = [PACKED, self.up.abs().max_element()].map(|most| most * ERROR);
        Measure { along: self.along[axis], across: self.along[1 - axis], up: self.up, errors }
    }

    /// The horizon of a surface with these slopes; [`NONE`](Horizon::NONE) if it is too steep.
    fn horizon(&self, slopes: &Slopes) -> Horizon {
        let Some(most) = slopes.bounds() else { return Horizon::NONE };
        let planes = [slopes.planes(0, most[1]), slopes.planes(1, most[0])];
        let mut rises = planes.each_ref().map(|planes| planes.ahead.map(|way| way.map(rounded_up)));
        let steepness = most[0] * self.along[0].length() + most[1] * self.along[1].length();
        if steepness > GENTLE * self.up.length() {
            let bits = rises.as_flattened_mut().as_flattened_mut().iter_mut();
            let parts = (0..PARTS).flat_map(|u| (0..PARTS).map(move |v| [u, v]));
            bits.zip(parts).filter(|(_, part)| self.is_ravine(&planes, *part)).for_each(|(bit, _)| *bit |= RAVINE);
        }
        let frame = PackedFrame::new(self.along, planes.each_ref().map(|p| p.parts), slopes.is_turned);
        Horizon { frame, rises }
    }

    /// Whether the normal of a triangle in this part of the patch may be below one of the planes of chords from there.
    fn is_ravine(&self, planes: &[Planes; 2], parts: [usize; 2]) -> bool {
        // Rounded up by two at most, and by a margin that `MOST_STEEP` leaves room for.
        let ahead = [0, 1].map(|axis| planes[axis].ahead.map(|way| way[parts[axis]] + 2.0));
        let own = [0, 1].map(|axis| planes[axis].own.map(|way| way[parts[axis]]));
        if own.as_flattened().contains(&NO_EDGE) {
            return false;
        }
        let least = -MOST_STEEP * self.up.length_squared();
        let (planes, triangles) = (self.corners(ahead), self.corners(own));
        planes.iter().any(|plane| triangles.iter().any(|triangle| plane.dot(*triangle) < least))
    }

    /// What is to be taken from n for the normals of planes with these slopes along u and v.
    fn corners(&self, [[a, b], [c, d]]: [[f32; 2]; 2]) -> [Vec3; 4] {
        let [m_u, m_v] = self.along;
        [[a, c], [a, -d], [-b, c], [-b, -d]].map(|[u, v]| u * m_u + v * m_v)
    }
}

/// A rise as an even number of units, with some margin; [`NEVER`] if it is too great.
fn rounded_up(rise: f32) -> i8 {
    2 * (((rise + MARGIN * rise.abs()) / 2.0).ceil() as i8).clamp(i8::MIN / 2, NEVER / 2)
}
