//! Every operation of every kernel gives the bits of the portable one.
#![allow(unsafe_code)]

use super::*;

/// Numbers that are ordinary, tiny, huge, zero of both signs, infinite and not numbers.
fn awkward(seed: u32) -> [f32; 8] {
    let table = [0.0, -0.0, 1.0, -3.5, 1e-40, 1e30, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 16777216.0, 7.25e-9];
    std::array::from_fn(|k| table[(seed as usize * 7 + k * k + k * (seed as usize / 11)) % table.len()])
}

/// All results of one round of operations, as bits.
struct Round(u32);

impl Task for Round {
    type Output = Vec<u32>;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Vec<u32> {
        let (a, b) = (k.load(&awkward(self.0)), k.load(&awkward(self.0 / 3 + 5)));
        let bytes: [u8; 64] = std::array::from_fn(|i| (i as u32 * 37 + self.0 * 11) as u8);
        let eight = std::array::from_fn(|i| bytes[i]);
        // SAFETY: the last place is 48, and 16 bytes from there are inside `bytes`.
        let integers = unsafe {
            [
                k.integers::<2>(&bytes, [0, 48], -70000),
                k.integers::<3>(&bytes, [5, 48], -8_388_608),
                k.integers::<4>(&bytes, [16, 31], 12345),
            ]
        };
        let floats = [
            k.add(a, b),
            k.sub(a, b),
            k.mul(a, b),
            k.div(a, b),
            k.min(a, b),
            k.max(a, b),
            k.pick_0112(a, b),
            k.pick_1201(a, b),
            k.splat(self.0 as f32),
            k.widen(&eight),
            k.shuffle::<0b01_11_10_00>(a),
            k.shuffle::<0b10_10_01_01>(b),
            k.abs(a),
            k.with_sign(k.abs(a), b),
            k.floats_twice(&[self.0 as i32, -3, i32::MIN, i32::MAX - self.0 as i32]),
            k.shuffle::<0b00_10_01_00>(
                k.scaled_twice(k.splat(self.0 as f32 - 7.5), i32::from_le_bytes([bytes[0] / 4, 0, 17, 99])),
            ),
            k.floats_of(k.load4(&std::array::from_fn(|i| f64::from(awkward(self.0)[i]) * 1.1))),
        ];
        let canonical = |x: f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
        let lanes = floats.into_iter().chain(integers).flat_map(|f| k.store(f).map(canonical));
        lanes.chain([k.le(a, b), k.eq(a, b), k.negative(k.abs(a)), k.negative(b)]).collect()
    }
}

/// Orders of lanes that are met and lanes that are not, and what is left of them one by one.
struct RoundOfOrders(u32);

impl Task for RoundOfOrders {
    type Output = Vec<u16>;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Vec<u16> {
        let number = |i: u32| ((i + 1).wrapping_mul(self.0 + 3).wrapping_mul(0x9E37_79B9) >> 16) as f32 * 700.0;
        let enter: [f32; 8] = std::array::from_fn(|i| if i == 2 { 0.0 } else { number(i as u32) });
        let leave = std::array::from_fn(|i| if i % 3 == 0 { number(i as u32 + 40) } else { enter[i] });
        let mut order = k.in_order(k.load(&enter), k.load(&leave));
        let mut out = k.store_order(order).to_vec();
        for lane in 0..8 {
            assert!(if enter[lane] <= leave[lane] { out[lane] == place(enter[lane]) } else { out[lane] == K::LAST });
        }
        while k.has_any(order) {
            let (lane, place) = k.first(k.load_order(&k.store_order(order)));
            out.extend([lane as u16, place]);
            order = k.without(order, lane);
        }
        out
    }
}

#[test]
fn the_detected_kernel_orders_lanes_as_the_portable_one() {
    for seed in 0..2000 {
        assert_eq!(run(RoundOfOrders(seed)), RoundOfOrders(seed).run(Portable), "seed {seed}");
    }
}

#[test]
fn places_never_fall_and_leave_the_last_one_free() {
    let distances = (0..5000).map(|i| 16_384.7 * i as f32).chain([f32::MAX, f32::INFINITY]);
    let places: Vec<u16> = [f32::NEG_INFINITY, -1.0, 0.0].into_iter().chain(distances).map(place).collect();
    assert!(places.is_sorted() && *places.last().expect("some") < Portable::LAST);
    assert!(place(3.0 * 16_777_216.0) < place(f32::INFINITY), "what a lattice reaches has places of its own");
}

#[test]
fn the_detected_kernel_gives_the_bits_of_the_portable_one() {
    for seed in 0..2000 {
        assert_eq!(run(Round(seed)), Round(seed).run(Portable), "seed {seed}");
    }
}

/// As [`Round`], for doubles.
struct RoundOfDoubles(u32);

impl Task for RoundOfDoubles {
    type Output = Vec<u64>;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Vec<u64> {
        let awkward = |seed| -> [f64; 4] { std::array::from_fn(|i| f64::from(awkward(seed)[i]) * 1.1) };
        let (a, b) = (k.load4(&awkward(self.0)), k.load4(&awkward(self.0 / 3 + 5)));
        let doubles = [
            k.splat4(f64::from(self.0)),
            k.add4(a, b),
            k.sub4(a, b),
            k.mul4(a, b),
            k.div4(a, b),
            k.min4(a, b),
            k.max4(a, b),
            k.floor4(a),
            k.round4(a),
            k.abs4(a),
        ];
        let canonical = |x: f64| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
        let doubles = doubles.into_iter().chain(k.transpose4([a, b, k.floor4(a), k.splat4(7.0)]));
        let whole = k.floor4(k.splat4(f64::from(self.0) * 7.3 - 3e5));
        let integers = [k.nearest4(whole), k.nearest4(k.load4(&[0.5, 1.5, -2.5, 2.5 + f64::from(self.0)]))];
        let numbers = awkward(self.0).map(|x| if x.is_nan() { 2.0 } else { x });
        let greatest = k.greatest_of_three(k.load4(&numbers)).to_bits();
        let lanes = doubles.flat_map(|d| k.store4(d).map(canonical));
        lanes
            .chain(integers.into_iter().flatten().map(|i| i as u64))
            .chain([u64::from(k.lt4(a, b)), greatest])
            .collect()
    }
}

#[test]
fn the_detected_kernel_gives_the_bits_of_the_portable_one_for_doubles() {
    for seed in 0..2000 {
        assert_eq!(run(RoundOfDoubles(seed)), RoundOfDoubles(seed).run(Portable), "seed {seed}");
    }
}

/// As [`Round`], for integers.
struct RoundOfIntegers(u32);

impl Task for RoundOfIntegers {
    type Output = Vec<i32>;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Vec<i32> {
        let some = |seed: u32| -> [i32; 8] {
            std::array::from_fn(|i| ((i as u32 + 1) * seed).wrapping_mul(0x9E37_79B9) as i32)
        };
        let (a, b) = (k.load_i(&some(self.0)), k.load_i(&some(self.0 + 7)));
        let results = [k.min_i(a, b), k.max_i(a, b), k.sub_i(a, b), k.splat_i(self.0 as i32)];
        let mut out = Vec::new();
        for x in results {
            out.extend(k.store_i(k.even_lanes(x, a)));
            out.extend(k.lower_halves(x).map(i32::from));
            out.extend(k.lower_threes(x).into_iter().flatten().map(i32::from));
        }
        out.extend(k.packed(&some(self.0).map(|x| x as u32), self.0 as u8).map(|x| x as i32));
        out
    }
}

#[test]
fn the_detected_kernel_gives_the_bits_of_the_portable_one_for_integers() {
    for seed in 0..2000 {
        assert_eq!(run(RoundOfIntegers(seed)), RoundOfIntegers(seed).run(Portable), "seed {seed}");
    }
}
