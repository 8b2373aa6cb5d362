//! How high a tessellated surface rises, seen from itself: so that rays that leave it need not be tested against it.

#![allow(unsafe_code)]

use super::{CellRect, LatticeRay, MAX_CELLS, PieceView, VertexFormat};
use crate::math::simd::{self, Kernel, Task};
use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, IVec3, Vec3};

/// Parts into which a patch's cells are divided along u, and along v: where in it a ray starts is known that well.
const PARTS: usize = 4;

/// Length of the longest component of a packed vector. So rises, which are not above the length of one (109), fit a byte.
const PACKED: f32 = 63.0;

/// Surfaces that are steeper than this anywhere have no horizon. Below 1, a point off a triangle of the surface, along its normal, is
/// off the surface (see [`Horizon`]).
const MOST_STEEP: f32 = 0.9375;

/// By how much a ray has to be higher than every chord, for the roundings of both: some 2^-20.
/// The rise of what nobody clears.
const NEVER: i8 = i8::MAX;

/// One less the product of how far edges lead astray, at least.
const LEAST_SHARE: f32 = 0.05;

/// How often bounds on slopes are made tighter.
const ROUNDS: usize = 2;

const MARGIN: f32 = 1.0 / 1024.0;

/// The same for what is not as far along the surface as it is high: errors of scalar products with components of some 2^13 at most.
const MARGIN_IN_HEIGHT: f32 = 0.25;

/// Vertices in a row of the widest piece.
const MOST_COLUMNS: usize = MAX_CELLS + 1;

/// The least lattice distance that counts as one when a slope is found.
const TINY: f32 = 1e-30;

/// The slope of parts without cells.
const NO_EDGE: f32 = f32::MIN;

/// This is taken from the slopes of edges that do not count.
const HIDDEN: f32 = 1e30;

/// How steeply **chords** rise from where they start: from any point p of a patch's surface to any other, q.
///
/// A ray that starts at p and is higher over its way than every chord does not meet the surface again: all that it could meet is on chords
/// from its start.
///
/// # What is known
/// Two vectors, m_u and m_v, and n = m_u x m_v. Of a chord C, m_u·C and m_v·C are its ways along u and v, n·C is its height. Four
/// **rises** for each place in the patch say how much height a way along u or v brings at most, to where u (or v) grows or shrinks:
///
/// n·C <= rise_u |m_u·C| + rise_v |m_v·C|,
///
/// with the rises for the signs of the ways. They may be negative: a convex surface falls away from every point of it. That holds for
/// chords that start in the part of the patch that the rises are for, a quarter of its cells along u and one along v.
///
/// # How it is found
/// Let u and v run over the cells of a grid. On each of a cell's two triangles the surface is linear in u and v, with two of the
/// cell's edges as derivatives. So a chord is a sum of u-edges times what u changes and of v-edges times what v changes, all of u's shares
/// of one sign and all of v's, and its edges are those of cells between its ends. If each edge of the sum, turned with its share's sign, is below
/// the plane n·W = s_u m_u·W + s_v m_v·W, the chord is. (s has the sign of u's or v's shares; each of the four combinations is a plane.)
///
/// Of a u-edge, let r be its height and k how far it leads astray along v, both for each unit of its way along u. It is below the plane
/// if s_u >= r + |s_v| k. With K_u and K_v the greatest k of u- and v-edges, R the greatest |r| of each, and S_u = R_u + S_v K_u,
/// S_v = R_v + S_u K_v, which has a solution where K_u K_v < 1, s_u = r + S_v K_u is enough for all edges along u, and no |s| is above S.
///
/// The plane through a triangle at p is of this form, too. With slopes above S by e_u and e_v, its u-edge would have e_u <= e_v K_u, its
/// v-edge e_v <= e_u K_v, so that e_u = e_v = 0: it lies between the planes of the chords. So who is above those is above it.
///
/// # Where the ray starts above p
/// That may be at any point above p along the triangle's normal N, to the side to which it leaves. It meets nothing if N is not below any of the
/// planes. Planes whose slopes over |n| are at most S_u |m_u| + S_v |m_v| <= |n| make angles of 45 degrees with n at most, and so does N.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Horizon {
    /// For u and v: m_u or m_v, and 64 times the parts in a cell. The highest bit of the first of those is set if n is to be turned.
    frame: [[u8; 4]; 2],
    /// Along u and v, where it grows and where it shrinks, from each part, in units of n over those of m_u or m_v.
    rises: [[[i8; PARTS]; 2]; 2],
}

/// This is added to components of packed vectors, so that none is negative.
const BIAS: u8 = 128;

const IS_TURNED: u8 = 0x80;

impl Horizon {
    /// Of a surface that may be seen from itself anywhere.
    pub const NONE: Self = Self { frame: [[BIAS, BIAS, BIAS, 0]; 2], rises: [[[0; PARTS]; 2]; 2] };

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
        const YZX: i32 = 0b11_00_10_01;
        const ZXY: i32 = 0b11_01_00_10;
        let [[.., parts_u], [.., parts_v]] = self.frame;
        let bias = k.splat(f32::from(BIAS));
        // m_u and m_v, and the other way round.
        let m = k.sub(k.widen(bytemuck::cast_ref(&self.frame)), bias);
        let [first, second] = self.frame;
        let other = k.sub(k.widen(bytemuck::cast_ref(&[second, first])), bias);
        let up = k.sub(
            k.mul(k.shuffle::<YZX>(m), k.shuffle::<ZXY>(other)),
            k.mul(k.shuffle::<ZXY>(m), k.shuffle::<YZX>(other)),
        );
        let d = k.div(k.splat(1.0), k.load(&ray.inv));
        let (ways, heights) = (sum_of_three(k, k.mul(m, d)), sum_of_three(k, k.mul(up, d)));
        let [i, j] = ray.start_cell();
        let signs = k.negative(ways);
        let rise_u = rise(self.rises[0], signs & 1, part(i, parts_u));
        let rise_v = rise(self.rises[1], signs >> 4 & 1, part(j, parts_v));
        let (ways, heights) = (k.store(k.abs(ways)), k.store(heights));
        let height = if parts_u & IS_TURNED != 0 { heights[4] } else { heights[0] };
        rise_u.max(rise_v) < NEVER
            && height > f32::from(rise_u) * ways[0] + f32::from(rise_v) * ways[4] + MARGIN_IN_HEIGHT
    }
}

/// In each half, the sum of lanes 0 to 2, in lane 0.
#[inline(always)]
fn sum_of_three<K: Kernel>(k: K, x: K::F) -> K::F {
    k.add(k.add(x, k.shuffle::<0b01_01_01_01>(x)), k.shuffle::<0b10_10_10_10>(x))
}

/// What a way along u or v brings at most, where it grows (0) or shrinks (1).
#[inline(always)]
fn rise(rises: [[i8; PARTS]; 2], way: u32, part: u32) -> i8 {
    // Not by index: that would wait for the words to be stored.
    let all: u64 = bytemuck::cast(rises);
    (all.to_le() >> (8 * (PARTS as u32 * way + part))) as i8
}

/// 64 times the parts in one of `n` cells, so that no cell is in a fifth part.
fn parts_per_cell(n: usize) -> u8 {
    (64 * PARTS / n.max(1)).min(127) as u8
}

/// The part of the patch in which a cell is. (That of a cell which is not there is some part.)
#[inline(always)]
fn part(cell: u32, parts_per_cell: u8) -> u32 {
    cell * u32::from(parts_per_cell & !IS_TURNED) / 64 % PARTS as u32
}

/// Whether the ray starts on a triangle of this piece and leaves to where it is seen clockwise.
fn leaves_below(piece: &PieceView<'_>, ray: &LatticeRay) -> bool {
    let (CellRect { i0, i1, j0, j1 }, [i, j]) = (piece.cells(), ray.start_cell());
    if !(u32::from(i0)..u32::from(i1)).contains(&i) || !(u32::from(j0)..u32::from(j1)).contains(&j) {
        return false;
    }
    let (i, j) = ((i - u32::from(i0)) as usize, (j - u32::from(j0)) as usize);
    let at = |i, j| IVec3::from_array(piece.vertex(i, j)).as_dvec3();
    let [a, b, c] = match ray.skip.half() {
        0 => [at(i, j), at(i + 1, j), at(i, j + 1)],
        _ => [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)],
    };
    (b - a).cross(c - a).dot(ray.direction()) < 0.0
}

/// Where the vertices of a patch's grid lie: those of a side with fewer segments than the grid has cells have moved to the segments' ends.
pub struct Borders {
    /// All cells of the patch.
    pub cells: CellRect,
    /// Of the sides v = 0, u = 1, v = 1 and u = 0: where each of the vertices lies along u or v, in cells. Empty where none has moved.
    pub moved: [Vec<f64>; 4],
}

impl Borders {
    /// Which of the moved sides a part of the grid has cells at.
    fn moved_sides(&self, part: CellRect) -> [bool; 4] {
        let CellRect { i0, i1, j0, j1 } = self.cells;
        let [low, right, high, left] = &self.moved;
        [
            !low.is_empty() && part.j0 == j0,
            !right.is_empty() && part.i1 == i1,
            !high.is_empty() && part.j1 == j1,
            !left.is_empty() && part.i0 == i0,
        ]
    }

    /// Where a vertex lies, in cells.
    fn place(&self, [i, j]: [usize; 2]) -> DVec2 {
        let [n_u, n_v] = self.cells.size();
        let [low, right, high, left] = &self.moved;
        let along = |is_there: bool, side: &[f64], k: usize| side.get(k).copied().filter(|_| is_there);
        let u = along(j == 0, low, i).or(along(j == n_v, high, i)).unwrap_or(i as f64);
        let v = along(i == 0, left, j).or(along(i == n_u, right, j)).unwrap_or(j as f64);
        DVec2::new(u, v)
    }

    /// How far vertices have moved along u, and along v, at most.
    fn farthest(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let ways = [axis, axis + 2].map(|side| {
                let ways = self.moved[side].iter().enumerate().map(|(k, place)| (place - k as f64).abs());
                ways.fold(0.0, f64::max)
            });
            ways[0].max(ways[1])
        })
    }
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
            measure(k, by, &piece, borders.moved_sides(piece.cells()), &mut slopes);
        }
        for strip in strips {
            strip.measure(k, by, &mut slopes);
        }
        frame.horizon(&slopes)
    }
}

/// What a grid's edges are measured by.
struct Frame {
    /// m_u and m_v as they are packed.
    packed: [[i8; 3]; 2],
    /// The same.
    along: [Vec3; 2],
    /// Their cross product, without error.
    up: Vec3,
}

/// What edges along one of u and v are measured by, and how far off scalar products with it can be, for each unit of an edge's size.
///
/// A scalar product errs by 2^-22 of the sum of the edge's components, times the greatest of the vector's, at most: heights are taken so much
/// larger, ways along so much shorter.
#[derive(Clone, Copy)]
struct Measure {
    along: Vec3,
    across: Vec3,
    up: Vec3,
    errors: [f32; 2],
}

/// How steep edges along one of u and v are at most.
#[derive(Clone, Copy)]
struct Steepest<F> {
    /// Height won on the way to where u or v grows, for each unit of the way.
    rise: F,
    /// The same to where it shrinks.
    fall: F,
    /// Way along the other one.
    astray: F,
}

/// How steep the surface is at most, along u and along v.
struct Slopes {
    n_cells: [usize; 2],
    /// Triangles reach so many cells beyond their own, or rays start there, along u and along v.
    reach: [usize; 2],
    /// What is fallen is risen.
    is_turned: bool,
    parts: [u8; 2],
    /// In each part.
    own: [[Steepest<f32>; PARTS]; 2],
    /// By the last part from which it may be ahead, to where u or v grows, and to where it shrinks.
    ahead: [[[Steepest<f32>; PARTS]; 2]; 2],
}

impl Slopes {
    fn new(borders: &Borders, is_turned: bool) -> Self {
        let n_cells = borders.cells.size();
        let reach = borders.farthest().map(|far| (2.0 * far).ceil() as usize);
        let (own, ahead) = ([[Steepest::NONE; PARTS]; 2], [[[Steepest::NONE; PARTS]; 2]; 2]);
        Self { n_cells, reach, is_turned, parts: n_cells.map(parts_per_cell), own, ahead }
    }

    /// Takes in slopes along u (0) or v (1) of cell `cell` in that direction.
    #[inline(always)]
    fn add(&mut self, axis: usize, cell: usize, seen: Steepest<f32>) {
        let (reach, last) = (self.reach[axis], self.n_cells[axis] - 1);
        let part = |cell: usize| part(cell as u32, self.parts[axis]) as usize;
        self.own[axis][part(cell)].take_in(seen);
        self.ahead[axis][0][part((cell + reach).min(last))].take_in(seen);
        self.ahead[axis][1][part(cell.saturating_sub(reach))].take_in(seen);
    }

    /// Bounds on the slopes of planes, by those of edges; `None` if there are none.
    fn bounds(&self) -> Option<[f32; 2]> {
        let of = |axis: usize| {
            self.own[axis].into_iter().reduce(|mut all, part| {
                all.take_in(part);
                all
            })
        };
        let [u, v] = [of(0)?, of(1)?];
        let ([r_u, r_v], share) = ([u, v].map(|s| s.rise.max(s.fall).max(0.0)), 1.0 - u.astray * v.astray);
        let mut most = [(r_u + r_v * u.astray) / share, (r_v + r_u * v.astray) / share].map(|s| s * (1.0 + MARGIN));
        // Infinite where the surface is folded.
        if share.is_nan() || share < LEAST_SHARE || !most.iter().all(|s| s.is_finite()) {
            return None;
        }
        // Bounds that no part exceeds with them are bounds as well.
        for _ in 0..ROUNDS {
            let of = |axis: usize| {
                let parts = self.own[axis].map(|part| part.with(most[1 - axis]));
                parts.as_flattened().iter().copied().fold(0.0, f32::max)
            };
            most = [of(0).min(most[0]), of(1).min(most[1])];
        }
        Some(most)
    }

    /// How steep what is ahead of each part is, to where u or v grows and to where it shrinks.
    fn beyond(&self, axis: usize, most: f32) -> [[f32; PARTS]; 2] {
        let [to_more, to_less] = self.ahead[axis].map(|way| way.map(|part| part.with(most)));
        let of = |way: usize| move |slopes: [f32; 2]| slopes[if self.is_turned { 1 - way } else { way }];
        let (mut to_more, mut to_less) = (to_more.map(of(0)), to_less.map(of(1)));
        (1..PARTS).for_each(|part| to_less[part] = to_less[part].max(to_less[part - 1]));
        (1..PARTS).rev().for_each(|part| to_more[part - 1] = to_more[part - 1].max(to_more[part]));
        [to_more, to_less]
    }
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
        let (of_u, of_v) = (of_u.try_normalize()?, of_v.try_normalize()?);
        let normal = of_u.cross(of_v).try_normalize()?;
        // Each at a right angle to the other's edges.
        let packed = [of_v.cross(normal), normal.cross(of_u)]
            .map(|m| (m * (PACKED / m.abs().max_element())).round().to_array().map(|x| x as i8));
        let along = packed.map(|m| Vec3::from_array(m.map(f32::from)));
        Some(Self { packed, along, up: along[0].cross(along[1]) })
    }

    fn measure_of(&self, axis: usize) -> Measure {
        const ERROR: f32 = 1.0 / 1_048_576.0;
        let errors = [PACKED, self.up.abs().max_element()].map(|most| most * ERROR);
        Measure { along: self.along[axis], across: self.along[1 - axis], up: self.up, errors }
    }

    /// The horizon of a surface with these slopes; [`NONE`](Horizon::NONE) if it is too steep.
    fn horizon(&self, slopes: &Slopes) -> Horizon {
        let Some(most) = slopes.bounds() else { return Horizon::NONE };
        let mut rises = [0, 1].map(|axis| slopes.beyond(axis, most[1 - axis]).map(|way| way.map(rounded_up)));
        let is_gentle = most[0] * self.along[0].length() + most[1] * self.along[1].length() < 0.9 * self.up.length();
        for (u, v) in (0..PARTS).flat_map(|v| (0..PARTS).map(move |u| (u, v))) {
            if !is_gentle && self.is_too_steep(&rises, slopes, most, [u, v]) {
                let of = |axis: usize, part: usize| rises[axis].map(|way| way[part]);
                let (axis, part) = if of(0, u).iter().max() > of(1, v).iter().max() { (0, u) } else { (1, v) };
                rises[axis].iter_mut().for_each(|way| way[part] = NEVER);
            }
        }
        let frame_of = |axis: usize| {
            let [x, y, z] = self.packed[axis].map(|x: i8| x.cast_unsigned().wrapping_add(BIAS));
            [x, y, z, slopes.parts[axis]]
        };
        let mut frame = [frame_of(0), frame_of(1)];
        frame[0][3] |= if slopes.is_turned { IS_TURNED } else { 0 };
        Horizon { frame, rises }
    }

    /// Whether the normal of a triangle in this part of the patch may be below one of the planes of chords from there.
    fn is_too_steep(&self, rises: &[[[i8; PARTS]; 2]; 2], slopes: &Slopes, most: [f32; 2], parts: [usize; 2]) -> bool {
        let rises = [0, 1].map(|axis| rises[axis].map(|way| way[parts[axis]]));
        let own = [0, 1].map(|axis| slopes.own[axis][parts[axis]]);
        if rises.as_flattened().contains(&NEVER) || own.iter().any(|part| part.rise == NO_EDGE) {
            return false;
        }
        let least = -MOST_STEEP * self.up.length_squared();
        let mut own = [own[0].with(most[1]), own[1].with(most[0])];
        if slopes.is_turned {
            own.iter_mut().for_each(|ways| ways.reverse());
        }
        let (planes, triangles) = (self.corners(rises.map(|r| r.map(f32::from))), self.corners(own));
        planes.iter().any(|plane| triangles.iter().any(|triangle| plane.dot(*triangle) < least))
    }

    /// What is to be taken from n for the normals of planes with these slopes along u and v.
    fn corners(&self, [[a, b], [c, d]]: [[f32; 2]; 2]) -> [Vec3; 4] {
        let [m_u, m_v] = self.along;
        [[a, c], [a, -d], [-b, c], [-b, -d]].map(|[u, v]| u * m_u + v * m_v)
    }
}

/// A rise as a number of units, with some margin.
fn rounded_up(rise: f32) -> i8 {
    // Saturates.
    (rise + MARGIN * rise.abs()).ceil() as i8
}

impl<F: Copy> Steepest<F> {
    #[inline(always)]
    fn none<K: Kernel<F = F>>(k: K) -> Self {
        Self { rise: k.splat(NO_EDGE), fall: k.splat(NO_EDGE), astray: k.splat(0.0) }
    }

    /// One lane after the other.
    #[inline(always)]
    fn lanes<K: Kernel<F = F>>(self, k: K) -> [Steepest<f32>; 8] {
        let [rise, fall, astray] = [k.store(self.rise), k.store(self.fall), k.store(self.astray)];
        std::array::from_fn(|lane| Steepest { rise: rise[lane], fall: fall[lane], astray: astray[lane] })
    }
}

impl Steepest<f32> {
    const NONE: Self = Self { rise: NO_EDGE, fall: NO_EDGE, astray: 0.0 };

    #[inline(always)]
    fn take_in(&mut self, other: Self) {
        self.rise = self.rise.max(other.rise);
        self.fall = self.fall.max(other.fall);
        self.astray = self.astray.max(other.astray);
    }

    /// Slopes of planes, to where u or v grows and to where it shrinks, if those across are at most `most`.
    fn with(self, most: f32) -> [f32; 2] {
        [self.rise + most * self.astray, self.fall + most * self.astray]
    }
}

impl Measure {
    /// The steepest of what was seen and of eight edges, but for those that are [`HIDDEN`]. An edge without length has slopes of zero.
    #[inline(always)]
    fn steeper<K: Kernel>(self, k: K, edges: [K::F; 3], hide: K::F, seen: Steepest<K::F>) -> Steepest<K::F> {
        let [x, y, z] = edges;
        let size = k.add(k.add(k.abs(x), k.abs(y)), k.abs(z));
        let [error, error_up] = [k.mul(size, k.splat(self.errors[0])), k.mul(size, k.splat(self.errors[1]))];
        let height = dot(k, edges, self.up);
        let way = k.max(k.sub(dot(k, edges, self.along), error), k.splat(TINY));
        let astray = k.add(k.abs(dot(k, edges, self.across)), error);
        let per_way = k.div(k.splat(1.0), way);
        let (slope, error) = (k.mul(height, per_way), k.sub(k.mul(error_up, per_way), hide));
        Steepest {
            rise: k.max(k.add(error, slope), seen.rise),
            fall: k.max(k.sub(error, slope), seen.fall),
            astray: k.max(k.sub(k.mul(astray, per_way), hide), seen.astray),
        }
    }
}

/// Takes in all edges of a piece but those of cells at moved sides.
#[inline(always)]
fn measure<K: Kernel>(
    k: K,
    [by_u, by_v]: [Measure; 2],
    piece: &PieceView<'_>,
    [low, right, high, left]: [bool; 4],
    slopes: &mut Slopes,
) {
    let (CellRect { i0, j0, .. }, [n_u, n_v]) = (piece.cells(), piece.cells().size());
    // Columns of vertices: those at moved sides, and lanes beyond the last.
    let first = usize::from(left);
    let hide = |end: usize| -> [f32; 8] {
        std::array::from_fn(|lane| if (first..end).contains(&lane) { 0.0 } else { HIDDEN })
    };
    let columns = n_u - usize::from(right);
    let (hide_u, hide_low) = (k.load(&hide(columns)), k.load(&hide(columns + 1)));
    // The ninth column, in the last lane of those that begin at the second.
    let has_ninth = columns == MAX_CELLS;
    let hide_high = k.load(&[HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, 0.0]);
    let (begin, end) = (usize::from(low), n_v - usize::from(high));
    let mut of_u = Steepest::none(k);
    let mut row = Row::of(k, piece, begin.min(n_v));
    for j in begin..=end {
        of_u = by_u.steeper(k, edges(k, row.low, row.high), hide_u, of_u);
        if j == end {
            break;
        }
        let next = Row::of(k, piece, j + 1);
        let mut of_v = by_v.steeper(k, edges(k, row.low, next.low), hide_low, Steepest::none(k));
        if has_ninth {
            of_v = by_v.steeper(k, edges(k, row.high, next.high), hide_high, of_v);
        }
        let mut of_row = Steepest::NONE;
        of_v.lanes(k).into_iter().for_each(|lane| of_row.take_in(lane));
        slopes.add(1, usize::from(j0) + j, of_row);
        row = next;
    }
    of_u.lanes(k)[..n_u].iter().enumerate().for_each(|(lane, seen)| slopes.add(0, usize::from(i0) + lane, *seen));
}

/// Triangles at a moved side of a piece, by their derivatives along u and v.
#[derive(Default)]
struct Strip {
    /// x, y and z along u, and along v.
    derivatives: [[[f32; 8]; 3]; 2],
    cells: [[usize; 2]; 8],
    n: usize,
}

/// A vertex: where it lies in u and v, in cells, and in the lattice.
type Corner = (DVec2, DVec3);

impl Strip {
    /// Those of all pieces of a patch. `None` if a triangle lies the wrong way round.
    fn of_pieces<'a>(pieces: impl Iterator<Item = PieceView<'a>>, borders: &Borders) -> Option<Vec<Self>> {
        let mut strips = Vec::new();
        for piece in pieces {
            let sides = borders.moved_sides(piece.cells());
            for side in (0..4).filter(|&side| sides[side]) {
                strips.extend(Self::at_side(&piece, side, borders)?);
            }
        }
        Some(strips)
    }

    /// The two triangles of each cell.
    fn at_side(piece: &PieceView<'_>, side: usize, borders: &Borders) -> Option<[Self; 2]> {
        let (CellRect { i0, j0, .. }, [n_u, n_v]) = (piece.cells(), piece.cells().size());
        let corner = |[i, j]: [usize; 2]| {
            let place = borders.place([usize::from(i0) + i, usize::from(j0) + j]);
            (place, IVec3::from_array(piece.vertex(i, j)).as_dvec3())
        };
        let (is_along_u, n) = (side == 0 || side == 2, [n_u, n_v][side % 2]);
        let cell = |along: usize| match side {
            0 => [along, 0],
            1 => [n_u - 1, along],
            2 => [along, n_v - 1],
            _ => [0, along],
        };
        let ends = |along: usize| {
            let [i, j] = cell(along);
            [corner([i, j]), corner(if is_along_u { [i, j + 1] } else { [i + 1, j] })]
        };
        let mut strips = [Self::default(), Self::default()];
        let mut last = ends(0);
        for along in 0..n {
            let next = ends(along + 1);
            let ([a, d], c) = if is_along_u { (last, next[1]) } else { ([last[0], next[0]], next[1]) };
            let b = if is_along_u { next[0] } else { last[1] };
            let [i, j] = cell(along);
            let cell = [usize::from(i0) + i, usize::from(j0) + j];
            strips[0].add(cell, [a, b, d])?;
            strips[1].add(cell, [c, d, b])?;
            last = next;
        }
        Some(strips)
    }

    /// Adds a triangle of a cell, unless it has no area in u and v, as where vertices have moved to one place.
    fn add(&mut self, cell: [usize; 2], [(at_a, a), (at_b, b), (at_c, c)]: [Corner; 3]) -> Option<()> {
        if at_a == at_b || at_a == at_c || at_b == at_c {
            return Some(());
        }
        let (to_b, to_c, b, c) = (at_b - at_a, at_c - at_a, b - a, c - a);
        // A tenth of a cell's: what is flatter than that, rounding may have turned.
        if to_b.perp_dot(to_c) < 0.1 {
            return None;
        }
        let derivatives = [b * to_c.y - c * to_b.y, c * to_b.x - b * to_c.x];
        for (lanes, derivative) in self.derivatives.iter_mut().zip(derivatives) {
            let [x, y, z] = derivative.as_vec3().to_array();
            (lanes[0][self.n], lanes[1][self.n], lanes[2][self.n]) = (x, y, z);
        }
        self.cells[self.n] = cell;
        self.n += 1;
        Some(())
    }

    #[inline(always)]
    fn measure<K: Kernel>(&self, k: K, by: [Measure; 2], slopes: &mut Slopes) {
        let hide = k.load(&std::array::from_fn(|lane| if lane < self.n { 0.0 } else { HIDDEN }));
        for axis in [0, 1] {
            let [x, y, z] = &self.derivatives[axis];
            let steepest = by[axis].steeper(k, [k.load(x), k.load(y), k.load(z)], hide, Steepest::none(k));
            for (seen, cell) in steepest.lanes(k).into_iter().zip(&self.cells[..self.n]) {
                slopes.add(axis, cell[axis], seen);
            }
        }
    }
}

#[inline(always)]
fn dot<K: Kernel>(k: K, [x, y, z]: [K::F; 3], v: Vec3) -> K::F {
    k.add(k.add(k.mul(x, k.splat(v.x)), k.mul(y, k.splat(v.y))), k.mul(z, k.splat(v.z)))
}

/// Eight edges, from vertices to vertices.
#[inline(always)]
fn edges<K: Kernel>(k: K, from: [K::F; 3], to: [K::F; 3]) -> [K::F; 3] {
    [k.sub(to[0], from[0]), k.sub(to[1], from[1]), k.sub(to[2], from[2])]
}

/// Nine vertices of a row, from the piece's corner: x, y and z. Where it has fewer, it is filled up with the last one.
struct Row<K: Kernel> {
    /// Of all but the last.
    low: [K::F; 3],
    /// Of all but the first.
    high: [K::F; 3],
}

impl<K: Kernel> Row<K> {
    /// Row `j` of a piece whose coordinates have two or three bytes.
    #[inline(always)]
    fn of(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        match (piece.head.format, piece.columns()) {
            (2, MOST_COLUMNS) => Self::load::<2>(k, piece, j),
            (3, MOST_COLUMNS) => Self::load::<3>(k, piece, j),
            (2, _) => Self::of_few::<2>(k, piece, j),
            _ => Self::of_few::<3>(k, piece, j),
        }
    }

    #[inline(always)]
    fn load<const BYTES: usize>(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        debug_assert!(piece.columns() == MOST_COLUMNS && j < piece.rows());
        let at = |axis: usize, first: usize| [0, 4].map(|more| piece.row_start(j, axis) + BYTES * (first + more));
        // No closure for the loads: it would be compiled without the kernel's instructions.
        let ([x, y, z], [next_x, next_y, next_z]) = ([at(0, 0), at(1, 0), at(2, 0)], [at(0, 1), at(1, 1), at(2, 1)]);
        // SAFETY: `PieceView::new` checked that the bytes hold every vertex and the tail after them. The row has nine vertices, so that each place, vertex 0, 1, 4 or 5,
        // is at least four coordinates before the row's end. The load reads four coordinates, and for BYTES = 3 four bytes more, fewer than the tail has.
        let [low, high] = unsafe {
            [
                [
                    k.integers::<BYTES>(piece.bytes, x, 0),
                    k.integers::<BYTES>(piece.bytes, y, 0),
                    k.integers::<BYTES>(piece.bytes, z, 0),
                ],
                [
                    k.integers::<BYTES>(piece.bytes, next_x, 0),
                    k.integers::<BYTES>(piece.bytes, next_y, 0),
                    k.integers::<BYTES>(piece.bytes, next_z, 0),
                ],
            ]
        };
        Self { low, high }
    }

    /// The same, number by number, of a row with fewer vertices.
    #[inline(always)]
    fn of_few<const BYTES: usize>(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| few::<BYTES>(piece, j, axis));
        Self {
            low: [k.load(eight(&x, 0)), k.load(eight(&y, 0)), k.load(eight(&z, 0))],
            high: [k.load(eight(&x, 1)), k.load(eight(&y, 1)), k.load(eight(&z, 1))],
        }
    }
}

/// One coordinate of a row's vertices, and of the last one where it has fewer than nine.
#[inline(always)]
fn few<const BYTES: usize>(piece: &PieceView<'_>, j: usize, axis: usize) -> [f32; MOST_COLUMNS] {
    let bytes = &piece.bytes[piece.row_start(j, axis)..][..BYTES * piece.columns()];
    let (mut row, mut last) = ([0.0; MOST_COLUMNS], 0.0);
    let mut numbers = bytes.chunks_exact(BYTES);
    for x in &mut row {
        if let Some(number) = numbers.next() {
            let third = if BYTES == 3 { number[2] } else { 0 };
            last = u32::from_le_bytes([number[0], number[1], third, 0]) as f32;
        }
        *x = last;
    }
    row
}

#[inline(always)]
fn eight(row: &[f32; MOST_COLUMNS], from: usize) -> &[f32; 8] {
    row[from..].first_chunk().expect("nine, from 0 or 1 on")
}
