//! Every derivative rung of this crate with its check.

mod contact;
mod solve;

use crate::check::{Outcome, Rung, dot, outcome};
use crate::drag::{Element, Part, Surface, quadratic_drag, quadratic_drag_jvp, quadratic_drag_vjp};
use crate::draw::numbers;
use crate::lie::{
    Mat6, Vec3, Vec6, exp_jacobian_inverse, exp_jacobian_inverse_jvp, exp_jacobian_inverse_vjp,
};
use crate::rigid::{spatial_inertia, spatial_inertia_vjp};
use crate::stream::{Stream, stream_wrench, stream_wrench_jvp, stream_wrench_vjp};
use crate::waterline::{Below, Hull};

/// Largest accepted relative error.
const TOLERANCE: f64 = 1e-6;
/// Rotation angles of the checks: zero, both sides of the switch to the series, and large.
const ANGLES: [f64; 5] = [0.0, 0.099, 0.101, 1.3, 2.9];
/// Parts of the drag.
const PARTS: [Part; 3] = [Part::Tangential, Part::Normal, Part::Total];

/// Every derivative rung of this crate, named by its path.
pub fn rungs() -> Vec<Rung> {
    let mut out = crate::kernel::rungs();
    out.extend([
        Rung {
            name: "lie::rotation::exp_jacobian_inverse_jvp",
            check: exp_jacobian_inverse_jvp_check,
        },
        Rung {
            name: "lie::rotation::exp_jacobian_inverse_vjp",
            check: exp_jacobian_inverse_check,
        },
        Rung {
            name: "rigid::spatial_inertia_vjp",
            check: spatial_inertia_check,
        },
        Rung {
            name: "drag::quadratic_drag_jvp",
            check: quadratic_drag_jvp_check,
        },
        Rung {
            name: "drag::quadratic_drag_vjp",
            check: quadratic_drag_vjp_check,
        },
        Rung {
            name: "stream::stream_wrench_jvp",
            check: stream_wrench_jvp_check,
        },
        Rung {
            name: "stream::stream_wrench_vjp",
            check: stream_wrench_vjp_check,
        },
        Rung {
            name: "waterline::Below::jvp",
            check: below_jvp_check,
        },
        Rung {
            name: "waterline::Below::vjp",
            check: below_vjp_check,
        },
        Rung {
            name: "contact::contact_force_jvp",
            check: contact::contact_force_jvp_check,
        },
        Rung {
            name: "contact::contact_force_vjp",
            check: contact::contact_force_vjp_check,
        },
        Rung {
            name: "solve::Definite::solve_vjp",
            check: solve::solve_vjp_check,
        },
        Rung {
            name: "solve::least_squares_jvp",
            check: solve::least_squares_jvp_check,
        },
    ]);
    out
}

fn array<const N: usize>(seed: u64, size: f64) -> [f64; N] {
    numbers(seed, N, size).try_into().expect("N numbers")
}

fn vector(seed: u64) -> Vec3 {
    Vec3::from(array(seed, 1.0))
}

/// The worst of several checks.
fn all(outcomes: impl IntoIterator<Item = Outcome>) -> Outcome {
    outcomes
        .into_iter()
        .reduce(Outcome::worst)
        .expect("at least one check")
}

/// `f` along as many directions as span its arguments and three more, each with a cotangent of its own, against `vjp`.
fn transposed<const N: usize>(
    f: impl Fn(&[f64]) -> Vec<f64>,
    x: &[f64; N],
    vjp: impl Fn(&[f64]) -> Vec<f64>,
    corruption: f64,
) -> Outcome {
    let size = f(x).len();
    all((0..N as u64 + 3).map(|k| {
        let (dx, bar) = (numbers(100 + k, N, 0.3), numbers(200 + k, size, 1.0));
        let slope = corruption * dot(&vjp(&bar), &dx);
        outcome(|x| vec![dot(&f(x), &bar)], x, &dx, &[slope], TOLERANCE)
    }))
}

/// Rotation vectors of all angles about several axes.
fn rotations() -> impl Iterator<Item = Vec3> {
    let axes = [10, 11, 12, 13].map(|seed| vector(seed).normalize());
    axes.into_iter()
        .flat_map(|axis| ANGLES.map(|angle| angle * axis))
}

fn exp_jacobian_inverse_jvp_check(corruption: f64) -> Outcome {
    all((20..).zip(rotations()).map(|(seed, theta)| {
        let (omega, along) = (vector(seed), 0.3 * vector(seed + 400));
        let value = |x: &[f64]| {
            let x = exp_jacobian_inverse(&Vec3::from_column_slice(x)) * omega;
            x.as_slice().to_vec()
        };
        let jvp = corruption * exp_jacobian_inverse_jvp(&theta, &omega, &along);
        let (start, along): ([f64; 3], [f64; 3]) = (theta.into(), along.into());
        outcome(value, &start, &along, jvp.as_slice(), TOLERANCE)
    }))
}

fn exp_jacobian_inverse_check(corruption: f64) -> Outcome {
    all((20..).zip(rotations()).map(|(seed, theta)| {
        let omega = vector(seed);
        transposed::<3>(
            |x| {
                let x = exp_jacobian_inverse(&Vec3::from_column_slice(x)) * omega;
                x.as_slice().to_vec()
            },
            &theta.into(),
            |bar| {
                exp_jacobian_inverse_vjp(&theta, &omega, &Vec3::from_column_slice(bar))
                    .as_slice()
                    .to_vec()
            },
            corruption,
        )
    }))
}

/// Mass and inertia, in which the value is linear, about several centres, and the centres.
fn spatial_inertia_check(corruption: f64) -> Outcome {
    let inertia = [0.7, 0.9, 1.1, 0.1, -0.05, 0.02];
    all([50, 51, 52].map(|seed| {
        let center = 0.4 * vector(seed);
        let of = |mass: f64, inertia: &[f64]| {
            spatial_inertia(mass, &center, &std::array::from_fn(|k| inertia[k]))
                .as_slice()
                .to_vec()
        };
        let bars = |bar: &[f64]| spatial_inertia_vjp(2.5, &center, &Mat6::from_column_slice(bar));
        let mass = transposed::<1>(
            |x| of(x[0], &inertia),
            &[2.5],
            |bar| vec![bars(bar).mass],
            corruption,
        );
        let rotational = transposed::<6>(
            |x| of(2.5, x),
            &inertia,
            |bar| bars(bar).inertia.to_vec(),
            corruption,
        );
        let about = transposed::<3>(
            |x| {
                spatial_inertia(2.5, &Vec3::from_column_slice(x), &inertia)
                    .as_slice()
                    .to_vec()
            },
            &center.into(),
            |bar| bars(bar).center.as_slice().to_vec(),
            corruption,
        );
        mass.worst(rotational).worst(about)
    }))
}

fn surface() -> Vec<Element> {
    (0..10)
        .map(|k| {
            let a = k as f64;
            let normal = Vec3::new(a.sin(), (1.3 * a).cos(), 0.4 - 0.1 * a).normalize();
            Element {
                center: normal * 0.7 + Vec3::new(0.1, -0.2, 0.05 * a),
                normal,
                area: 0.3 + 0.02 * a,
            }
        })
        .collect()
}

const NU: [f64; 6] = [0.9, -0.8, 0.5, 0.4, 0.3, -0.2];

fn quadratic_drag_jvp_check(corruption: f64) -> Outcome {
    all(PARTS.into_iter().flat_map(|part| {
        let surface = Surface::new(&surface(), part);
        let value = |x: &[f64]| {
            quadratic_drag(&surface, &Vec6::from_column_slice(x))
                .as_slice()
                .to_vec()
        };
        let along = |dnu: [f64; 6]| {
            let jvp = quadratic_drag_jvp(&surface, &Vec6::from(NU), &Vec6::from(dnu));
            outcome(value, &NU, &dnu, (corruption * jvp).as_slice(), TOLERANCE)
        };
        (60..68)
            .map(|seed| along(array(seed, 0.1)))
            .collect::<Vec<_>>()
    }))
}

fn quadratic_drag_vjp_check(corruption: f64) -> Outcome {
    all(PARTS.map(|part| {
        let surface = Surface::new(&surface(), part);
        transposed::<6>(
            |x| {
                quadratic_drag(&surface, &Vec6::from_column_slice(x))
                    .as_slice()
                    .to_vec()
            },
            &NU,
            |bar| {
                let bar = Vec6::from_column_slice(bar);
                quadratic_drag_vjp(&surface, &Vec6::from(NU), &bar)
                    .as_slice()
                    .to_vec()
            },
            corruption,
        )
    }))
}

/// A twist, a stream and its acceleration.
const STREAMED: [f64; 12] = [
    0.9, -0.8, 0.5, 0.4, 0.3, -0.2, 0.7, 0.2, -0.6, -0.3, 0.5, 0.1,
];

/// An added mass, as symmetric as they are.
fn added_mass() -> Mat6 {
    let half = Mat6::from_column_slice(&array::<36>(70, 1.0));
    half * half.transpose()
}

fn streamed(x: &[f64]) -> (Vec6, Stream) {
    let stream = Stream {
        velocity: Vec3::from_column_slice(&x[6..9]),
        acceleration: Vec3::from_column_slice(&x[9..12]),
    };
    (Vec6::from_column_slice(&x[..6]), stream)
}

fn stream_wrench_of(x: &[f64]) -> Vec<f64> {
    let (nu, stream) = streamed(x);
    stream_wrench(&added_mass(), &nu, &stream).as_slice().into()
}

fn stream_wrench_jvp_check(corruption: f64) -> Outcome {
    let (nu, stream) = streamed(&STREAMED);
    all((80..95).map(|seed| {
        let along: [f64; 12] = array(seed, 0.1);
        let (dnu, dstream) = streamed(&along);
        let jvp = corruption * stream_wrench_jvp(&added_mass(), &nu, &stream, &dnu, &dstream);
        outcome(
            stream_wrench_of,
            &STREAMED,
            &along,
            jvp.as_slice(),
            TOLERANCE,
        )
    }))
}

fn stream_wrench_vjp_check(corruption: f64) -> Outcome {
    let (nu, stream) = streamed(&STREAMED);
    transposed::<12>(
        stream_wrench_of,
        &STREAMED,
        |bar| {
            let bar = Vec6::from_column_slice(bar);
            let found = stream_wrench_vjp(&added_mass(), &nu, &stream, &bar);
            let parts = [found.stream.velocity, found.stream.acceleration];
            let parts = parts.iter().flat_map(|x| x.iter().copied());
            found.nu.iter().copied().chain(parts).collect()
        },
        corruption,
    )
}

/// Normal and height of a plane through the tetrahedron of [`below`].
const PLANE: [f64; 4] = [0.48, -0.64, 0.6, 0.05];

/// Of a tetrahedron below a plane, whose normal need not be a unit vector.
fn below(plane: &[f64]) -> Below {
    let vertices = vec![
        Vec3::new(0.3, -0.2, -0.4),
        Vec3::new(-0.5, 0.1, 0.2),
        Vec3::new(0.2, 0.6, 0.1),
        Vec3::new(0.1, -0.3, 0.7),
    ];
    let faces = vec![[0, 2, 3], [1, 3, 2], [0, 3, 1], [0, 1, 2]];
    let normal = Vec3::from_column_slice(&plane[..3]);
    let size = normal.norm();
    Below::new(&Hull { vertices, faces }, &(normal / size), plane[3] / size)
}

fn volume_and_moment(plane: &[f64]) -> Vec<f64> {
    let found = below(plane);
    let moment = found.moment;
    vec![found.volume, moment.x, moment.y, moment.z]
}

fn below_jvp_check(corruption: f64) -> Outcome {
    all((60..68).map(|seed| {
        let along: [f64; 4] = array(seed, 0.1);
        let tilt = Vec3::from_column_slice(&along[..3]);
        let (volume, moment) = below(&PLANE).jvp(along[3], &tilt);
        let jvp = [volume, moment.x, moment.y, moment.z].map(|x| corruption * x);
        outcome(volume_and_moment, &PLANE, &along, &jvp, TOLERANCE)
    }))
}

fn below_vjp_check(corruption: f64) -> Outcome {
    transposed::<4>(
        volume_and_moment,
        &PLANE,
        |bar| {
            let (rate, tilt) = below(&PLANE).vjp(bar[0], &Vec3::from_column_slice(&bar[1..]));
            vec![tilt.x, tilt.y, tilt.z, rate]
        },
        corruption,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::DRAWN;
    use crate::sample::span;

    #[test]
    fn every_rung_passes_and_fails_when_corrupted() {
        for rung in rungs() {
            let right = (rung.check)(1.0);
            println!("{} {right:?}", rung.name);
            assert!(right.passes(), "{} {right:?}", rung.name);
            let wrong = (rung.check)(1.01);
            assert!(!wrong.passes(), "{} {wrong:?}", rung.name);
        }
    }

    fn triples(x: &[f64]) -> impl Iterator<Item = [f64; 3]> + '_ {
        x.chunks_exact(3).map(|c| [c[0], c[1], c[2]])
    }

    /// Least part of the largest singular value that the smallest must be: of the vectors of an array of at least
    /// nine, and of all vectors of a length that a check draws.
    const SPANNED: f64 = 0.3;

    /// A check along vectors in one plane doesn't see the component of a derivative across it.
    #[test]
    fn vectors_of_every_check_span_space() {
        for rung in rungs() {
            DRAWN.take();
            (rung.check)(1.0);
            let drawn = DRAWN.take();
            assert!(!drawn.is_empty(), "{} draws nothing", rung.name);
            let mut lengths: Vec<usize> = drawn.iter().map(Vec::len).collect();
            lengths.sort_unstable();
            lengths.dedup();
            let mut least = f64::INFINITY;
            for length in lengths.into_iter().filter(|l| l % 3 == 0) {
                let of = || drawn.iter().filter(|d| d.len() == length);
                least = least.min(span(of().flat_map(|d| triples(d))));
                if length >= 27 {
                    least = of().map(|d| span(triples(d))).fold(least, f64::min);
                }
            }
            println!("{} {least:.2}", rung.name);
            assert!(least > SPANNED, "{}: {least}", rung.name);
        }
    }
}
