//! The derivatives of one panel's layers with respect to its corners.

use super::NUMBERS;
use crate::kernel::double::Double;
use crate::kernel::lane::{Lane, V3, cross, dot, scale, scale_add, sub};
use crate::kernel::panel::{Layer, Multipoles, Panel, Weight, constant, radius_slopes};
use crate::lie::Vec3;

/// A panel with what these derivatives need of it beside.
pub(super) struct Facet<'a> {
    panel: &'a Panel,
    /// Unit normal.
    normal: Vec3,
    /// Unit vectors along the edges 01, 12, 20.
    along: [Vec3; 3],
    /// ∇λ_k of the shares of the corners, 1/m.
    shares: [Vec3; 3],
    /// ∇λ_k·m_e, `[k][e]`, 1/m.
    tilts: [Vec3; 3],
    /// ∂A/∂v_k of the area, m.
    areas: [Vec3; 3],
    /// v_k − g, m.
    arms: [Vec3; 3],
    /// ∂ρ²/∂v_k of the square of the radius that the reach is told in, per ρ², 1/m.
    radii: [Vec3; 3],
}

/// One layer's value and derivatives with respect to the corners.
#[derive(Clone, Copy)]
struct Moved<T> {
    value: T,
    corners: [V3<T>; 3],
}

/// The corner after k in turn, and the edge opposite of it.
const NEXT: [usize; 3] = [1, 2, 0];
/// The edge that ends at corner k.
const BEFORE: [usize; 3] = [2, 0, 1];

impl<'a> Facet<'a> {
    pub fn new(panel: &'a Panel) -> Self {
        let normal = panel.double_area.normalize();
        let along = [0, 1, 2].map(|e| panel.along[e] / panel.lengths[e]);
        let outward = along.map(|e| e.cross(&normal));
        let areas = [0, 1, 2].map(|k| -0.5 * panel.lengths[NEXT[k]] * outward[NEXT[k]]);
        let shares = areas.map(|a| a / panel.area);
        let arms = panel.corners.map(|v| v - panel.centre);
        Self {
            panel,
            normal,
            along,
            tilts: shares.map(|s| Vec3::from(outward.map(|m| s.dot(&m)))),
            shares,
            areas,
            radii: radius_slopes(&arms),
            arms,
        }
    }

    /// The single layer, its derivatives and those of the double layer, in closed form.
    #[inline(always)]
    pub fn closed<T: Lane>(&self, s: V3<T>) -> [T; NUMBERS] {
        let (r, l) = self.panel.seen(s);
        let angle = self.panel.angle(r[0], l);
        numbers(&self.single(r, l, angle), &self.double(r, l, angle))
    }

    /// The same by multipoles far from the panel.
    #[inline(always)]
    pub fn blended<T: Lane>(&self, s: V3<T>) -> [T; NUMBERS] {
        let r = sub(s, constant(s[0], &self.panel.centre));
        let squared = dot(r, r);
        let reach = self.panel.reach;
        if !squared.any_below(reach[1]) {
            let far = self.panel.multipoles(r, squared);
            return numbers(&self.far_single(&far), &self.far_double(&far));
        }
        let (c, l) = self.panel.seen(s);
        let angle = self.panel.angle(c[0], l);
        let (single, double) = (self.single(c, l, angle), self.double(c, l, angle));
        if !(-squared).any_below(-reach[0]) {
            return numbers(&single, &double);
        }
        let far = self.panel.beyond(r, squared);
        let w = Weight::new(squared, reach);
        numbers(
            &self.blend(&single, &self.far_single(&far), &w, r, squared),
            &self.blend(&double, &self.far_double(&far), &w, r, squared),
        )
    }

    /// K = F + w (N − F), w a function of |r|²/ρ².
    #[inline(always)]
    fn blend<T: Lane>(
        &self,
        near: &Moved<T>,
        far: &Moved<T>,
        w: &Weight<T>,
        r: V3<T>,
        squared: T,
    ) -> Moved<T> {
        let difference = near.value - far.value;
        let moved = scale(w.slope * difference * r[0].like(-2.0 / 3.0), r);
        let grown = -(w.slope * difference * squared);
        let mut corners = far.corners;
        for (k, corner) in corners.iter_mut().enumerate() {
            let out = scale_add(w.value, sub(near.corners[k], *corner), *corner);
            let out = scale_add(grown, constant(grown, &self.radii[k]), out);
            *corner = [out[0] + moved[0], out[1] + moved[1], out[2] + moved[2]];
        }
        Moved {
            value: w.value.mul_add(difference, far.value),
            corners,
        }
    }

    /// From the corners seen from the point, their distances and the solid angle.
    #[inline(always)]
    fn single<T: Lane>(&self, r: [V3<T>; 3], l: V3<T>, angle: T) -> Moved<T> {
        let x = l[0];
        let panel = self.panel;
        let logs = [
            panel.logarithm(0, l),
            panel.logarithm(1, l),
            panel.logarithm(2, l),
        ];
        let normal = constant(x, &panel.normal);
        let mut value = -(dot(normal, r[0]) * angle);
        // ∫ λ/r over each edge, of the share of its start and of its end.
        let (mut starts, mut ends) = (logs, logs);
        for e in 0..3 {
            let outward = constant(x, &panel.outward[e]);
            value = dot(outward, r[e]).mul_add(logs[e], value);
            let offset = dot(constant(x, &self.along[e]), r[e]);
            let change = offset.neg_mul_add(logs[e], l[NEXT[e]] - l[e]);
            ends[e] = change * x.like(1.0 / panel.lengths[e]);
            starts[e] = logs[e] - ends[e];
        }
        let height = dot(constant(x, &self.normal), r[0]);
        let mut corners = [normal; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            // λ_k at the point is −∇λ_k·r of any corner where it is 0.
            let share = dot(constant(x, &self.shares[k]), r[NEXT[k]]);
            let tilt = height * dot(constant(x, &self.tilts[k]), logs);
            let out = scale(share.mul_add(angle, tilt), normal);
            let out = scale_add(starts[k], constant(x, &panel.outward[k]), out);
            let before = BEFORE[k];
            *corner = scale_add(ends[before], constant(x, &panel.outward[before]), out);
        }
        Moved { value, corners }
    }

    #[inline(always)]
    fn double<T: Lane>(&self, r: [V3<T>; 3], l: V3<T>, angle: T) -> Moved<T> {
        let weight = l[0].like(self.panel.weight);
        let half = l[0].like(0.5);
        // (r_a × r_b)/(l_a l_b + r_a·r_b)
        let mut edges = r;
        for e in 0..3 {
            let sum = l[e] + l[NEXT[e]];
            let squared = l[0].like(self.panel.half_squares[e]);
            let below = (half * sum).mul_add(sum, -squared);
            let along = constant(l[0], &self.panel.along[e]);
            edges[e] = scale(below.like(1.0) / below, cross(r[e], along));
        }
        let mut corners = edges;
        for (k, corner) in corners.iter_mut().enumerate() {
            let (a, b) = (edges[k], edges[BEFORE[k]]);
            let sum = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
            *corner = scale(-(weight / l[k]), sum);
        }
        Moved {
            value: weight * angle,
            corners,
        }
    }

    #[inline(always)]
    fn far_single<T: Lane>(&self, far: &Multipoles<T>) -> Moved<T> {
        let (value, x) = (far.value(), far.u);
        let weight = x.like(self.panel.weight);
        let charge = self.panel.charge(far);
        let moved = scale(charge * x.like(-1.0 / 3.0), far.gradient());
        let mut corners = [moved; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let out = scale_add(weight * value, constant(x, &self.areas[k]), moved);
            let spread = far.value_spread(constant(x, &self.arms[k]));
            *corner = scale_add(charge * x.like(1.0 / 6.0), spread, out);
        }
        Moved {
            value: charge * value,
            corners,
        }
    }

    /// As C has no part along the normal however the corners move, D·∇f is α D·r.
    #[inline(always)]
    fn far_double<T: Lane>(&self, far: &Multipoles<T>) -> Moved<T> {
        let (alpha, x) = (far.alpha(), far.u);
        let height = self.panel.height(far);
        let gradient = Double::far_gradient(self.panel, far);
        let moved = scale(x.like(-1.0 / 3.0), gradient);
        let mut corners = [moved; 3];
        let turned = alpha * x.like(-0.5 * self.panel.weight);
        for (k, corner) in corners.iter_mut().enumerate() {
            let along = constant(x, &self.panel.along[NEXT[k]]);
            let out = scale_add(turned, cross(along, far.r), moved);
            let spread = far.alpha_spread(constant(x, &self.arms[k]));
            *corner = scale_add(height * x.like(1.0 / 6.0), spread, out);
        }
        Moved {
            value: height * alpha,
            corners,
        }
    }
}

#[inline(always)]
fn numbers<T: Lane>(single: &Moved<T>, double: &Moved<T>) -> [T; NUMBERS] {
    let mut out = [single.value; NUMBERS];
    for k in 0..3 {
        for c in 0..3 {
            out[1 + 3 * k + c] = single.corners[k][c];
            out[10 + 3 * k + c] = double.corners[k][c];
        }
    }
    out
}
