//! What mirrors show of bodies: half the charges on every image, and back from images what they see, so that body and image see each other once in all.

use super::Scattering;
use crate::adjoint::lie::Vec6;
use crate::adjoint::multipole::Number;
use std::borrow::Cow;

impl Scattering {
    /// c = [α, ½ σ α].
    pub(super) fn spread<'c, T: Number>(&self, charges: &'c [T]) -> Cow<'c, [T]> {
        if self.images.len() == 1 {
            return Cow::Borrowed(charges);
        }
        let mut out = charges.to_vec();
        for image in &self.images[1..] {
            let part = T::constant(0.5 * image.sign);
            out.extend(charges.iter().map(|c| *c * part));
        }
        Cow::Owned(out)
    }

    /// Its transpose: of what charges see.
    pub(super) fn gathered<T: Number>(&self, mut seen: Vec<T>) -> Vec<T> {
        let own = self.point_count();
        let (bodies, shown) = seen.split_at_mut(own);
        for (k, image) in self.images.iter().enumerate().skip(1) {
            let part = T::constant(0.5 * image.sign);
            let shown = &shown[own * (k - 1)..][..own];
            for (out, seen) in bodies.iter_mut().zip(shown) {
                *out += *seen * part;
            }
        }
        seen.truncate(own);
        seen
    }

    /// Spatial wrenches on the bodies from those on all that is seen.
    pub(super) fn gathered_wrenches(&self, mut all: Vec<Vec6>) -> Vec<Vec6> {
        let own = self.bodies.len();
        let (bodies, shown) = all.split_at_mut(own);
        for (k, image) in self.images.iter().enumerate().skip(1) {
            let shown = &shown[own * (k - 1)..][..own];
            for (out, wrench) in bodies.iter_mut().zip(shown) {
                *out += image.twist_vjp(wrench);
            }
        }
        all.truncate(own);
        all
    }
}
