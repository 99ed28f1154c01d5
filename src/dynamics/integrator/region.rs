//! Where explicit steps are stable: of what dies away, and turns as it does.

use super::Integrator;
use nalgebra::Complex;

/// Products of rate and time step below which growth is the method's error, and no instability.
const SMALL: f64 = 1.0;
/// Steps in which the border is looked for, and halvings of the last.
const STRIDE: f64 = 0.0625;
const HALVINGS: usize = 30;

impl Integrator {
    /// What a step leaves of a motion that dies away at the rate λ, z = λΔt: 1 − z (velocity Euler), with ½z² (RK2), or the series to the fourth order (RK4); of integrators that solve
    /// for the velocity nothing that grows.
    fn left(self, z: Complex<f64>) -> f64 {
        let terms = match self {
            Integrator::VelocityEuler => 1,
            Integrator::Rk2 => 2,
            Integrator::Rk4 => 4,
            Integrator::MomentumEuler | Integrator::EnergyEuler | Integrator::Midpoint => {
                return 0.0;
            }
        };
        let (mut sum, mut term) = (Complex::from(1.0), Complex::from(1.0));
        for k in 1..=terms {
            term *= -z / f64::from(k);
            sum += term;
        }
        sum.norm()
    }

    /// The product of rate and time step of a motion that doesn't turn, and is as near to growing as one that dies away at the complex rate λ, z = λΔt: |z| times
    /// [`Integrator::damping_limit`], over the |z| at which one that turns so grows.
    pub(crate) fn straight(self, z: Complex<f64>) -> f64 {
        let (size, limit) = (z.norm(), self.damping_limit());
        let Some(limit) = limit.filter(|_| z.im != 0.0 && z.re > 0.0 && size > SMALL) else {
            return z.re;
        };
        let along = z / size;
        let grows = |r: f64| self.left(along * r) > 1.0;
        let mut to = SMALL;
        while !grows(to) {
            to += STRIDE;
        }
        let mut from = (to - STRIDE).max(SMALL);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (from + to);
            match grows(middle) {
                true => to = middle,
                false => from = middle,
            }
        }
        size * limit / to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_are_those_of_the_methods() {
        for integrator in [Integrator::VelocityEuler, Integrator::Rk2, Integrator::Rk4] {
            let limit = integrator.damping_limit().unwrap();
            let turned =
                |size: f64, angle: f64| integrator.straight(Complex::from_polar(size, angle));
            assert_eq!(turned(3.0, 0.0), 3.0);
            assert_eq!(integrator.straight(Complex::new(-5.0, 1.0)), -5.0);
            // Nearly straight as straight.
            assert!((turned(2.5, 1e-4) / 2.5 - 1.0).abs() < 2e-3);
            // Just within and just without by what a thousand steps leave.
            for angle in [0.3_f64, 0.8, 1.2, 1.5] {
                let border = limit * 2.0 / turned(2.0, angle);
                for (part, grows) in [(0.98, false), (1.02, true)] {
                    let z = Complex::from_polar(part * border, angle);
                    if z.norm() > SMALL {
                        assert_eq!(
                            integrator.left(z) > 1.0,
                            grows,
                            "{integrator:?} {angle} {part}"
                        );
                    }
                }
            }
        }
        // |1 − z|² = 1 at |z| = 2 cos.
        let z = Complex::from_polar(1.7, 0.4);
        let expected = 1.7 * 2.0 / (2.0 * 0.4_f64.cos());
        assert!((Integrator::VelocityEuler.straight(z) - expected).abs() < 1e-9);
        assert_eq!(Integrator::Midpoint.straight(Complex::new(9.0, 9.0)), 9.0);
    }
}
