//! The kernel of AVX2 registers.
#![allow(unsafe_code)]

use super::{Kernel, ONE_LANE, PLACE_ZERO, SET_LANES, Task};
use std::arch::x86_64::*;

/// Eight lanes in one register. A value of this type proves that the processor has AVX2 (and the small extensions that
/// came with it).
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// The kernel, if this processor can run it.
    #[inline]
    pub fn detect() -> Option<Self> {
        let here = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        here.then_some(Avx2(()))
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn enter<T: Task>(kernel: Avx2, task: T) -> T::Output {
    task.run(kernel)
}

/// One intrinsic that reads and writes no memory.
macro_rules! in_registers {
    ($intrinsic:expr) => {{
        // SAFETY: `self` exists, so the processor has AVX2 (invariant 2 of the module), and no memory is touched.
        unsafe { $intrinsic }
    }};
}

impl Kernel for Avx2 {
    type F = __m256;
    type D = __m256d;
    type I = __m256i;
    type O = __m128i;

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        in_registers!(_mm256_set1_ps(x))
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> __m256 {
        // SAFETY: `self` proves AVX2; `x` is 32 readable bytes and the load needs no alignment.
        unsafe { _mm256_loadu_ps(x.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, x: __m256) -> [f32; 8] {
        let mut out = [0.0; 8];
        // SAFETY: `self` proves AVX2; `out` is 32 writable bytes and the store needs no alignment.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), x) };
        out
    }
    #[inline(always)]
    fn widen(self, x: &[u8; 8]) -> __m256 {
        // SAFETY: `self` proves AVX2; `x` is the 8 readable bytes that are loaded.
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(x.as_ptr().cast()))) }
    }
    #[inline(always)]
    fn widen_signed(self, x: &[i8; 8]) -> __m256 {
        // SAFETY: `self` proves AVX2; `x` is the 8 readable bytes that are loaded.
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(x.as_ptr().cast()))) }
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_add_ps(a, b))
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_sub_ps(a, b))
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_mul_ps(a, b))
    }
    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_div_ps(a, b))
    }
    #[inline(always)]
    fn mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        in_registers!(_mm256_fmadd_ps(a, b, c))
    }
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_min_ps(a, b))
    }
    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_max_ps(a, b))
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        in_registers!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32)
    }
    #[inline(always)]
    fn eq(self, a: __m256, b: __m256) -> u32 {
        in_registers!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b)) as u32)
    }
    #[inline(always)]
    fn pick_0112(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_shuffle_ps::<0b10_01_01_00>(a, b))
    }
    #[inline(always)]
    fn pick_1201(self, a: __m256, b: __m256) -> __m256 {
        in_registers!(_mm256_shuffle_ps::<0b01_00_10_01>(a, b))
    }
    #[inline(always)]
    fn shuffle<const PICK: i32>(self, x: __m256) -> __m256 {
        in_registers!(_mm256_permute_ps::<PICK>(x))
    }
    #[inline(always)]
    fn abs(self, x: __m256) -> __m256 {
        in_registers!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), x))
    }
    #[inline(always)]
    fn with_sign(self, magnitude: __m256, sign: __m256) -> __m256 {
        in_registers!(_mm256_or_ps(magnitude, _mm256_and_ps(_mm256_set1_ps(-0.0), sign)))
    }
    #[inline(always)]
    fn negative(self, x: __m256) -> u32 {
        in_registers!(_mm256_movemask_ps(x) as u32)
    }
    #[inline(always)]
    fn floats_twice(self, x: &[i32; 4]) -> __m256 {
        // SAFETY: `self` proves AVX2; `x` is 16 readable bytes and the load needs no alignment.
        unsafe { _mm256_cvtepi32_ps(_mm256_broadcastsi128_si256(_mm_loadu_si128(x.as_ptr().cast()))) }
    }
    #[inline(always)]
    fn scaled_twice(self, scale: __m256, powers: i32) -> __m256 {
        in_registers!({
            // Byte k moved to where floats have their exponents, and added to that of lane k.
            let places = _mm256_setr_epi32(23, 15, 7, 0, 23, 15, 7, 0);
            let bytes = _mm256_sllv_epi32(_mm256_set1_epi32(powers), places);
            let exponents = _mm256_and_si256(bytes, _mm256_set1_epi32(0xff << 23));
            _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(scale), exponents))
        })
    }
    #[inline(always)]
    fn splat4(self, x: f64) -> __m256d {
        in_registers!(_mm256_set1_pd(x))
    }
    #[inline(always)]
    fn load4(self, x: &[f64; 4]) -> __m256d {
        // SAFETY: `self` proves AVX2; `x` is 32 readable bytes and the load needs no alignment.
        unsafe { _mm256_loadu_pd(x.as_ptr()) }
    }
    #[inline(always)]
    fn store4(self, x: __m256d) -> [f64; 4] {
        let mut out = [0.0; 4];
        // SAFETY: `self` proves AVX2; `out` is 32 writable bytes and the store needs no alignment.
        unsafe { _mm256_storeu_pd(out.as_mut_ptr(), x) };
        out
    }
    #[inline(always)]
    fn add4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_add_pd(a, b))
    }
    #[inline(always)]
    fn sub4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_sub_pd(a, b))
    }
    #[inline(always)]
    fn mul4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_mul_pd(a, b))
    }
    #[inline(always)]
    fn div4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_div_pd(a, b))
    }
    #[inline(always)]
    fn min4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_min_pd(a, b))
    }
    #[inline(always)]
    fn max4(self, a: __m256d, b: __m256d) -> __m256d {
        in_registers!(_mm256_max_pd(a, b))
    }
    #[inline(always)]
    fn abs4(self, x: __m256d) -> __m256d {
        in_registers!(_mm256_andnot_pd(_mm256_set1_pd(-0.0), x))
    }
    #[inline(always)]
    fn greatest_of_three(self, x: __m256d) -> f64 {
        in_registers!({
            let (xy, z) = (_mm256_castpd256_pd128(x), _mm256_extractf128_pd::<1>(x));
            _mm_cvtsd_f64(_mm_max_sd(_mm_max_sd(xy, z), _mm_unpackhi_pd(xy, xy)))
        })
    }
    #[inline(always)]
    fn floats_of(self, x: __m256d) -> __m256 {
        in_registers!({
            let four = _mm256_cvtpd_ps(x);
            _mm256_set_m128(four, four)
        })
    }
    #[inline(always)]
    fn floor4(self, x: __m256d) -> __m256d {
        in_registers!(_mm256_floor_pd(x))
    }
    #[inline(always)]
    fn round4(self, x: __m256d) -> __m256d {
        in_registers!(_mm256_round_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(x))
    }
    #[inline(always)]
    fn lt4(self, a: __m256d, b: __m256d) -> u32 {
        in_registers!(_mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u32)
    }
    #[inline(always)]
    fn nearest4(self, x: __m256d) -> [i32; 4] {
        let mut out = [0; 4];
        // SAFETY: `self` proves AVX2; `out` is 16 writable bytes and the store needs no alignment. Rounding is to
        // nearest, since nobody changes the processor's mode.
        unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), _mm256_cvtpd_epi32(x)) };
        out
    }
    #[inline(always)]
    fn splat_i(self, x: i32) -> __m256i {
        in_registers!(_mm256_set1_epi32(x))
    }
    #[inline(always)]
    fn load_i(self, x: &[i32; 8]) -> __m256i {
        // SAFETY: `self` proves AVX2; `x` is 32 readable bytes and the load needs no alignment.
        unsafe { _mm256_loadu_si256(x.as_ptr().cast()) }
    }
    #[inline(always)]
    fn min_i(self, a: __m256i, b: __m256i) -> __m256i {
        in_registers!(_mm256_min_epi32(a, b))
    }
    #[inline(always)]
    fn max_i(self, a: __m256i, b: __m256i) -> __m256i {
        in_registers!(_mm256_max_epi32(a, b))
    }
    #[inline(always)]
    fn sub_i(self, a: __m256i, b: __m256i) -> __m256i {
        in_registers!(_mm256_sub_epi32(a, b))
    }
    #[inline(always)]
    fn store_i(self, x: __m256i) -> [i32; 8] {
        let mut out = [0; 8];
        // SAFETY: `self` proves AVX2; `out` is 32 writable bytes and the store needs no alignment.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), x) };
        out
    }
    #[inline(always)]
    fn even_lanes(self, a: __m256i, b: __m256i) -> __m256i {
        in_registers!({
            let in_halves = _mm256_shuffle_ps::<0b10_00_10_00>(_mm256_castsi256_ps(a), _mm256_castsi256_ps(b));
            _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_castps_si256(in_halves))
        })
    }
    #[inline(always)]
    fn lower_threes(self, x: __m256i) -> [[u8; 16]; 2] {
        let mut out = [[0; 16]; 2];
        // SAFETY: `self` proves AVX2; each half of `out` is 16 writable bytes and the stores need no alignment.
        unsafe {
            let places = _mm_setr_epi8(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1);
            let packed = _mm256_shuffle_epi8(x, _mm256_broadcastsi128_si256(places));
            _mm_storeu_si128(out[0].as_mut_ptr().cast(), _mm256_castsi256_si128(packed));
            _mm_storeu_si128(out[1].as_mut_ptr().cast(), _mm256_extracti128_si256::<1>(packed));
        }
        out
    }
    #[inline(always)]
    fn packed(self, x: &[u32; 8], mask: u8) -> [u32; 8] {
        let mut out = [0; 8];
        // SAFETY: `self` proves AVX2; `x` is 32 readable bytes, the list of lanes 8, and `out` is 32 writable ones;
        // nothing needs alignment.
        unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_loadl_epi64(SET_LANES[usize::from(mask)].as_ptr().cast()));
            let packed = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(x.as_ptr().cast()), lanes);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), packed);
        }
        out
    }
    #[inline(always)]
    fn lower_halves(self, x: __m256i) -> [u16; 8] {
        let mut out = [0; 8];
        // SAFETY: `self` proves AVX2; `out` is 16 writable bytes and the store needs no alignment.
        unsafe {
            let lower = _mm256_and_si256(x, _mm256_set1_epi32(0xFFFF));
            let packed = _mm_packus_epi32(_mm256_castsi256_si128(lower), _mm256_extracti128_si256::<1>(lower));
            _mm_storeu_si128(out.as_mut_ptr().cast(), packed);
        }
        out
    }
    #[inline(always)]
    fn transpose4(self, x: [__m256d; 4]) -> [__m256d; 4] {
        in_registers!({
            let (ab, cd) = (_mm256_unpacklo_pd(x[0], x[1]), _mm256_unpacklo_pd(x[2], x[3]));
            let (ab_odd, cd_odd) = (_mm256_unpackhi_pd(x[0], x[1]), _mm256_unpackhi_pd(x[2], x[3]));
            [
                _mm256_permute2f128_pd::<0x20>(ab, cd),
                _mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd),
                _mm256_permute2f128_pd::<0x31>(ab, cd),
                _mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd),
            ]
        })
    }
    #[inline(always)]
    fn in_order(self, enter: __m256, leave: __m256) -> __m128i {
        in_registers!({
            let missed = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_NLE_UQ>(enter, leave));
            let places = _mm256_castps_si256(_mm256_add_ps(enter, _mm256_set1_ps(PLACE_ZERO)));
            let lower_halves =
                _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, -1, -1, -1, -1, -1, -1, -1, -1));
            let places = _mm256_shuffle_epi8(_mm256_or_si256(places, missed), lower_halves);
            _mm_unpacklo_epi64(_mm256_castsi256_si128(places), _mm256_extracti128_si256::<1>(places))
        })
    }
    #[inline(always)]
    fn first(self, order: __m128i) -> (usize, u16) {
        let found = in_registers!(_mm_cvtsi128_si32(_mm_minpos_epu16(order))) as u32;
        ((found >> 16) as usize, found as u16)
    }
    #[inline(always)]
    fn without(self, order: __m128i, lane: usize) -> __m128i {
        let lane = self.load_order(&ONE_LANE[lane % 8]);
        in_registers!(_mm_or_si128(order, lane))
    }
    #[inline(always)]
    fn has_any(self, order: __m128i) -> bool {
        in_registers!(_mm_test_all_ones(order) == 0)
    }
    #[inline(always)]
    fn load_order(self, x: &[u16; 8]) -> __m128i {
        // SAFETY: `self` proves AVX2; `x` is 16 readable bytes and the load needs no alignment.
        unsafe { _mm_loadu_si128(x.as_ptr().cast()) }
    }
    #[inline(always)]
    fn store_order(self, x: __m128i) -> [u16; 8] {
        let mut out = [0; 8];
        // SAFETY: `self` proves AVX2; `out` is 16 writable bytes and the store needs no alignment.
        unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), x) };
        out
    }
    #[inline(always)]
    unsafe fn integers<const BYTES: usize>(self, bytes: &[u8], at: [usize; 2], base: i32) -> __m256 {
        debug_assert!(at.iter().all(|at| at + if BYTES == 2 { 8 } else { 16 } <= bytes.len()));
        // SAFETY: `self` proves AVX2; the caller promises that the 8 (for BYTES = 2) or 16 bytes from both places are
        // inside `bytes`.
        unsafe {
            let low = bytes.as_ptr().add(at[0]).cast();
            let high = bytes.as_ptr().add(at[1]).cast();
            let integers = match BYTES {
                2 => _mm256_cvtepu16_epi32(_mm_unpacklo_epi64(_mm_loadl_epi64(low), _mm_loadl_epi64(high))),
                3 => _mm256_shuffle_epi8(_mm256_loadu2_m128i(high, low), three_byte_integers()),
                _ => _mm256_loadu2_m128i(high, low),
            };
            _mm256_cvtepi32_ps(_mm256_add_epi32(integers, _mm256_set1_epi32(base)))
        }
    }
    #[inline(always)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        // SAFETY: `self` exists, so `detect` found every feature that `enter` is compiled for.
        unsafe { enter(self, task) }
    }
    #[inline(always)]
    fn prefetch<T>(self, x: *const T) {
        // SAFETY: a prefetch is a hint that cannot fault, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(x.cast()) }
    }
}

/// The byte shuffle that spreads packed three-byte integers into lanes of four.
#[inline(always)]
unsafe fn three_byte_integers() -> __m256i {
    // SAFETY: the caller has AVX2; no memory is touched.
    unsafe { _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 2, -1, 3, 4, 5, -1, 6, 7, 8, -1, 9, 10, 11, -1)) }
}
