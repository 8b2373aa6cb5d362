//! Values as they are typed: sizes, vectors, windows. Each parser's message says what to write.

use crate::cache::{CacheConfig, Capacity};
use crate::scene::description::{MOST_DEPTH, MOST_SAMPLES};
use crate::subdiv::MAX_RATE;
use glam::DVec3;
use std::str::FromStr;

/// A number of bytes, typed like `64M`, `1.5G`, `200000`. Units are binary: K is 1024.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ByteSize(pub u64);

impl FromStr for ByteSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is no size: write bytes, or a number with K, M, G or T such as 64M");
        let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(split);
        let shift = match unit.to_ascii_uppercase().as_str() {
            "" | "B" => 0,
            "K" | "KB" | "KIB" => 10,
            "M" | "MB" | "MIB" => 20,
            "G" | "GB" | "GIB" => 30,
            "T" | "TB" | "TIB" => 40,
            _ => return Err(wrong()),
        };
        let bytes = number.parse::<f64>().map_err(|_| wrong())? * (1u64 << shift) as f64;
        // Beyond 2^53 a size typed in decimals has no exact number of bytes, and no machine has them.
        if bytes <= (1u64 << 53) as f64 { Ok(Self(bytes as u64)) } else { Err(wrong()) }
    }
}

/// The size of a cache: a [`ByteSize`] or `unbounded`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CacheSize {
    /// At most so many bytes of grids; 0 keeps none.
    Bytes(u64),
    /// Room for all that could be built; blocks are evicted only where the system does not lend that much.
    Unbounded,
}

impl CacheSize {
    /// What the cache is made of, when all blocks that could be built take at most `all_blocks` bytes and so many
    /// threads work, each with a pin or two.
    pub fn config(self, all_blocks: usize, threads: usize) -> CacheConfig {
        let capacity = match self {
            Self::Bytes(bytes) => Capacity::Bytes(usize::try_from(bytes).unwrap_or(usize::MAX)),
            Self::Unbounded => Capacity::Unbounded { at_most: all_blocks },
        };
        CacheConfig { capacity, max_threads: 2 * threads + 8, ..CacheConfig::with_bytes(0) }
    }
}

impl FromStr for CacheSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "unbounded" => Ok(Self::Unbounded),
            size => size.parse().map(|ByteSize(bytes)| Self::Bytes(bytes)).map_err(|e| e + ", or unbounded"),
        }
    }
}

/// `WxH` in pixels.
pub fn picture_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("'{text}' is no picture size: write WIDTHxHEIGHT, each in 1..65536, such as 800x600");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |text: &str| text.parse().ok().filter(|n| (1..=65536).contains(n)).ok_or_else(wrong);
    Ok([side(width)?, side(height)?])
}

/// `x,y,z`.
pub fn vector(text: &str) -> Result<DVec3, String> {
    let wrong = || format!("'{text}' is no point: write three finite numbers, such as 1,2.5,-3");
    numbers::<f64, 3>(text).map(DVec3::from_array).filter(|v| v.is_finite()).ok_or_else(wrong)
}

/// `x0,x1,y0,y1`: columns x0 to x1 - 1, rows y0 to y1 - 1, row 0 at the top.
pub fn crop(text: &str) -> Result<[u32; 4], String> {
    let wrong = || format!("'{text}' is no window: write x0,x1,y0,y1 with x0 < x1 and y0 < y1, such as 0,100,50,80");
    numbers::<u32, 4>(text).filter(|[x0, x1, y0, y1]| x0 < x1 && y0 < y1).ok_or_else(wrong)
}

/// A finite number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| format!("'{text}' is no number above 0"))
}

/// A finite number, 0 or more.
pub fn not_negative(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    value.ok_or_else(|| format!("'{text}' is no number from 0 up"))
}

/// A number of threads.
pub fn threads(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (1..=1024).contains(n));
    number.ok_or_else(|| format!("'{text}' is no number of threads: write a whole number from 1 to 1024"))
}

/// A count, 1 or more.
pub fn count(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|&n| n > 0);
    number.ok_or_else(|| format!("'{text}' is no count: write a whole number from 1 to {}", u32::MAX))
}

/// A number of samples.
pub fn samples(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (1..=MOST_SAMPLES).contains(n));
    number.ok_or_else(|| format!("'{text}' is no number of samples: write a whole number from 1 to {MOST_SAMPLES}"))
}

/// The longest chain of reflections.
pub fn depth(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (0..=MOST_DEPTH).contains(n));
    number.ok_or_else(|| format!("'{text}' is no depth: write a whole number from 0 to {MOST_DEPTH}"))
}

/// A field of view in degrees.
pub fn field_of_view(text: &str) -> Result<f64, String> {
    let degrees = text.parse::<f64>().ok().filter(|degrees| *degrees > 0.0 && *degrees < 180.0);
    degrees.ok_or_else(|| format!("'{text}' is no field of view: write degrees between 0 and 180"))
}

/// Segments of an edge.
pub fn fixed_rate(text: &str) -> Result<u32, String> {
    let number = text.strip_prefix("fixed:").unwrap_or(text).parse().ok().filter(|n| (1..=MAX_RATE).contains(n));
    number.ok_or_else(|| format!("'{text}' is no rate: write a whole number of segments from 1 to {MAX_RATE}"))
}

/// How many of something there may be very many of, typed like `100000`, `20k`, `10M`; K is 1000 here.
pub fn decimal_count(text: &str) -> Result<u64, String> {
    let wrong = || format!("'{text}' is no count: write a whole number from 1 up, or one with k, M or G such as 20k");
    let number = text.trim_end_matches(|unit: char| unit.is_ascii_alphabetic());
    let unit = match &text[number.len()..] {
        "" => 1,
        "k" | "K" => 1000,
        "M" => 1_000_000,
        "G" => 1_000_000_000,
        _ => return Err(wrong()),
    };
    let count = number.parse::<u64>().ok().and_then(|n| n.checked_mul(unit));
    count.filter(|&n| n > 0).ok_or_else(wrong)
}

/// A number from 0 up, or a fraction of two.
pub fn display_units(text: &str) -> Result<f32, String> {
    let (above, below) = text.split_once('/').unwrap_or((text, "1"));
    let number = |text: &str| text.trim().parse::<f32>().ok();
    let value = number(above).zip(number(below)).map(|(above, below)| above / below);
    value
        .filter(|v| v.is_finite() && *v >= 0.0)
        .ok_or_else(|| format!("'{text}' is no difference: write a number from 0 up, such as 0.02 or 5/255"))
}

/// Exactly `N` values between commas.
fn numbers<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let values: Option<Vec<T>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_decimal() {
        assert_eq!([decimal_count("7"), decimal_count("20k"), decimal_count("3M")], [Ok(7), Ok(20_000), Ok(3_000_000)]);
        for bad in ["", "0", "k", "-1", "1.5M", "1e6", "99999999999G", "7MB"] {
            assert!(decimal_count(bad).unwrap_err().contains("is no count"), "{bad}");
        }
    }

    #[test]
    fn sizes_are_binary() {
        let bytes = |text: &str| text.parse::<ByteSize>().map(|size| size.0);
        assert_eq!(bytes("0"), Ok(0));
        assert_eq!(bytes("1000"), Ok(1000));
        assert_eq!(bytes("64M"), Ok(64 << 20));
        assert_eq!(bytes("1.5g"), Ok(3 << 29));
        assert_eq!(bytes("2GiB"), Ok(2 << 30));
        assert_eq!(bytes("7kb"), Ok(7 << 10));
        assert_eq!(bytes("12B"), Ok(12));
        for bad in ["", "M", "-1", "1X", "1.2.3M", "1e6", "64 M", "nan", "9999999T", "iB", "1i", "7KI", "7kIIB", "7kbb"]
        {
            assert!(bytes(bad).unwrap_err().contains("is no size"), "{bad}");
        }
        assert_eq!("unbounded".parse(), Ok(CacheSize::Unbounded));
        assert_eq!("16M".parse(), Ok(CacheSize::Bytes(16 << 20)));
        assert!("all".parse::<CacheSize>().unwrap_err().ends_with(", or unbounded"));
    }

    #[test]
    fn pictures_points_and_windows_are_read() {
        assert_eq!(picture_size("800x600"), Ok([800, 600]));
        assert_eq!(vector("1,-2.5, 1e3"), Ok(DVec3::new(1.0, -2.5, 1000.0)));
        assert_eq!(crop("0,10,5,6"), Ok([0, 10, 5, 6]));
        for bad in ["800", "0x5", "800x", "x", "-1x2", "65537x1", "8x8x8"] {
            assert!(picture_size(bad).is_err(), "{bad}");
        }
        for bad in ["1,2", "1,2,3,4", "1,2,inf", "a,b,c", ""] {
            assert!(vector(bad).is_err(), "{bad}");
        }
        for bad in ["0,0,0,1", "1,0,0,1", "0,1,1,1", "0,1,2", "-1,1,0,1"] {
            assert!(crop(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers_keep_their_bounds() {
        assert_eq!((positive("0.5"), not_negative("0"), count("3")), (Ok(0.5), Ok(0.0), Ok(3)));
        assert!(positive("0").is_err() && positive("inf").is_err() && positive("nan").is_err());
        assert!(not_negative("-0.1").is_err() && not_negative("nan").is_err());
        assert!(count("0").is_err() && count("1.5").is_err());
    }
}
