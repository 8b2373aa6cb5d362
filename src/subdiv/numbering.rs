//! Numbers for the vertices and faces of one ring after the other.

/// Numbers for values, in the order in which they come first. It is cleared and filled again and again, so entries of
/// its table count only with the stamp of the present filling.
#[derive(Debug, Default)]
pub(super) struct Numbering {
    pub values: Vec<u32>,
    /// Stamps and numbers, at the hash of the value or in the next free place; twice as many as there are values, or
    /// more.
    table: Vec<[u32; 2]>,
    /// What is left of the 32 bits of a product is a place in the table.
    shift: u32,
    stamp: u32,
}

/// Room for the vertices of an ordinary ring.
const LEAST_TABLE: usize = 64;

impl Numbering {
    pub fn clear(&mut self) {
        self.values.clear();
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 || self.table.is_empty() {
            self.make_table(LEAST_TABLE);
        }
    }

    fn make_table(&mut self, len: usize) {
        self.table.clear();
        self.table.resize(len, [0; 2]);
        self.shift = u32::BITS - len.ilog2();
        self.stamp = 1;
        for number in 0..self.values.len() {
            let place = self.place(self.values[number]);
            self.table[place] = [self.stamp, number as u32];
        }
    }

    /// Where a value is, or would be.
    #[inline(always)]
    fn place(&self, value: u32) -> usize {
        let mask = self.table.len() - 1;
        // The upper bits of the product depend on all of the value (Knuth 1998, 6.4): as many as the table has places.
        let mut place = (value.wrapping_mul(0x9e37_79b9) >> self.shift) as usize;
        loop {
            let [stamp, number] = self.table[place];
            if stamp != self.stamp || self.values[number as usize] == value {
                return place;
            }
            place = (place + 1) & mask;
        }
    }

    #[inline(always)]
    pub fn find(&self, value: u32) -> Option<u32> {
        let [stamp, number] = self.table[self.place(value)];
        (stamp == self.stamp).then_some(number)
    }

    /// The value's number, and whether it is new.
    #[inline(always)]
    pub fn number(&mut self, value: u32) -> (u32, bool) {
        let place = self.place(value);
        let [stamp, number] = self.table[place];
        if stamp == self.stamp {
            return (number, false);
        }
        let number = self.values.len() as u32;
        self.values.push(value);
        self.table[place] = [self.stamp, number];
        if 2 * self.values.len() > self.table.len() {
            self.make_table(2 * self.table.len());
        }
        (number, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_numbered_as_they_come_and_found_at_once() {
        let mut numbering = Numbering::default();
        for (n, step) in [(10, 1), (100_000, 1), (100_000, 4096), (10, 7)] {
            numbering.clear();
            for i in 0..n {
                assert_eq!(numbering.number(i * step), (i, true));
            }
            assert!((0..n).all(|i| numbering.find(i * step) == Some(i)) && numbering.find(u32::MAX).is_none());
            let home = |value: u32| (value.wrapping_mul(0x9e37_79b9) >> numbering.shift) as usize;
            let way = |value: u32| numbering.place(value).wrapping_sub(home(value)) & (numbering.table.len() - 1);
            let mean = (0..n).map(|i| way(i * step) as f64).sum::<f64>() / f64::from(n);
            assert!(mean < 3.0, "{n} values, {step} apart: {mean} places are passed on the way to one");
        }
    }
}
