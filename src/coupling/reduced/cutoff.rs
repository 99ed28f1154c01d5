//! A pair's interaction, faded out smoothly between two distances.

/// Weight of a pair whose centres are a distance c apart: 1 up to `near`, 0 from `far` on, and between
/// them the polynomial of degree 7 whose first three derivatives vanish at both ends, so that state,
/// gradient and Hessian products don't jump when a pair comes or goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutoff {
    /// Distance up to which the pair is fully coupled, m.
    pub near: f64,
    /// Distance from which on it isn't coupled, m.
    pub far: f64,
}

impl Cutoff {
    /// Weight at centre distance `c`, with its first two derivatives.
    pub fn weight(&self, c: f64) -> [f64; 3] {
        let width = self.far - self.near;
        let t = (c - self.near) / width;
        if t <= 0.0 {
            return [1.0, 0.0, 0.0];
        }
        if t >= 1.0 {
            return [0.0; 3];
        }
        let s = 1.0 - t;
        // 1 − t⁴(35 − 84t + 70t² − 20t³)
        let value = 1.0 - t.powi(4) * (35.0 + t * (-84.0 + t * (70.0 - 20.0 * t)));
        let first = -140.0 * (t * s).powi(3);
        let second = -420.0 * (t * s).powi(2) * (1.0 - 2.0 * t);
        [value, first / width, second / (width * width)]
    }
}

#[cfg(test)]
mod tests {
    use super::Cutoff;

    #[test]
    fn fades_from_one_to_zero_with_its_own_derivatives() {
        let cutoff = Cutoff {
            near: 2.0,
            far: 3.5,
        };
        assert_eq!(cutoff.weight(1.0), [1.0, 0.0, 0.0]);
        assert_eq!(cutoff.weight(4.0), [0.0; 3]);
        let h = 1e-5;
        for i in 0..=30 {
            let c = 1.9 + 0.06 * f64::from(i);
            let [_, first, second] = cutoff.weight(c);
            let (up, down) = (cutoff.weight(c + h), cutoff.weight(c - h));
            assert!(((up[0] - down[0]) / (2.0 * h) - first).abs() < 1e-8);
            assert!(((up[1] - down[1]) / (2.0 * h) - second).abs() < 1e-7);
            assert!(up[0] <= down[0]);
        }
    }
}
