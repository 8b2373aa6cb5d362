//! Numbers as people read them.

use std::fmt::{self, Display, Formatter};

/// A count with thousands apart: `1,234,567`.
pub(super) struct Count(pub u64);

impl Display for Count {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let digits = self.0.to_string();
        let first = (digits.len() - 1) % 3 + 1;
        f.write_str(&digits[..first])?;
        digits.as_bytes()[first..].chunks(3).try_for_each(|group| write!(f, ",{}", String::from_utf8_lossy(group)))
    }
}

/// A number of bytes in the binary units that sizes are typed in: `1.5 GiB`.
pub(super) struct Bytes(pub u64);

impl Display for Bytes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let units = [(1u64 << 40, "TiB"), (1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
        match units.into_iter().find(|&(size, _)| self.0 >= size) {
            Some((size, unit)) => write!(f, "{:.1} {unit}", self.0 as f64 / size as f64),
            None => write!(f, "{} bytes", self.0),
        }
    }
}

/// `1 sample`, `2 samples`.
pub(super) fn plural(n: u64, what: &str) -> String {
    format!("{} {what}{}", Count(n), if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_counts_are_read_easily() {
        let counts = [0, 999, 1000, 1_234_567].map(|n| Count(n).to_string());
        assert_eq!(counts, ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([1023, 1536, 3 << 29].map(|n| Bytes(n).to_string()), ["1023 bytes", "1.5 KiB", "1.5 GiB"]);
        assert_eq!([plural(1, "face"), plural(2000, "face")], ["1 face", "2,000 faces"]);
    }
}
