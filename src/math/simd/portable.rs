//! The kernel of arrays: what every operation means, and what runs where there is no AVX2.

#![allow(unsafe_code)]

use super::{Kernel, ONE_LANE, SET_LANES, Task, place};
use std::array::from_fn;

/// Eight lanes as an array of floats.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

#[inline(always)]
fn zip(a: [f32; 8], b: [f32; 8], op: impl Fn(f32, f32) -> f32) -> [f32; 8] {
    from_fn(|k| op(a[k], b[k]))
}

#[inline(always)]
fn zip4(a: [f64; 4], b: [f64; 4], op: impl Fn(f64, f64) -> f64) -> [f64; 4] {
    [op(a[0], b[0]), op(a[1], b[1]), op(a[2], b[2]), op(a[3], b[3])]
}

#[inline(always)]
fn mask(a: [f32; 8], b: [f32; 8], holds: impl Fn(f32, f32) -> bool) -> u32 {
    (0..8).fold(0, |m, k| m | (u32::from(holds(a[k], b[k])) << k))
}

impl Kernel for Portable {
    type F = [f32; 8];
    type D = [f64; 4];
    type I = [i32; 8];
    type O = [u16; 8];

    #[inline(always)]
    fn splat(self, x: f32) -> [f32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> [f32; 8] {
        *x
    }
    #[inline(always)]
    fn store(self, x: [f32; 8]) -> [f32; 8] {
        x
    }
    #[inline(always)]
    fn widen(self, x: &[u8; 8]) -> [f32; 8] {
        x.map(f32::from)
    }
    #[inline(always)]
    fn widen_signed(self, x: &[i8; 8]) -> [f32; 8] {
        x.map(f32::from)
    }
    #[inline(always)]
    fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        self.add(self.mul(a, b), c)
    }
    #[inline(always)]
    fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a <= b)
    }
    #[inline(always)]
    fn eq(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a == b)
    }
    #[inline(always)]
    fn pick_0112(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        [a[0], a[1], b[1], b[2], a[4], a[5], b[5], b[6]]
    }
    #[inline(always)]
    fn pick_1201(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        [a[1], a[2], b[0], b[1], a[5], a[6], b[4], b[5]]
    }
    #[inline(always)]
    fn shuffle<const PICK: i32>(self, x: [f32; 8]) -> [f32; 8] {
        from_fn(|k| x[(k & 4) + (PICK >> (2 * (k & 3)) & 3) as usize])
    }
    #[inline(always)]
    fn abs(self, x: [f32; 8]) -> [f32; 8] {
        x.map(f32::abs)
    }
    #[inline(always)]
    fn with_sign(self, magnitude: [f32; 8], sign: [f32; 8]) -> [f32; 8] {
        zip(magnitude, sign, f32::copysign)
    }
    #[inline(always)]
    fn negative(self, x: [f32; 8]) -> u32 {
        mask(x, x, |x, _| x.is_sign_negative())
    }
    #[inline(always)]
    fn floats_twice(self, x: &[i32; 4]) -> [f32; 8] {
        from_fn(|k| x[k & 3] as f32)
    }
    #[inline(always)]
    fn scaled_twice(self, scale: [f32; 8], powers: i32) -> [f32; 8] {
        let power = |k: usize| f32::from_bits((127 + u32::from(powers.to_le_bytes()[k])) << 23);
        from_fn(|k| scale[k] * if k & 3 == 3 { 1.0 } else { power(k & 3) })
    }
    #[inline(always)]
    fn splat4(self, x: f64) -> [f64; 4] {
        [x; 4]
    }
    #[inline(always)]
    fn load4(self, x: &[f64; 4]) -> [f64; 4] {
        *x
    }
    #[inline(always)]
    fn store4(self, x: [f64; 4]) -> [f64; 4] {
        x
    }
    #[inline(always)]
    fn add4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn min4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max4(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip4(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs4(self, x: [f64; 4]) -> [f64; 4] {
        x.map(f64::abs)
    }
    #[inline(always)]
    fn greatest_of_three(self, x: [f64; 4]) -> f64 {
        let greater = |a: f64, b: f64| if a > b { a } else { b };
        greater(greater(x[0], x[2]), x[1])
    }
    #[inline(always)]
    fn floats_of(self, x: [f64; 4]) -> [f32; 8] {
        from_fn(|k| x[k & 3] as f32)
    }
    #[inline(always)]
    fn floor4(self, x: [f64; 4]) -> [f64; 4] {
        x.map(f64::floor)
    }
    #[inline(always)]
    fn round4(self, x: [f64; 4]) -> [f64; 4] {
        x.map(f64::round_ties_even)
    }
    #[inline(always)]
    fn lt4(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        (0..4).fold(0, |m, k| m | (u32::from(a[k] < b[k]) << k))
    }
    #[inline(always)]
    fn nearest4(self, x: [f64; 4]) -> [i32; 4] {
        x.map(|x| x.round_ties_even() as i32)
    }
    #[inline(always)]
    fn splat_i(self, x: i32) -> [i32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn load_i(self, x: &[i32; 8]) -> [i32; 8] {
        *x
    }
    #[inline(always)]
    fn min_i(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        from_fn(|k| a[k].min(b[k]))
    }
    #[inline(always)]
    fn max_i(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        from_fn(|k| a[k].max(b[k]))
    }
    #[inline(always)]
    fn sub_i(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        from_fn(|k| a[k].wrapping_sub(b[k]))
    }
    #[inline(always)]
    fn store_i(self, x: [i32; 8]) -> [i32; 8] {
        x
    }
    #[inline(always)]
    fn even_lanes(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        [a[0], a[2], a[4], a[6], b[0], b[2], b[4], b[6]]
    }
    #[inline(always)]
    fn lower_threes(self, x: [i32; 8]) -> [[u8; 16]; 2] {
        let byte = |lane: usize, i: usize| x[lane].to_le_bytes()[i];
        from_fn(|half| from_fn(|i| if i < 12 { byte(4 * half + i / 3, i % 3) } else { 0 }))
    }
    #[inline(always)]
    fn packed(self, x: &[u32; 8], mask: u8) -> [u32; 8] {
        SET_LANES[usize::from(mask)].map(|lane| x[usize::from(lane)])
    }
    #[inline(always)]
    fn lower_halves(self, x: [i32; 8]) -> [u16; 8] {
        x.map(|x| x as u16)
    }
    #[inline(always)]
    fn transpose4(self, x: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        from_fn(|i| from_fn(|k| x[k][i]))
    }
    #[inline(always)]
    fn in_order(self, enter: [f32; 8], leave: [f32; 8]) -> [u16; 8] {
        from_fn(|k| if enter[k] <= leave[k] { place(enter[k]) } else { Self::LAST })
    }
    #[inline(always)]
    fn first(self, order: [u16; 8]) -> (usize, u16) {
        let first = (1..8).fold(0, |first, k| if order[k] < order[first] { k } else { first });
        (first, order[first])
    }
    #[inline(always)]
    fn without(self, order: [u16; 8], lane: usize) -> [u16; 8] {
        from_fn(|k| order[k] | ONE_LANE[lane][k])
    }
    #[inline(always)]
    fn has_any(self, order: [u16; 8]) -> bool {
        order != [Self::LAST; 8]
    }
    #[inline(always)]
    fn load_order(self, x: &[u16; 8]) -> [u16; 8] {
        *x
    }
    #[inline(always)]
    fn store_order(self, x: [u16; 8]) -> [u16; 8] {
        x
    }
    // SAFETY: nothing here relies on the caller's promise: a place outside `bytes` panics. The trait says `unsafe` for
    // kernels that read without looking.
    #[inline(always)]
    unsafe fn integers<const BYTES: usize>(self, bytes: &[u8], at: [usize; 2], base: i32) -> [f32; 8] {
        from_fn(|k| {
            let at = at[k / 4] + BYTES * (k % 4);
            let mut word = [0; 4];
            word[..BYTES].copy_from_slice(&bytes[at..at + BYTES]);
            u32::from_le_bytes(word).wrapping_add_signed(base) as i32 as f32
        })
    }
    // Apart, so that who can do it with vector registers does not pay for its stack frame.
    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }
    #[inline(always)]
    fn prefetch<T>(self, _: *const T) {}
}
