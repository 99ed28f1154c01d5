//! Products of dense matrices on the calling thread.

use faer::linalg::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// `out = scale · left right`, or the same added to `out`.
///
/// The kernels of faer's products leave the upper halves of vector registers in use. Until a function that
/// uses vectors ends, each call of `exp` and its like then takes about thirty times as long on processors
/// with AVX-512, as these mix encodings with the code that calls them: they are given back here.
pub(crate) fn matmul(
    out: MatMut<f64>,
    add: Accum,
    left: MatRef<f64>,
    right: MatRef<f64>,
    scale: f64,
) {
    matmul::matmul(out, add, left, right, scale, Par::Seq);
    #[cfg(target_arch = "x86_64")]
    if let Some(avx) = pulp::core_arch::x86::Avx::try_new() {
        avx._mm256_zeroupper();
    }
}
