//! Pseudo-random numbers that are reproducible on every machine.

/// Small generator of uniform pseudo-random numbers (splitmix64, Steele, Lea and Flood 2014); one seed gives one sequence on every machine.
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform random integer from 0 to `n - 1`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    /// Approximately normal random number of mean 0 and variance 1, from the sum of twelve uniform numbers.
    pub fn normal(&mut self) -> f64 {
        const PARTS: usize = 1 << 20;
        (0..12).map(|_| self.below(PARTS) as f64 / PARTS as f64).sum::<f64>() - 6.0
    }
}
