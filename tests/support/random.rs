//! Random numbers, the same on every machine.

/// A linear congruential generator, its upper 53 bits.
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        self.0 >> 11
    }

    /// Between −1 and 1.
    pub fn number(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.bits() as f64 / (1_u64 << 53) as f64
    }

    /// One of 0, …, count − 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() >> 22) as usize % count
    }

    /// Components between −size and size.
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(-size, size))
    }

    pub fn direction(&mut self) -> [f64; 3] {
        let v = self.vector(1.0);
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| x / norm)
    }
}
