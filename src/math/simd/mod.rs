//! Eight floats at a time, the same bits on every processor.
//!
//! A **kernel** is a set of operations on eight lanes. [`Portable`] does them on arrays and works everywhere; [`Avx2`]
//! does them in registers. Traversal and intersection are written once, generic over [`Kernel`], and marked
//! `#[inline(always)]`. A [`Task`] is such code with its arguments; [`run`] picks the kernel and enters it through one
//! function compiled for that kernel's instructions, so that everything inlined into it uses them. Call [`run`] once
//! per batch of rays or once per ray, never per node.
//!
//! # Invariants
//! 1. Both kernels give the same bits: an operation is one IEEE operation, correctly rounded; none is fused. A fused
//!    multiply-add would also break the watertightness of triangles, whose edge functions must be exact negatives of
//!    each other. The one exception, [`Kernel::mul_add`], is for boxes, where it can change what is visited but not
//!    what is hit.
//! 2. An `Avx2` value exists only where the processor has AVX2: it is the witness that every `unsafe` block there leans
//!    on.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
pub use portable::Portable;

/// The operations on eight lanes that boxes and triangles are tested with.
pub trait Kernel: Copy + Send + Sync + 'static {
    /// Eight floats.
    type F: Copy;
    /// Four doubles: a point and a lane to spare, or one coordinate of four points.
    type D: Copy;
    /// Eight integers.
    type I: Copy;
    /// Eight places in an order, each a number of 16 bits: [`LAST`](Self::LAST) for a lane that is in none.
    type O: Copy;

    /// The place of a lane that has none, after all others.
    const LAST: u16 = u16::MAX;

    /// `x` in every lane.
    fn splat(self, x: f32) -> Self::F;
    /// The eight floats at `x`.
    fn load(self, x: &[f32; 8]) -> Self::F;
    /// The lanes as an array.
    fn store(self, x: Self::F) -> [f32; 8];
    /// Eight bytes as floats 0 to 255.
    fn widen(self, x: &[u8; 8]) -> Self::F;
    /// Eight signed bytes as floats.
    fn widen_signed(self, x: &[i8; 8]) -> Self::F;
    /// Lanewise sum.
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanewise difference.
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanewise product.
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanewise quotient.
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanewise `a b + c`, rounded once or twice: for boxes alone, whose test allows for either.
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// Lanewise `if a < b { a } else { b }`.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// Lanewise `if a > b { a } else { b }`.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// Bit k is set where `a <= b` in lane k.
    fn le(self, a: Self::F, b: Self::F) -> u32;
    /// Bit k is set where `a == b` in lane k.
    fn eq(self, a: Self::F, b: Self::F) -> u32;
    /// In each half of four lanes, `[a0, a1, b1, b2]`.
    fn pick_0112(self, a: Self::F, b: Self::F) -> Self::F;
    /// In each half of four lanes, `[a1, a2, b0, b1]`.
    fn pick_1201(self, a: Self::F, b: Self::F) -> Self::F;
    /// In each half of four lanes, lane `PICK >> 2 k & 3` of that half in place k.
    fn shuffle<const PICK: i32>(self, x: Self::F) -> Self::F;
    /// Lanewise without the sign.
    fn abs(self, x: Self::F) -> Self::F;
    /// Lanewise `magnitude`, which is not negative, with the sign of `sign`.
    fn with_sign(self, magnitude: Self::F, sign: Self::F) -> Self::F;
    /// Bit k is set where lane k has the sign bit.
    fn negative(self, x: Self::F) -> u32;
    /// Four integers as floats, in each half.
    fn floats_twice(self, x: &[i32; 4]) -> Self::F;
    /// In each half, lanes 0 to 2 of `scale` times two to the power of byte 0 to 2 of `powers`; the fourth lane is any
    /// number. `scale` and the result are neither zero, subnormal nor infinite.
    fn scaled_twice(self, scale: Self::F, powers: i32) -> Self::F;

    /// `x` in every lane.
    fn splat4(self, x: f64) -> Self::D;
    /// The four doubles at `x`.
    fn load4(self, x: &[f64; 4]) -> Self::D;
    /// The lanes as an array.
    fn store4(self, x: Self::D) -> [f64; 4];
    /// Lanewise sum.
    fn add4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise difference.
    fn sub4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise product.
    fn mul4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise quotient.
    fn div4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise `if a < b { a } else { b }`.
    fn min4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise `if a > b { a } else { b }`.
    fn max4(self, a: Self::D, b: Self::D) -> Self::D;
    /// Lanewise without the sign.
    fn abs4(self, x: Self::D) -> Self::D;
    /// The greatest of lanes 0 to 2, none of which is NaN.
    fn greatest_of_three(self, x: Self::D) -> f64;
    /// The lanes rounded to floats, in each half.
    fn floats_of(self, x: Self::D) -> Self::F;
    /// Lanewise the greatest whole number that is not above.
    fn floor4(self, x: Self::D) -> Self::D;
    /// Lanewise the nearest whole number, the even one of two.
    fn round4(self, x: Self::D) -> Self::D;
    /// Bit k is set where `a < b` in lane k.
    fn lt4(self, a: Self::D, b: Self::D) -> u32;
    /// The nearest integers, the even one of two; numbers are below 2^31 in magnitude.
    fn nearest4(self, x: Self::D) -> [i32; 4];
    /// Lane i of list k becomes lane k of list i.
    fn transpose4(self, x: [Self::D; 4]) -> [Self::D; 4];

    /// `x` in every lane.
    fn splat_i(self, x: i32) -> Self::I;
    /// The eight integers at `x`.
    fn load_i(self, x: &[i32; 8]) -> Self::I;
    /// Lanewise smaller one.
    fn min_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Lanewise greater one.
    fn max_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// Lanewise difference, wrapping.
    fn sub_i(self, a: Self::I, b: Self::I) -> Self::I;
    /// The lanes as an array.
    fn store_i(self, x: Self::I) -> [i32; 8];
    /// Lanes 0, 2, 4 and 6 of both.
    fn even_lanes(self, a: Self::I, b: Self::I) -> Self::I;
    /// The lower three bytes of each lane in little-endian order, those of four lanes together and four zeros after
    /// them.
    fn lower_threes(self, x: Self::I) -> [[u8; 16]; 2];
    /// Lanes of 32 bits, those first whose bits are set in `mask`, in their order; then lane 0 again and again.
    fn packed(self, x: &[u32; 8], mask: u8) -> [u32; 8];
    /// The lower halves of the lanes.
    fn lower_halves(self, x: Self::I) -> [u16; 8];

    /// Where lanes come in the order of `enter`, as [`place`] says; [`LAST`](Self::LAST) for those that are left before
    /// they are entered.
    fn in_order(self, enter: Self::F, leave: Self::F) -> Self::O;
    /// The first lane in the order, and its place.
    fn first(self, order: Self::O) -> (usize, u16);
    /// The order without a lane, 0 to 7.
    fn without(self, order: Self::O, lane: usize) -> Self::O;
    /// Whether a lane has a place.
    fn has_any(self, order: Self::O) -> bool;
    /// The places at `x`.
    fn load_order(self, x: &[u16; 8]) -> Self::O;
    /// The places as an array.
    fn store_order(self, x: Self::O) -> [u16; 8];

    /// Two runs of four little-endian unsigned integers of `BYTES` bytes each (2, 3 or 4), at `at[0]` and `at[1]`;
    /// `base` is added to each (wrapping) and the sums are converted to floats.
    ///
    /// # Safety
    /// `at[k] + 16 <= bytes.len()` for both k; for `BYTES` = 2, `at[k] + 8 <= bytes.len()` is enough.
    unsafe fn integers<const BYTES: usize>(self, bytes: &[u8], at: [usize; 2], base: i32) -> Self::F;

    /// Does `task` in a function compiled for this kernel's instructions: for code that must not be inlined into its
    /// caller.
    fn enter<T: Task>(self, task: T) -> T::Output;

    /// Asks for the cache line of `x`, which may be any address.
    fn prefetch<T>(self, x: *const T);
}

/// To this sum floats are added to come out as whole numbers of [`PLACE_STEP`]: their last 16 bits are the place.
const PLACE_ZERO: f32 = (1u64 << 33) as f32;

/// Lattice steps from one place in an order of distances to the next.
const PLACE_STEP: f32 = 1024.0;

/// The place of a distance from 0 up to three times 2^24, which is as far as a lattice reaches, and of greater ones a
/// place after those. It never falls as the distance grows.
#[inline(always)]
pub fn place(distance: f32) -> u16 {
    const GREATEST: f32 = 65_000.0 * PLACE_STEP;
    let distance = if distance > 0.0 { distance } else { 0.0 };
    let distance = if distance < GREATEST { distance } else { GREATEST };
    (distance + PLACE_ZERO).to_bits() as u16
}

/// For each lane the places that leave all others as they are, and take its own away.
static ONE_LANE: [[u16; 8]; 8] = {
    let mut table = [[0; 8]; 8];
    let mut lane = 0;
    while lane < 8 {
        table[lane][lane] = u16::MAX;
        lane += 1;
    }
    table
};

/// For every mask the lanes whose bits are set.
static SET_LANES: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut n) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][n] = lane as u8;
                n += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// Work that is compiled once for every kernel. Mark `run` `#[inline(always)]`.
pub trait Task {
    /// What the work gives.
    type Output;
    /// Does the work.
    fn run<K: Kernel>(self, kernel: K) -> Self::Output;
}

/// The best kernel of this processor: looked for once, then used for many tasks.
#[derive(Clone, Copy, Debug)]
pub enum Best {
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// Arrays.
    Portable(Portable),
}

impl Best {
    /// Looks what the processor has.
    #[inline]
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(kernel) = Avx2::detect() {
            return Self::Avx2(kernel);
        }
        Self::Portable(Portable)
    }

    /// Does `task` with this kernel.
    #[inline(always)]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernel) => kernel.enter(task),
            Self::Portable(kernel) => kernel.enter(task),
        }
    }
}

/// Does `task` with the best kernel that this processor has.
///
/// ```
/// use lazytess::math::simd::{Kernel, Task, run};
///
/// struct Sum([f32; 8]);
/// impl Task for Sum {
///     type Output = f32;
///     #[inline(always)]
///     fn run<K: Kernel>(self, k: K) -> f32 {
///         k.store(k.load(&self.0)).iter().sum()
///     }
/// }
/// assert_eq!(run(Sum([1.0; 8])), 8.0);
/// ```
#[inline]
pub fn run<T: Task>(task: T) -> T::Output {
    Best::detect().run(task)
}

/// x, y and z of four lanes twice, each in all lanes.
#[inline(always)]
pub fn spread<K: Kernel>(k: K, x: K::F) -> [K::F; 3] {
    [k.shuffle::<0b00_00_00_00>(x), k.shuffle::<0b01_01_01_01>(x), k.shuffle::<0b10_10_10_10>(x)]
}

#[cfg(test)]
mod tests;
