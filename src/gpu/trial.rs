//! Opening a device, and whether its compiler keeps the order of sums that two-float arithmetic stands on.

use super::columns::products;
use super::context::{Context, Options};
use super::source::Arithmetic;
use crate::Result;
use std::sync::Arc;

/// Digits that must be there.
const ACCURACY: f64 = 1e-12;

impl Context {
    /// Opens an adapter.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if there is none, none of that name, its limits are too small, or its compiler spoils the
    /// arithmetic that it is to use.
    pub fn new(options: &Options) -> Result<Arc<Self>> {
        let context = Self::open(options)?;
        if context.fine() == Arithmetic::TwoFloat {
            two_float(&context)?;
        }
        Ok(context)
    }
}

/// Tries two-float numbers on a sum whose digits single precision loses.
///
/// # Errors
/// An adapter that reorders.
fn two_float(context: &Context) -> Result<()> {
    let arithmetic = Arithmetic::TwoFloat;
    let x: Vec<f64> = (0..64)
        .map(|i| 1.0 + f64::from(i) * 1.23456789e-9)
        .collect();
    let y: Vec<f64> = (0..64).map(|i| 1.0 / (3.0 + f64::from(i))).collect();
    let exact: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
    let g = context.upload("trial", arithmetic, &x)?;
    let a = context.upload("trial", arithmetic, &y)?;
    let out = context.reals("trial", arithmetic, 1)?;
    let call = products(context, 64, ((&g, 1, 0), (&a, 1, 0)), (&out, 1))?;
    context.submit([&call])?;
    let got = context.read(arithmetic, &[(&out, 1)])?[0][0];
    let error = (got - exact).abs() / exact;
    if error <= ACCURACY {
        return Ok(());
    }
    Err(context.failure(format!(
        "it has no double precision, and its compiler spoils two-float arithmetic (error {error:.1e}, must be below {ACCURACY:.0e})"
    )))
}
