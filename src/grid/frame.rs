//! The axes along which a patch is seen from itself, packed: where directions lead along u and v, and how far up.

use crate::math::simd::Kernel;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Parts into which a patch's cells are divided along u, and along v: where in it a ray starts is known that well.
pub(super) const PARTS: usize = 4;

/// Length of the longest component of a packed vector.
pub(super) const PACKED: f32 = 63.0;

/// By how much a direction of length 1 or so has to be higher than what it is to clear, where it does not lead as far
/// along the surface as it is high: errors of scalar products with components of some 2^13 at most.
pub(super) const MARGIN_IN_HEIGHT: f32 = 0.25;

/// This is added to components of packed vectors, so that none is negative.
const BIAS: u8 = 128;

const IS_TURNED: u8 = 0x80;

/// Two vectors m_u and m_v, and n = m_u x m_v or its opposite, with the number of the patch's cells.
///
/// Of a vector w, m_u·w and m_v·w are its **ways** along u and v, n·w is its **height**.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct PackedFrame {
    /// For u and v: m_u or m_v, and 64 times the parts in a cell. The highest bit of the first of those is set if n is
    /// turned.
    axes: [[u8; 4]; 2],
}

/// A direction along the axes of a frame.
pub(super) struct Course {
    /// Ways along u and v, without their signs.
    pub ways: [f32; 2],
    /// Whether they are negative: 1 or 0.
    pub shrinks: [u32; 2],
    pub height: f32,
}

impl PackedFrame {
    /// A frame in which nothing has any way.
    pub const NONE: Self = Self { axes: [[BIAS, BIAS, BIAS, 0]; 2] };

    /// Packs whole vectors of components up to [`PACKED`].
    pub fn new(along: [Vec3; 2], parts_per_cell: [u8; 2], is_turned: bool) -> Self {
        let mut axes = [0, 1].map(|axis| {
            let [x, y, z] = (along[axis] + f32::from(BIAS)).to_array().map(|x| x as u8);
            [x, y, z, parts_per_cell[axis]]
        });
        axes[0][3] |= if is_turned { IS_TURNED } else { 0 };
        Self { axes }
    }

    /// A direction, in both halves of the lanes, in this frame.
    #[inline(always)]
    pub fn course<K: Kernel>(self, k: K, direction: K::F) -> Course {
        const YZX: i32 = 0b11_00_10_01;
        const ZXY: i32 = 0b11_01_00_10;
        let bias = k.splat(f32::from(BIAS));
        // m_u and m_v, and the other way round.
        let m = k.sub(k.widen(bytemuck::cast_ref(&self.axes)), bias);
        let [first, second] = self.axes;
        let other = k.sub(k.widen(bytemuck::cast_ref(&[second, first])), bias);
        let up = k.sub(
            k.mul(k.shuffle::<YZX>(m), k.shuffle::<ZXY>(other)),
            k.mul(k.shuffle::<ZXY>(m), k.shuffle::<YZX>(other)),
        );
        let (ways, heights) = (sum_of_three(k, k.mul(m, direction)), sum_of_three(k, k.mul(up, direction)));
        let signs = k.negative(ways);
        let (ways, heights) = (k.store(k.abs(ways)), k.store(heights));
        let height = if self.axes[0][3] & IS_TURNED != 0 { heights[4] } else { heights[0] };
        Course { ways: [ways[0], ways[4]], shrinks: [signs & 1, signs >> 4 & 1], height }
    }

    /// The part of the patch in which a cell is. (That of a cell which is not there is some part.)
    #[inline(always)]
    pub fn part(self, [i, j]: [u32; 2]) -> [u32; 2] {
        let [[.., parts_u], [.., parts_v]] = self.axes;
        [part(i, parts_u & !IS_TURNED), part(j, parts_v)]
    }

    /// As [`part`](Self::part), its half along u and along v: 0 to 7 each.
    #[inline(always)]
    pub fn half_part(self, [i, j]: [u32; 2]) -> [u32; 2] {
        let [[.., parts_u], [.., parts_v]] = self.axes;
        [half_part(i, parts_u & !IS_TURNED), half_part(j, parts_v)]
    }
}

/// In each half, the sum of lanes 0 to 2, in lane 0.
#[inline(always)]
fn sum_of_three<K: Kernel>(k: K, x: K::F) -> K::F {
    k.add(k.add(x, k.shuffle::<0b01_01_01_01>(x)), k.shuffle::<0b10_10_10_10>(x))
}

/// 64 times the parts in one of `n` cells, so that no cell is in a fifth part.
pub(super) fn parts_per_cell(n: usize) -> u8 {
    (64 * PARTS / n.max(1)).min(127) as u8
}

/// The part in which a cell is, by [`parts_per_cell`].
#[inline(always)]
pub(super) fn part(cell: u32, parts_per_cell: u8) -> u32 {
    cell * u32::from(parts_per_cell) / 64 % PARTS as u32
}

/// The half of a part in which a cell is, of all of the patch's: 2 `part` or one more.
#[inline(always)]
pub(super) fn half_part(cell: u32, parts_per_cell: u8) -> u32 {
    cell * u32::from(parts_per_cell) / 32 % (2 * PARTS as u32)
}

/// m_u and m_v for a patch that leads along `of_u` and `of_v` on the whole, each at a right angle to the other's edges;
/// `None` if it leads nowhere.
pub(super) fn axes(of_u: Vec3, of_v: Vec3) -> Option<[Vec3; 2]> {
    let (of_u, of_v) = (of_u.try_normalize()?, of_v.try_normalize()?);
    let normal = of_u.cross(of_v).try_normalize()?;
    Some([of_v.cross(normal), normal.cross(of_u)].map(|m| (m * (PACKED / m.abs().max_element())).round()))
}
