//! How much was solved.

use crate::adjoint::count::Counter;

/// Calls of this module's solvers and products ([`cgls`](super::cgls), [`gmres`](super::gmres()),
/// [`product`](super::product()) and its kin, [`Lu`](super::Lu)) in this process.
pub static CALLS: Counter = Counter::new();

/// Counts one call.
pub(super) fn call() {
    CALLS.add(1);
}
