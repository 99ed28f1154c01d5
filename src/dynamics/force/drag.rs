//! Drag by the velocity through the water, summed over a body's surface: linear, −c R ν in the body's frame (Eq. 22), and quadratic,
//! −½ ρ c Σ ΔA |w| w.

use super::{
    ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Together, Velocity, Waterline,
};
use crate::adjoint::drag::{
    Element, Part, Surface, quadratic_drag, quadratic_drag_derivative, resistance,
};
use crate::adjoint::lie::{Mat6, Pose, Vec6, cross_force, point_wrench};
use crate::dynamics::Parameters;
use crate::dynamics::parameters::{DENSITY, Declarations, Declared, Owner, Parameter, Range};
use crate::scene::DragPart;
use std::borrow::Cow;

/// Of νρ of Eq. 22; at zero a change is measured by the water's momentum through a thousandth of the surface.
const LINEAR: Declared = Declared::new("drag.linear", "kg/(m² s)")
    .size(|value, typical| value.max(1e-3 * typical.density * typical.speed));
/// c, per area of the surface.
const QUADRATIC: Declared = Declared::new("drag.quadratic", "1");
/// The same of a body whose surface isn't kept.
const NONE: Declared = QUADRATIC.range(Range::Zero(
    "must be 0 for a body whose scene gives no drag; give it `drag` there, zero if need be",
));

struct Drag {
    name: &'static str,
    bodies: Vec<Dragged>,
    waterline: Option<Waterline>,
}

struct Dragged {
    body: usize,
    coefficient: Parameter,
    kind: Kind,
    /// Of the whole surface.
    law: Law,
    /// Its pieces, where water has a surface that may cut it.
    surface: Vec<Element>,
    /// With shape parameters a little larger and smaller by the step.
    changed: Vec<(Parameter, f64, [Box<Dragged>; 2])>,
}

/// What drags at unit coefficient, body frame.
#[derive(Clone)]
enum Law {
    Linear(Box<Mat6>),
    /// At unit density.
    Quadratic(Surface),
}

/// Which law, and of which part of the velocity.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Linear(Part),
    Quadratic(Part),
}

impl Kind {
    fn of(self, surface: &[Element]) -> Law {
        match self {
            Self::Linear(part) => Law::Linear(Box::new(resistance(surface, part))),
            Self::Quadratic(part) => Law::Quadratic(Surface::new(surface, part)),
        }
    }
}

pub(super) fn linear(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let mut bodies = Vec::new();
    for (body, surface) in parts.surfaces.iter().enumerate() {
        let given = parts.scene.bodies[body].drag.unwrap_or_default();
        let value = if surface.is_empty() {
            0.0
        } else {
            given.linear
        };
        let coefficient = parameters.declare(Owner::Body(body), LINEAR, value);
        // Also at zero coefficient: the derivative with respect to it isn't zero.
        if !surface.is_empty() {
            let kind = Kind::Linear(part(given.part));
            bodies.push(Dragged::new(body, coefficient, kind, surface, parts));
        }
    }
    assemble("linear drag", bodies, parts)
}

pub(super) fn quadratic(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let mut bodies = Vec::new();
    for (body, surface) in parts.surfaces.iter().enumerate() {
        let owner = Owner::Body(body);
        match parts.scene.bodies[body].drag {
            Some(given) if !surface.is_empty() => {
                let coefficient = parameters.declare(owner, QUADRATIC, given.quadratic);
                let kind = Kind::Quadratic(part(given.quadratic_part));
                bodies.push(Dragged::new(body, coefficient, kind, surface, parts));
            }
            _ => {
                parameters.declare(owner, NONE, 0.0);
            }
        }
    }
    assemble("quadratic drag", bodies, parts)
}

fn assemble(
    name: &'static str,
    bodies: Vec<Dragged>,
    parts: &ForceParts,
) -> Option<Box<dyn ForceModel>> {
    let waterline = parts.waterline;
    (!bodies.is_empty()).then(|| {
        Box::new(Drag {
            name,
            bodies,
            waterline,
        }) as Box<dyn ForceModel>
    })
}

/// A scene's name for which part of a surface's velocity drags.
fn part(part: DragPart) -> Part {
    match part {
        DragPart::Tangential => Part::Tangential,
        DragPart::Normal => Part::Normal,
        DragPart::Total => Part::Total,
    }
}

impl Law {
    fn wrench(&self, nu: &Vec6) -> Vec6 {
        match self {
            Self::Linear(resistance) => -(**resistance * nu),
            Self::Quadratic(surface) => quadratic_drag(surface, nu),
        }
    }

    /// The derivative of the wrench, symmetric, and the wrench, at the cost of the first.
    fn slope(&self, nu: &Vec6) -> (Mat6, Vec6) {
        match self {
            Self::Linear(resistance) => (-**resistance, self.wrench(nu)),
            Self::Quadratic(surface) => {
                let slope = quadratic_drag_derivative(surface, nu);
                (slope, 0.5 * slope * nu)
            }
        }
    }
}

/// How much of a piece of surface is wet, whose centre is this deep: it sets in over the piece's size, on both sides of the surface; and the slope, 1/m.
fn wet(depth: f64, area: f64) -> (f64, f64) {
    let size = area.sqrt();
    let x = (0.5 + 0.5 * depth / size).clamp(0.0, 1.0);
    (x * x * (3.0 - 2.0 * x), 3.0 * x * (1.0 - x) / size)
}

impl Dragged {
    fn new(
        body: usize,
        coefficient: Parameter,
        kind: Kind,
        surface: &[Element],
        parts: &ForceParts,
    ) -> Self {
        let of = |surface: &[Element]| Self {
            changed: Vec::new(),
            body,
            coefficient,
            kind,
            law: kind.of(surface),
            surface: match parts.waterline {
                Some(_) => surface.to_vec(),
                None => Vec::new(),
            },
        };
        // Also at zero coefficient, as the drag itself: it may be set.
        let own = parts.changed.iter().filter(|c| c.body == body);
        let changed = own.map(|c| {
            let both = c.steps().map(|t| Box::new(of(&(c.surface)(t))));
            (c.parameter, c.step, both)
        });
        Self {
            changed: changed.collect(),
            ..of(surface)
        }
    }

    /// The law of what is below the surface of the water: none where it is the whole.
    fn cut(&self, waterline: Option<&Waterline>, pose: &Pose) -> Option<Law> {
        let waterline = waterline?;
        let share = |e: &Element| wet(waterline.depth(&pose.apply(&e.center)), e.area).0;
        let shares: Vec<f64> = self.surface.iter().map(share).collect();
        if shares.iter().all(|share| *share == 1.0) {
            return None;
        }
        let each = self.surface.iter().zip(shares).filter(|(_, s)| *s > 0.0);
        let pieces = each.map(|(e, share)| Element {
            area: share * e.area,
            ..*e
        });
        Some(self.kind.of(&pieces.collect::<Vec<_>>()))
    }

    /// Adds the cotangent of the pose through what is below the surface, for a power on the body-frame velocity `zeta`.
    fn cut_vjp(&self, waterline: &Waterline, pose: &Pose, nu: &Vec6, zeta: &Vec6, bar: &mut Vec6) {
        for e in &self.surface {
            let x = pose.apply(&e.center);
            let (_, slope) = wet(waterline.depth(&x), e.area);
            if slope > 0.0 {
                let power = self.kind.of(std::slice::from_ref(e)).wrench(nu).dot(zeta);
                *bar -= slope * power * point_wrench(&x, &waterline.up);
            }
        }
    }

    /// What multiplies the law.
    fn scale(&self, parameters: &Parameters) -> f64 {
        match self.law {
            Law::Linear(_) => parameters[self.coefficient],
            Law::Quadratic(_) => parameters.density() * parameters[self.coefficient],
        }
    }
}

impl Drag {
    /// The law of what is in the water.
    fn law<'d>(&self, d: &'d Dragged, pose: &Pose) -> Cow<'d, Law> {
        let cut = d.cut(self.waterline.as_ref(), pose);
        cut.map_or(Cow::Borrowed(&d.law), Cow::Owned)
    }

    /// What drags at all: with its scale, its body's pose and twist through the water, body frame.
    fn acting<'d>(
        &'d self,
        at: &'d Moving,
    ) -> impl Iterator<Item = (usize, Cow<'d, Law>, f64, &'d Pose, Vec6)> {
        let each = self.bodies.iter();
        let each = each.map(|d| (d, d.scale(at.place.parameters)));
        each.filter(|(_, scale)| *scale != 0.0).map(|(d, scale)| {
            let pose = &at.place.poses[d.body];
            let nu = pose.twist_to_body(&at.relative(d.body));
            (d.body, self.law(d, pose), scale, pose, nu)
        })
    }
}

impl ForceModel for Drag {
    fn name(&self) -> &'static str {
        self.name
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for (b, law, scale, pose, nu) in self.acting(at) {
            out.wrenches[b] += pose.wrench_to_world(&(scale * law.wrench(&nu)));
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        self.jvps(at, std::slice::from_ref(change), std::slice::from_mut(out));
    }

    fn jvps(&self, at: &Moving, changes: &[Velocity], out: &mut [Loads]) {
        for (b, law, scale, pose, nu) in self.acting(at) {
            let slope = scale * law.slope(&nu).0;
            for (change, out) in changes.iter().zip(out.iter_mut()) {
                let dnu = pose.twist_to_body(&change.twists[b]);
                out.wrenches[b] += pose.wrench_to_world(&(slope * dnu));
            }
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        self.vjps(at, std::slice::from_ref(z), std::slice::from_mut(bar), true);
    }

    fn vjps(&self, at: &Moving, z: &[Velocity], bars: &mut [LoadBars], by_parameters: bool) {
        let parameters = at.place.parameters;
        for d in &self.bodies {
            let b = d.body;
            let pose = &at.place.poses[b];
            let scale = d.scale(parameters);
            if scale == 0.0 && !by_parameters {
                continue;
            }
            let relative = at.relative(b);
            let nu = pose.twist_to_body(&relative);
            // The sums over the surface, once for all.
            let (slope, unit) = self.law(d, pose).slope(&nu);
            for (z, bar) in z.iter().zip(bars.iter_mut()) {
                let virt = &z.twists[b];
                let zeta = pose.twist_to_body(virt);
                let power = zeta.dot(&unit);
                match d.law {
                    Law::Linear(_) => bar.parameters[d.coefficient] += power,
                    Law::Quadratic(_) => {
                        bar.parameters[d.coefficient] += parameters.density() * power;
                        bar.parameters[DENSITY] += parameters[d.coefficient] * power;
                    }
                }
                if scale != 0.0 && by_parameters {
                    for (parameter, step, both) in &d.changed {
                        let [more, less] = both
                            .each_ref()
                            .map(|d| self.law(d, pose).wrench(&nu).dot(&zeta));
                        bar.parameters[*parameter] += scale * (more - less) / (2.0 * step);
                    }
                }
                if scale != 0.0 {
                    // The rotation of the frame acts on both twists.
                    let wrench = pose.wrench_to_world(&(scale * unit));
                    let nu_bar = pose.wrench_to_world(&(scale * slope.tr_mul(&zeta)));
                    at.relative_vjp(b, &nu_bar, bar);
                    bar.pose[b] -= cross_force(&relative, &nu_bar) + cross_force(virt, &wrench);
                    if let Some(waterline) = &self.waterline {
                        let mut cut = Vec6::zeros();
                        d.cut_vjp(waterline, pose, &nu, &zeta, &mut cut);
                        bar.pose[b] += scale * cut;
                    }
                }
            }
        }
    }

    fn resists(&self) -> bool {
        true
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, parameters: &Parameters) -> Outside {
        let acts = |d: &Dragged| group.holds(d.body) && parameters[d.coefficient] != 0.0;
        match self.bodies.iter().any(acts) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.bodies.iter().all(|d| parameters[d.coefficient] == 0.0)
    }
}
