//! Differences that don't depend on units.

use nalgebra::{DMatrix, DVector};

use super::start::Path;
use crate::simulate::Simulator;

/// Diagonal entries of the water's mass matrix below this part of the whole are not the water's own
/// but the mesh's (a round body's spin).
const SIGNIFICANT: f64 = 1e-3;

/// Rows of the reference's M_f that mean something.
pub(super) fn significant(added_mass: &DMatrix<f64>, mass: &DMatrix<f64>) -> Vec<usize> {
    (0..added_mass.nrows())
        .filter(|i| added_mass[(*i, *i)] > SIGNIFICANT * mass[(*i, *i)])
        .collect()
}

/// max |ΔM_ij| / √(M_ii M_jj) over `rows` with the reference's diagonal.
pub(super) fn matrix_error(
    found: &DMatrix<f64>,
    reference: &DMatrix<f64>,
    rows: &[usize],
) -> Option<f64> {
    let mut worst = None;
    for &i in rows {
        for &j in rows {
            let scale = (reference[(i, i)] * reference[(j, j)]).sqrt();
            let error = (found[(i, j)] - reference[(i, j)]).abs() / scale;
            worst = Some(larger(worst.unwrap_or(0.0), error));
        }
    }
    worst.filter(|x| x.is_finite())
}

/// √(xᵀ M x).
pub(super) fn norm(x: &DVector<f64>, mass: &DMatrix<f64>) -> f64 {
    x.dot(&(mass * x)).max(0.0).sqrt()
}

/// ‖M^½ (a − b)‖ / ‖M^½ b‖.
pub(super) fn vector_error(a: &DVector<f64>, b: &DVector<f64>, mass: &DMatrix<f64>) -> Option<f64> {
    let size = norm(b, mass);
    (size > 0.0)
        .then(|| norm(&(a - b), mass) / size)
        .filter(|x| x.is_finite())
}

/// The larger of two, and what isn't a number before all else.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// What makes lengths of coordinates and velocities, angles times a length of the scene and none of what is
/// given; and how far a path goes by it.
#[derive(Clone, Debug)]
pub(super) struct Excursion {
    weights: [DVector<f64>; 2],
    /// Largest distances of coordinates and velocities from the start.
    farthest: [f64; 2],
}

/// Of the largest velocity: a smaller change of it counts as none, and errors are relative to the
/// velocity itself.
const STEADY: f64 = 1e-6;

fn distance(weights: &DVector<f64>, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    weights.component_mul(&(a - b)).norm()
}

impl Excursion {
    /// Of a path whose joints with `free` velocities count.
    pub fn new(simulator: &Simulator, free: &[usize], path: &Path) -> Self {
        let system = simulator.system();
        let volume = system.bodies.iter().map(|b| b.volume).fold(0.0, f64::max);
        let length = if volume > 0.0 { volume.cbrt() } else { 1.0 };
        let tree = &system.tree;
        let mut q = DVector::zeros(tree.coordinates());
        let mut v = DVector::zeros(tree.velocities());
        for link in tree.links() {
            if !link.v.clone().all(|i| free.contains(&i)) {
                continue;
            }
            for (i, axis) in link.v.clone().zip(link.joint.basis()) {
                let angular = axis.fixed_rows::<3>(3).norm() > 0.0;
                v[i] = if angular { length } else { 1.0 };
            }
            // Quaternions, which come last, change by half an angle.
            let quaternion = link.q.len() > link.v.len();
            let rotation = link.q.end - if quaternion { 4 } else { 0 };
            for (k, i) in link.q.clone().enumerate() {
                q[i] = match (quaternion, i >= rotation) {
                    (true, true) => 2.0 * length,
                    (true, false) => 1.0,
                    (false, _) => v[link.v.start + k],
                };
            }
        }
        Self::of(path, [q, v])
    }

    fn of(path: &Path, weights: [DVector<f64>; 2]) -> Self {
        let largest = |w: &DVector<f64>, x: &[DVector<f64>], from: &DVector<f64>| {
            let far = x.iter().map(|x| distance(w, x, from));
            far.fold(0.0, f64::max)
        };
        let [q, v] = &weights;
        let fastest = largest(v, &path.v, &(0.0 * &path.v[0]));
        let change = largest(v, &path.v, &path.v[0]);
        let steady = change <= STEADY * fastest;
        let farthest = [
            largest(q, &path.q, &path.q[0]),
            if steady { fastest } else { change },
        ];
        Self { weights, farthest }
    }

    /// Whether anything moves.
    pub fn any(&self) -> bool {
        self.farthest.iter().all(|x| *x > 0.0)
    }
}

/// Difference of two paths at the last time that both meet, no earlier than half of what `reference`
/// covers: the larger of that in q and that in v, each relative to the excursion.
pub(super) fn end_error(path: &Path, reference: &Path, excursion: &Excursion) -> Option<f64> {
    if !excursion.any() {
        return None;
    }
    let (i, j) = crossing(path, reference)?;
    let ([q, v], [far_q, far_v]) = (&excursion.weights, excursion.farthest);
    let q = distance(q, &path.q[i], &reference.q[j]) / far_q;
    let v = distance(v, &path.v[i], &reference.v[j]) / far_v;
    Some(larger(q, v)).filter(|x| x.is_finite())
}

/// Numbers of the last states at equal times.
fn crossing(path: &Path, reference: &Path) -> Option<(usize, usize)> {
    let last = reference.q.len() - 1;
    let from = path.q.len() / 2;
    (from..path.q.len()).rev().find_map(|i| {
        let at = i as f64 * path.time_step / reference.time_step;
        let j = at.round();
        let meets = (at - j).abs() < 1e-6 * at.max(1.0) && j as usize <= last;
        (meets && 2 * j as usize >= last).then_some((i, j as usize))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(time_step: f64, steps: usize) -> Path {
        let at = |i: usize| DVector::from_element(1, i as f64 * time_step);
        Path {
            time_step,
            q: (0..=steps).map(at).collect(),
            v: (0..=steps).map(at).collect(),
        }
    }

    #[test]
    fn paths_meet_at_the_last_common_time() {
        let reference = path(0.25, 48);
        assert_eq!(crossing(&path(1.0, 12), &reference), Some((12, 48)));
        assert_eq!(crossing(&path(5.0, 2), &reference), Some((2, 40)));
        assert_eq!(crossing(&path(0.125, 96), &reference), Some((96, 48)));
        assert_eq!(crossing(&path(0.3, 40), &reference), Some((40, 48)));
        assert_eq!(crossing(&path(0.7, 17), &reference), Some((15, 42)));
        assert_eq!(crossing(&path(0.251, 47), &reference), None);
        assert_eq!(crossing(&path(9.0, 1), &reference), Some((1, 36)));
    }

    #[test]
    fn end_errors_are_relative_to_the_way_gone() {
        let ones = || [(); 2].map(|()| DVector::from_element(1, 1.0));
        let reference = path(0.1, 20);
        let excursion = Excursion::of(&reference, ones());
        let mut near = path(0.2, 10);
        near.q[10][0] += 0.02;
        let error = end_error(&near, &reference, &excursion).unwrap();
        assert!((error - 0.01).abs() < 1e-12, "{error}");
        near.v[10][0] = f64::NAN;
        assert_eq!(end_error(&near, &reference, &excursion), None);
        let still = Path {
            q: vec![DVector::zeros(1); 21],
            v: vec![DVector::zeros(1); 21],
            ..reference
        };
        let excursion = Excursion::of(&still, ones());
        assert_eq!(end_error(&still, &still, &excursion), None);
    }

    #[test]
    fn matrices_are_compared_by_the_references_diagonal() {
        let reference =
            DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1e-9]);
        let mass = DMatrix::identity(3, 3);
        let rows = significant(&reference, &mass);
        assert_eq!(rows, [0, 1]);
        let mut found = reference.clone();
        found[(0, 1)] = 0.02;
        found[(2, 2)] = 1.0;
        let error = matrix_error(&found, &reference, &rows).unwrap();
        assert!((error - 0.01).abs() < 1e-12);
        found[(0, 0)] = f64::NAN;
        assert_eq!(matrix_error(&found, &reference, &rows), None);
        assert_eq!(matrix_error(&found, &reference, &[]), None);
    }
}
