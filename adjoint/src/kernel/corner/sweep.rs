//! The sums of the corners' derivatives over points.
//!
//! A task takes a few panels, whose sums are its own, over all points: results don't depend on the number of threads. Some vectors of
//! points are evaluated into a buffer on which all columns are spent.

use super::dual::dual;
use super::{CornerSums, Facet, Form, NUMBERS};
use crate::count::PAIRS;
use crate::kernel::lane::{Lanes, V3};
use crate::kernel::panel::Panel;
use crate::kernel::sum::{Aligned, by_column, dispatch, load, parts};
use crate::kernel::{Sources, Triangles};
use crate::lie::Vec3;
use pulp::{Simd, WithSimd};

/// Panels of one task.
const PANELS: usize = 16;
/// Vectors of points that are evaluated before the columns are spent on them.
const GROUP: usize = 4;

/// `out[i][k] += Σ_j a[j][k] numbers_i(s_j)`, or their tangents along `d`.
pub(super) fn sweep(
    targets: &Triangles,
    sources: &Sources,
    form: Form,
    d: Option<&[Vec3]>,
    a: &[f64],
    columns: usize,
    out: &mut [CornerSums],
) {
    assert_eq!(a.len(), sources.len() * columns, "a: [source][k]");
    assert_eq!(out.len(), targets.len() * columns, "out: [target][k]");
    if out.is_empty() || sources.is_empty() {
        return;
    }
    let d = d.map(|d| {
        assert_eq!(d.len(), sources.len(), "one displacement per source");
        Sources::new(d)
    });
    let a = by_column(a, columns, sources);
    let pairs = targets.len() * sources.len();
    PAIRS.add(pairs);
    parts(out, PANELS * columns, pairs, |part, out| {
        let given = Given {
            panels: &targets.panels[part * PANELS..],
            sources,
            d: d.as_ref(),
            a: &a,
            columns,
            out,
        };
        match (form, d.is_some()) {
            (Form::Closed, false) => dispatch(Sweep::<false, false>(given)),
            (Form::Closed, true) => dispatch(Sweep::<false, true>(given)),
            (Form::Blended, false) => dispatch(Sweep::<true, false>(given)),
            (Form::Blended, true) => dispatch(Sweep::<true, true>(given)),
        }
    });
}

struct Given<'a> {
    panels: &'a [Panel],
    sources: &'a Sources,
    d: Option<&'a Sources>,
    /// Columns apart, with zeros for the padding.
    a: &'a [f64],
    columns: usize,
    out: &'a mut [CornerSums],
}

struct Sweep<'a, const BLENDED: bool, const TANGENT: bool>(Given<'a>);

impl<const BLENDED: bool, const TANGENT: bool> WithSimd for Sweep<'_, BLENDED, TANGENT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let given = self.0;
        let k = given.columns;
        let zero = simd.splat_f64s(0.0);
        let vectors = given.sources.x.len() / S::F64_LANES;
        let a = S::as_simd_f64s(given.a).0;
        let mut sums = vec![[zero; NUMBERS]; k];
        let mut buffer = Aligned([[zero; GROUP]; NUMBERS]);
        for (panel, out) in given.panels.iter().zip(given.out.chunks_exact_mut(k)) {
            let facet = Facet::new(panel);
            sums.fill([zero; NUMBERS]);
            let mut first = 0;
            while first < vectors {
                let group = GROUP.min(vectors - first);
                for v in 0..group {
                    let s: V3<Lanes<S>> = load(simd, given.sources, first + v);
                    let values = match given.d {
                        Some(d) if TANGENT => {
                            let s = dual(s, load(simd, d, first + v));
                            let all = if BLENDED {
                                facet.blended(s)
                            } else {
                                facet.closed(s)
                            };
                            let mut out = [s[0].tangent; NUMBERS];
                            for (out, x) in out.iter_mut().zip(&all) {
                                *out = x.tangent;
                            }
                            out
                        }
                        _ if BLENDED => facet.blended(s),
                        _ => facet.closed(s),
                    };
                    for (row, value) in buffer.0.iter_mut().zip(&values) {
                        row[v] = value.v;
                    }
                }
                for (n, sums) in sums.iter_mut().enumerate() {
                    let a = &a[n * vectors + first..][..group];
                    // The full group unrolled; the rest one by one.
                    if let &[a0, a1, a2, a3] = a {
                        for (sum, row) in sums.iter_mut().zip(&buffer.0) {
                            let mut x = simd.mul_add_e_f64s(row[0], a0, *sum);
                            x = simd.mul_add_e_f64s(row[1], a1, x);
                            x = simd.mul_add_e_f64s(row[2], a2, x);
                            *sum = simd.mul_add_e_f64s(row[3], a3, x);
                        }
                    } else {
                        for (sum, row) in sums.iter_mut().zip(&buffer.0) {
                            for (x, a) in row.iter().zip(a) {
                                *sum = simd.mul_add_e_f64s(*x, *a, *sum);
                            }
                        }
                    }
                }
                first += group;
            }
            for (out, sums) in out.iter_mut().zip(&sums) {
                let mut total = [0.0; NUMBERS];
                for (total, sum) in total.iter_mut().zip(sums) {
                    *total = simd.reduce_sum_f64s(*sum);
                }
                out.add(&total);
            }
        }
    }
}
