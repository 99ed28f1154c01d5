//! Fins and foils, quasi-steady: lift across the flow and drag along it, in the plane of chord and normal.
//!
//! With u along the chord and v along the normal the velocity of a point of the fin through the water, and w = √(u² + v² + w₀²), the force there is
//!
//! ```text
//! lift  ½ ρ A C_Lα (u v / w) (v, −u)        drag  −½ ρ A (C_D0 + C_D1 v² / w²) w (u, v)
//! ```
//!
//! Lift does no work, drag takes some: (u v / w)(v, −u)·(u, v) = 0. Past w₀ the lift coefficient is C_Lα sin α cos α at the angle of attack α, which is that of
//! thin foils where they don't stall, and nothing at a right angle. Both laws have a period of π in α: a fin that is driven backwards is one whose leading edge is the other.
//!
//! The force acts at the centre of pressure, a quarter of the chord from the middle, upstream: at x = x_m + (c/4) (u/w) e_c, with w that of the middle, so that it goes
//! over smoothly as the fin goes backwards, and through the middle where the flow comes across. The velocity above is that of this point: the middle's with
//! v = v_m + (c/4) (u/w_m) ω·(e_c × e_n), u being the same along the whole chord.
//!
//! # References
//! L. Prandtl's thin foils: J. Katz, A. Plotkin, *Low-Speed Aerodynamics*, 2nd ed., Cambridge 2001, section 5.4 (lift slope 2π, centre of pressure at a quarter of the
//! chord) and 8.1 (lift slope and induced drag of finite wings).

use super::local::{Law, Local, component};
use super::{ForceModel, ForceParts, LoadBars, Moving};
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::dynamics::parameters::{DENSITY, Declarations, Declared, Owner, Parameter, Parameters};

const AREA: Declared = Declared::new("area", "m²");
const LIFT_SLOPE: Declared = Declared::new("lift_slope", "1/rad");
const DRAG: Declared = Declared::new("drag", "1").size(|value, _| value.max(1e-3));
const INDUCED_DRAG: Declared = Declared::new("induced_drag", "1").size(|value, _| value.max(1e-3));

struct Fin {
    body: usize,
    /// What u and v_m are of the body's twist, and the rate about the span, ω·(e_c × e_n).
    along: Vec6,
    across: Vec6,
    turning: Vec6,
    /// c/4, m.
    quarter: f64,
    /// w₀, m/s.
    smoothing: f64,
    area: Parameter,
    lift_slope: Parameter,
    drag: Parameter,
    induced_drag: Parameter,
}

/// What forces are of at unit ½ ρ A: u, v and the derivatives by them, of one component each.
struct Foil {
    /// Along the chord and the normal, by lift and drag coefficients: of C_Lα, C_D0, C_D1.
    by: [[f64; 2]; 3],
    /// Derivatives of the force by (u, v).
    slope: [[f64; 2]; 2],
    /// The force.
    force: [f64; 2],
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let mut laws = Vec::new();
    for (i, given) in scene.fins() {
        let owner = Owner::Named(scene.force_name(i));
        let mut declare = |declared, value| parameters.declare(owner.clone(), declared, value);
        let (chord, normal) = given.axes();
        let (middle, chord, normal) = (Vec3::from(given.at), Vec3::from(chord), normal.into());
        laws.push(Fin {
            body: scene.body(&given.body).map_or(0, |b| b.0),
            along: component(&chord, &middle),
            across: component(&normal, &middle),
            turning: six(&Vec3::zeros(), &chord.cross(&normal)),
            quarter: 0.25 * given.length,
            smoothing: given.smoothing,
            area: declare(AREA, given.area),
            lift_slope: declare(LIFT_SLOPE, given.lift_slope),
            drag: declare(DRAG, given.drag),
            induced_drag: declare(INDUCED_DRAG, given.induced_drag),
        });
    }
    Local::assemble("fin", laws)
}

/// The laws at u and v, at unit ½ ρ A.
fn foil(u: f64, v: f64, smoothing: f64, [lift, drag, induced]: [f64; 3]) -> Foil {
    let w = u.hypot(v).hypot(smoothing);
    // Cosines: all below is homogeneous of second degree in u, v, w₀.
    let (a, b) = (u / w, v / w);
    let shares = [
        [a * v * v, -a * u * v],
        [-w * u, -w * v],
        [-b * b * w * u, -b * b * w * v],
    ];
    let coefficients = [lift, drag, induced];
    let force = [0, 1].map(|k| (0..3).map(|c| coefficients[c] * shares[c][k]).sum());
    // ∂w/∂u = a, ∂w/∂v = b.
    let slopes = [
        // u v²/w and −u² v/w.
        [
            [b * v * (1.0 - a * a), a * v * (2.0 - b * b)],
            [-b * u * (2.0 - a * a), -a * u * (1.0 - b * b)],
        ],
        // −w u and −w v.
        [[-w - a * u, -b * u], [-a * v, -w - b * v]],
        // −u v²/w and −v³/w.
        [
            [-b * v * (1.0 - a * a), -a * v * (2.0 - b * b)],
            [a * b * b * v, -b * v * (3.0 - b * b)],
        ],
    ];
    let slope =
        [0, 1].map(|k| [0, 1].map(|l| (0..3).map(|c| coefficients[c] * slopes[c][k][l]).sum()));
    Foil {
        by: shares,
        slope,
        force,
    }
}

/// A fin in the flow.
struct Flow {
    /// Velocity of the centre of pressure through the water.
    u: f64,
    v: f64,
    /// Where that is along the chord, m, and its derivatives by u and v of the middle.
    place: f64,
    place_by: [f64; 2],
    /// Rate about the span.
    rate: f64,
}

impl Fin {
    fn flow(&self, nu: &Vec6) -> Flow {
        let (u, middle) = (self.along.dot(nu), self.across.dot(nu));
        let rate = self.turning.dot(nu);
        let w = u.hypot(middle).hypot(self.smoothing);
        let (a, b) = (u / w, middle / w);
        let place = self.quarter * a;
        Flow {
            u,
            v: middle + place * rate,
            place,
            place_by: [self.quarter * (1.0 - a * a) / w, -self.quarter * a * b / w],
            rate,
        }
    }

    fn coefficients(&self, parameters: &Parameters) -> [f64; 3] {
        [self.lift_slope, self.drag, self.induced_drag].map(|p| parameters[p])
    }

    fn at(&self, flow: &Flow, parameters: &Parameters) -> (f64, Foil) {
        let scale = 0.5 * parameters.density() * parameters[self.area];
        let coefficients = self.coefficients(parameters);
        (scale, foil(flow.u, flow.v, self.smoothing, coefficients))
    }

    /// The wrench of a force along chord and normal at the centre of pressure, and what its velocity across is of the body's twist there.
    fn normal_at(&self, place: f64) -> Vec6 {
        self.across + place * self.turning
    }
}

impl Law for Fin {
    fn body(&self) -> usize {
        self.body
    }

    fn wrench(&self, nu: &Vec6, at: &Moving) -> Vec6 {
        let flow = self.flow(nu);
        let (scale, foil) = self.at(&flow, at.place.parameters);
        scale * (foil.force[0] * self.along + foil.force[1] * self.normal_at(flow.place))
    }

    fn slope(&self, nu: &Vec6, at: &Moving) -> Mat6 {
        let flow = self.flow(nu);
        let (scale, foil) = self.at(&flow, at.place.parameters);
        let normal = self.normal_at(flow.place);
        // Rows: derivatives by the twist of the place, of u and of v there.
        let place = flow.place_by[0] * self.along + flow.place_by[1] * self.across;
        let v = normal + flow.rate * place;
        let force = |k: usize| foil.slope[k][0] * self.along + foil.slope[k][1] * v;
        scale
            * (self.along * force(0).transpose()
                + normal * force(1).transpose()
                + foil.force[1] * self.turning * place.transpose())
    }

    fn inputs_vjp(&self, nu: &Vec6, zeta: &Vec6, at: &Moving, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        let flow = self.flow(nu);
        let (scale, foil) = self.at(&flow, parameters);
        let ends = [self.along.dot(zeta), self.normal_at(flow.place).dot(zeta)];
        let power = |force: &[f64; 2]| ends[0] * force[0] + ends[1] * force[1];
        let unit = 0.5 * power(&foil.force);
        bar.parameters[self.area] += parameters.density() * unit;
        bar.parameters[DENSITY] += parameters[self.area] * unit;
        let coefficients = [self.lift_slope, self.drag, self.induced_drag];
        for (coefficient, by) in coefficients.into_iter().zip(&foil.by) {
            bar.parameters[coefficient] += scale * power(by);
        }
    }

    fn acts(&self, parameters: &Parameters) -> bool {
        let coefficients = self.coefficients(parameters);
        parameters[self.area] != 0.0 && coefficients.iter().any(|c| *c != 0.0)
    }
}
