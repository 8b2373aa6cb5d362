//! How high a tessellated surface rises, seen from itself: so that rays that leave it need not be tested against it.

#![allow(unsafe_code)]

use super::{CellRect, LatticeRay, MAX_CELLS, PieceView, VertexFormat};
use crate::math::simd::{self, Kernel, Task};
use bytemuck::{Pod, Zeroable};
use glam::{IVec3, Vec3};

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

/// The greatest slope across that is tried.
const MOST_RISE: f32 = 500.0;

const PASSES: usize = 1;

const MARGIN: f32 = 1.0 / 1024.0;

/// The same for what is not as far along the surface as it is high: errors of scalar products with components of some 2^13 at most.
const MARGIN_IN_HEIGHT: f32 = 0.25;

/// Vertices in a row of the widest piece.
const MOST_COLUMNS: usize = MAX_CELLS + 1;

/// The least lattice distance that counts as one when a slope is found.
const TINY: f32 = 1e-30;

/// The slope of parts without cells.
const NO_EDGE: f32 = f32::MIN;

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

    /// The horizon of all pieces of one grid together, which is over these cells, on the side to which the ray leaves it;
    /// [`NONE`](Self::NONE) if the surface is too steep.
    pub fn of_pieces<'a>(
        pieces: impl Iterator<Item = PieceView<'a>> + Clone,
        cells: CellRect,
        ray: &LatticeRay,
    ) -> Self {
        let is_turned = pieces.clone().any(|piece| leaves_below(&piece, ray));
        simd::run(OfPieces { pieces, cells, is_turned })
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

struct OfPieces<I> {
    pieces: I,
    cells: CellRect,
    is_turned: bool,
}

impl<'a, I: Iterator<Item = PieceView<'a>> + Clone> Task for OfPieces<I> {
    type Output = Horizon;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Horizon {
        let Self { pieces, cells, is_turned } = self;
        // Corners of 32-bit pieces are no exact floats.
        if pieces.clone().any(|piece| piece.head.format == VertexFormat::Four as u8) {
            return Horizon::NONE;
        }
        let Some(frame) = Frame::of_pieces(pieces.clone()) else { return Horizon::NONE };
        let mut most = [0.0; 2];
        let mut slopes = frame.slopes(k, pieces.clone(), cells, most);
        for pass in 0..PASSES {
            most = if pass == 0 { slopes.bounds() } else { slopes.both() };
            slopes = frame.slopes(k, pieces.clone(), cells, most);
        }
        frame.horizon(slopes, most, is_turned)
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
    /// Slope across.
    most: f32,
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

/// How steep the edges of each part are at most, along u and along v.
struct Slopes {
    parts: [u8; 2],
    rise: [[f32; PARTS]; 2],
    fall: [[f32; PARTS]; 2],
    astray: [f32; 2],
}

impl Slopes {
    fn new(cells: CellRect) -> Self {
        let none = [[NO_EDGE; PARTS]; 2];
        Self { parts: cells.size().map(parts_per_cell), rise: none, fall: none, astray: [0.0; 2] }
    }

    /// Takes in edges along u (0) or v (1) of cell `cell` in that direction.
    #[inline(always)]
    fn add(&mut self, axis: usize, cell: usize, rise: f32, fall: f32) {
        let part = part(cell as u32, self.parts[axis]) as usize;
        self.rise[axis][part] = self.rise[axis][part].max(rise);
        self.fall[axis][part] = self.fall[axis][part].max(fall);
    }

    /// Slopes that no plane exceeds, if these are the slopes of edges that lead nowhere astray.
    fn bounds(&self) -> [f32; 2] {
        let ([r_u, r_v], [k_u, k_v]) = (self.both(), self.astray);
        let share = 1.0 - k_u * k_v;
        let most = if share > 0.1 { [(r_u + r_v * k_u) / share, (r_v + r_u * k_v) / share] } else { [MOST_RISE; 2] };
        most.map(|s| (s * (1.0 + MARGIN)).min(MOST_RISE))
    }

    /// The steepest edges of each part and all beyond it, to where u or v grows and to where it shrinks.
    fn beyond(&self, axis: usize) -> [[f32; PARTS]; 2] {
        let (mut to_more, mut to_less) = (self.rise[axis], self.fall[axis]);
        (1..PARTS).for_each(|part| to_less[part] = to_less[part].max(to_less[part - 1]));
        (1..PARTS).rev().for_each(|part| to_more[part - 1] = to_more[part - 1].max(to_more[part]));
        [to_more, to_less]
    }

    fn both(&self) -> [f32; 2] {
        [self.greatest(0), self.greatest(1)]
    }

    /// The greatest slope along u or v, to either side.
    fn greatest(&self, axis: usize) -> f32 {
        self.rise[axis].into_iter().chain(self.fall[axis]).fold(0.0, f32::max)
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
        let packed = [of_v.cross(normal), normal.cross(of_u)].map(|m| {
            (m * (PACKED / m.abs().max_element())).round().to_array().map(|x| x as i8)
        });
        let along = packed.map(|m| Vec3::from_array(m.map(f32::from)));
        Some(Self { packed, along, up: along[0].cross(along[1]) })
    }

    #[inline(always)]
    fn slopes<'a, K: Kernel>(
        &self,
        k: K,
        pieces: impl Iterator<Item = PieceView<'a>>,
        cells: CellRect,
        most: [f32; 2],
    ) -> Slopes {
        let mut slopes = Slopes::new(cells);
        for piece in pieces {
            self.measure(k, &piece, most, &mut slopes);
        }
        slopes
    }

    fn measure_of(&self, axis: usize, most: [f32; 2]) -> Measure {
        const ERROR: f32 = 1.0 / 1_048_576.0;
        let errors = [PACKED, self.up.abs().max_element()].map(|most| most * ERROR);
        Measure { along: self.along[axis], across: self.along[1 - axis], up: self.up, most: most[1 - axis], errors }
    }

    /// Takes in all edges of a piece.
    #[inline(always)]
    fn measure<K: Kernel>(&self, k: K, piece: &PieceView<'_>, most: [f32; 2], slopes: &mut Slopes) {
        let (CellRect { i0, j0, .. }, [n_u, n_v]) = (piece.cells(), piece.cells().size());
        let (by_u, by_v) = (self.measure_of(0, most), self.measure_of(1, most));
        let mut row = Row::of(k, piece, 0);
        let mut of_u = by_u.steeper(k, edges(k, row.low, row.high), Steepest::none(k));
        for j in 1..=n_v {
            let next = Row::of(k, piece, j);
            of_u = by_u.steeper(k, edges(k, next.low, next.high), of_u);
            let of_v = by_v.steeper(k, edges(k, row.low, next.low), Steepest::none(k));
            let of_v = by_v.steeper(k, edges(k, row.high, next.high), of_v);
            let Steepest { rise, fall, astray } = of_v.greatest(k);
            slopes.add(1, usize::from(j0) + j - 1, rise, fall);
            slopes.astray[1] = slopes.astray[1].max(astray);
            row = next;
        }
        let (rise, fall) = (k.store(of_u.rise), k.store(of_u.fall));
        for lane in 0..n_u {
            slopes.add(0, usize::from(i0) + lane, rise[lane], fall[lane]);
        }
        slopes.astray[0] = slopes.astray[0].max(of_u.greatest(k).astray);
    }

    /// The horizon of a surface with these slopes, found with bounds on slopes across; [`NONE`](Horizon::NONE) if they do not hold.
    fn horizon(&self, mut slopes: Slopes, most: [f32; 2], is_turned: bool) -> Horizon {
        if !(slopes.greatest(0) <= most[0] && slopes.greatest(1) <= most[1]) {
            return Horizon::NONE;
        }
        if is_turned {
            std::mem::swap(&mut slopes.rise, &mut slopes.fall);
        }
        let mut rises = [0, 1].map(|axis| slopes.beyond(axis).map(|way| way.map(rounded_up)));
        for (u, v) in (0..PARTS).flat_map(|v| (0..PARTS).map(move |u| (u, v))) {
            if self.is_too_steep(&rises, &slopes, [u, v]) {
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
        frame[0][3] |= if is_turned { IS_TURNED } else { 0 };
        Horizon { frame, rises }
    }

    /// Whether the normal of a triangle in this part of the patch may be below one of the planes of chords from there.
    fn is_too_steep(&self, rises: &[[[i8; PARTS]; 2]; 2], slopes: &Slopes, parts: [usize; 2]) -> bool {
        let rises = [0, 1].map(|axis| rises[axis].map(|way| way[parts[axis]]));
        let own = [0, 1].map(|axis| [slopes.rise[axis], slopes.fall[axis]].map(|way| way[parts[axis]]));
        if rises.as_flattened().contains(&NEVER) || own.as_flattened().contains(&NO_EDGE) {
            return false;
        }
        let least = -MOST_STEEP * self.up.length_squared();
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

    /// Of all lanes.
    #[inline(always)]
    fn greatest<K: Kernel<F = F>>(self, k: K) -> Steepest<f32> {
        let [rise, fall, astray] = [k.store(self.rise), k.store(self.fall), k.store(self.astray)];
        let greatest = |lanes: [f32; 8]| lanes.into_iter().fold(NO_EDGE, f32::max);
        Steepest { rise: greatest(rise), fall: greatest(fall), astray: greatest(astray) }
    }
}

impl Measure {
    /// The steepest of what was seen and of eight edges. An edge without length has slopes of zero.
    #[inline(always)]
    fn steeper<K: Kernel>(self, k: K, edges: [K::F; 3], seen: Steepest<K::F>) -> Steepest<K::F> {
        let [x, y, z] = edges;
        let size = k.add(k.add(k.abs(x), k.abs(y)), k.abs(z));
        let [error, error_up] = [k.mul(size, k.splat(self.errors[0])), k.mul(size, k.splat(self.errors[1]))];
        let height = dot(k, edges, self.up);
        let way = k.max(k.sub(dot(k, edges, self.along), error), k.splat(TINY));
        let astray = k.add(k.abs(dot(k, edges, self.across)), error);
        let more = k.add(error_up, k.mul(astray, k.splat(self.most)));
        Steepest {
            rise: k.max(k.div(k.add(height, more), way), seen.rise),
            fall: k.max(k.div(k.sub(more, height), way), seen.fall),
            astray: k.max(k.div(astray, way), seen.astray),
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
        let (last, base) = (piece.columns() - 1, piece.head.base);
        let vertices: [[i32; 3]; MOST_COLUMNS] = std::array::from_fn(|i| piece.read::<BYTES>(i.min(last), j));
        let of = |axis: usize| vertices.map(|vertex| (vertex[axis] - base[axis]) as f32);
        let [x, y, z] = &[of(0), of(1), of(2)];
        Self {
            low: [k.load(eight(x, 0)), k.load(eight(y, 0)), k.load(eight(z, 0))],
            high: [k.load(eight(x, 1)), k.load(eight(y, 1)), k.load(eight(z, 1))],
        }
    }
}

#[inline(always)]
fn eight(row: &[f32; MOST_COLUMNS], from: usize) -> &[f32; 8] {
    row[from..].first_chunk().expect("nine, from 0 or 1 on")
}
