//! How steep a tessellated surface is, seen from itself: so that rays that leave it need not be tested against it.

#![allow(unsafe_code)]

use super::{LatticeRay, MAX_CELLS, PieceView, VertexFormat};
use crate::math::simd::{self, Kernel, Task};
use glam::{IVec3, Vec3};

/// Cones that are wider than this slope are of no use. Below 1, a point off a triangle of the surface, along its normal, is
/// off the surface (see [`ChordCone`]); a ray at a right angle to the axis of such a cone leaves few surfaces.
const MOST_SLOPE: f32 = 0.75;

/// By how much a ray has to be steeper than every chord, for the roundings of both: some 2^-20.
const MARGIN: f32 = 1.0 / 1024.0;

/// Vertices in a row of the widest piece.
const MOST_COLUMNS: usize = MAX_CELLS + 1;

/// The least lattice distance that counts as one when a slope is found.
const TINY: f32 = 1e-30;

/// An axis n and a slope s that no **chord** of a surface exceeds: |n·(q - p)| <= s |(q - p) - n (n·(q - p))| for every two
/// points p and q of it.
///
/// A ray that starts on the surface and is steeper than that, to whichever side, does not meet the surface again: all that it
/// could meet is on chords from its start. The same holds where it starts above a point p of the surface, on the side that it leaves
/// to, as long as the way from p to the start is as steep. Along the normal of a triangle at p it is, for s < 1: the
/// triangle's edges are chords, so its normal makes an angle of atan(s) with n at most, and that is less than a right angle minus
/// atan(s).
///
/// # How it is found
/// Let u and v run over the cells of a grid. On each of a cell's two triangles the surface is linear in u and v, with two of the
/// cell's edges as derivatives. So a chord is a sum of u-edges times what u changes and of v-edges times what v changes, all of u's shares
/// of one sign and all of v's. With m a unit vector at a right angle to n, and every edge W of the sum, turned with its share's sign, within |n·W| <= s (m·W),
/// the chord C has |n·C| <= s (m·C), which is at most s times C's part across n. One m serves chords along which u and v grow or shrink
/// together, the difference of two directions those of which one grows and the other shrinks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ChordCone {
    /// Along n, of any length but zero.
    axis: [i8; 3],
    /// The sine of the angle over the plane across n from which on rays leave, in units of 1 / [`SINES`]; [`NO_SINE`] if none does.
    sine: u8,
}

/// Parts of one that sines are rounded up to: that of [`MOST_SLOPE`] is below 240.
const SINES: f32 = 384.0;

const NO_SINE: u8 = 240;

impl ChordCone {
    /// Of a surface that may be seen from itself anywhere.
    pub const NONE: Self = Self { axis: [0, 0, 1], sine: NO_SINE };

    /// The cone of all pieces of one grid together; [`NONE`](Self::NONE) if it would be too wide.
    pub fn of_pieces<'a>(pieces: impl Iterator<Item = PieceView<'a>> + Clone) -> Self {
        simd::run(OfPieces(pieces))
    }

    /// As 32 bits, not all of them set.
    pub fn to_bits(self) -> u32 {
        let [x, y, z] = self.axis.map(i8::cast_unsigned);
        u32::from_le_bytes([x, y, z, self.sine])
    }

    /// From [`to_bits`](Self::to_bits).
    #[inline(always)]
    pub fn from_bits(bits: u32) -> Self {
        let [x, y, z, sine] = bits.to_le_bytes();
        Self { axis: [x.cast_signed(), y.cast_signed(), z.cast_signed()], sine }
    }

    /// Whether the ray is so steep that it does not meet the surface that it starts on, or above as said.
    #[inline(always)]
    pub fn is_left_by(self, ray: &LatticeRay) -> bool {
        // One by one: mapped arrays are calls.
        let axis = [f32::from(self.axis[0]), f32::from(self.axis[1]), f32::from(self.axis[2])];
        let ([kx, ky, kz], [shear_x, shear_y, _]) = (ray.sides.axes, ray.shear);
        let (x, y, z) = (axis[kx as usize], axis[ky as usize], axis[kz as usize]);
        // Times the axis's length, in units of the direction's largest component.
        let height = shear_x * x + shear_y * y + z;
        let sine = f32::from(self.sine) * (1.0 / SINES);
        let squared_length = (x * x + y * y + z * z) * (shear_x * shear_x + shear_y * shear_y + 1.0);
        self.sine < NO_SINE && height * height >= sine * sine * squared_length
    }
}

struct OfPieces<I>(I);

impl<'a, I: Iterator<Item = PieceView<'a>> + Clone> Task for OfPieces<I> {
    type Output = ChordCone;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> ChordCone {
        let Self(pieces) = self;
        // Corners of 32-bit pieces are no exact floats.
        if pieces.clone().any(|piece| piece.head.format == VertexFormat::Four as u8) {
            return ChordCone::NONE;
        }
        let Some(frame) = Frame::of_pieces(pieces.clone()) else { return ChordCone::NONE };
        let mut steepest = k.splat(0.0);
        for piece in pieces {
            steepest = frame.steepest(k, &piece, steepest);
        }
        let slope = k.store(steepest).into_iter().fold(0.0, f32::max);
        if slope >= MOST_SLOPE {
            return ChordCone::NONE;
        }
        let slope = slope * (1.0 + MARGIN) + MARGIN;
        let sine = slope / (1.0 + slope * slope).sqrt();
        ChordCone { axis: frame.packed_axis, sine: (SINES * sine).ceil() as u8 }
    }
}

/// Unit vectors that a grid's edges are measured by.
struct Frame {
    packed_axis: [i8; 3],
    /// The same with a length of one.
    axis: Vec3,
    /// Between u and v, and between u and minus v, both at right angles to the axis but for rounding.
    along: [Vec3; 2],
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
        let normal = of_u.try_normalize()?.cross(of_v.try_normalize()?).try_normalize()?;
        let packed_axis = (normal * (127.0 / normal.abs().max_element())).round().to_array().map(|x| x as i8);
        let axis = Vec3::from_array(packed_axis.map(f32::from)).normalize();
        let across = |v: Vec3| v.reject_from_normalized(axis).try_normalize();
        let (of_u, of_v) = (across(of_u)?, across(of_v)?);
        Some(Self { packed_axis, axis, along: [across(of_u + of_v)?, across(of_u - of_v)?] })
    }

    /// The greater of `steepest` and the slopes of a piece's edges, lane by lane.
    #[inline(always)]
    fn steepest<K: Kernel>(&self, k: K, piece: &PieceView<'_>, mut steepest: K::F) -> K::F {
        let mut row = Row::of(k, piece, 0);
        steepest = self.steeper(k, edges(k, row.low, row.high), [1.0, 1.0], steepest);
        for j in 1..piece.rows() {
            let next = Row::of(k, piece, j);
            steepest = self.steeper(k, edges(k, next.low, next.high), [1.0, 1.0], steepest);
            steepest = self.steeper(k, edges(k, row.low, next.low), [1.0, -1.0], steepest);
            steepest = self.steeper(k, edges(k, row.high, next.high), [1.0, -1.0], steepest);
            row = next;
        }
        steepest
    }

    /// The greater of `steepest` and the slopes of eight edges, by both vectors along the surface, turned by signs.
    ///
    /// A scalar product errs by 2^-22 of the sum of the edge's components at most, since those of unit vectors are at most 1: heights are taken so much
    /// larger, ways along so much shorter. An edge without length has no slope.
    #[inline(always)]
    fn steeper<K: Kernel>(&self, k: K, edges: [K::F; 3], signs: [f32; 2], mut steepest: K::F) -> K::F {
        const ERROR: f32 = 1.0 / 1_048_576.0;
        let [x, y, z] = edges;
        let size = k.add(k.add(k.abs(x), k.abs(y)), k.abs(z));
        let error = k.mul(size, k.splat(ERROR));
        let height = k.add(k.abs(dot(k, edges, self.axis)), error);
        for (along, sign) in self.along.into_iter().zip(signs) {
            let way = k.max(k.sub(dot(k, edges, sign * along), error), k.splat(TINY));
            steepest = k.max(k.div(height, way), steepest);
        }
        steepest
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
