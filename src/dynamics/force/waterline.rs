//! Buoyancy of bodies that reach through the surface of still water: ρ |g| V upward at the centroid of the volume V below it.
//!
//! A body is buoyant at the centre that its parameters give: its surface is moved there, for the water's surface as well, so that an energy stays that the force is
//! the slope of.
//!
//! With N = ∫ x dV over that volume and h the surface's height, the wrench is ρ |g| (V e, N × e), e upward, and the energy ρ |g| (h V − e·N), whose slope it is.

use super::{ForceModel, ForceParts, LoadBars, Loads, Moving, Outside, Place, Together, Velocity};
use crate::adjoint::lie::{Vec3, Vec6, angular, linear, six};
use crate::adjoint::waterline::{Below, Hull};
use crate::dynamics::parameters::{
    DENSITY, Declarations, Parameter, Parameters, center_of_buoyancy, volume,
};

/// The surface of still water, or where depths are counted from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waterline {
    /// Against gravity, a unit vector.
    pub up: Vec3,
    /// Its height along `up`, m.
    pub height: f64,
}

impl Waterline {
    /// How far a point of the world is below it, m.
    pub fn depth(&self, x: &Vec3) -> f64 {
        self.height - self.up.dot(x)
    }
}

struct Floating {
    surface: Waterline,
    /// m/s².
    gravity: f64,
    hulls: Vec<Floater>,
}

struct Floater {
    body: usize,
    hull: Hull,
    /// What the body displaces deep down, m³.
    volume: Parameter,
    /// That of its mesh, m³.
    mesh_volume: f64,
    /// Where that is to be centred, and where its own centre is, body's frame, m.
    center: [Parameter; 3],
    mesh_center: Vec3,
    /// With shape parameters a little larger and smaller by the step.
    changed: Vec<(Parameter, f64, [Box<Floater>; 2])>,
}

pub(super) fn buoyancy(parts: &ForceParts, _: &mut Declarations) -> Option<Box<dyn ForceModel>> {
    let surface = parts.waterline?;
    let floater = |(body, hull): (usize, &Option<Hull>)| {
        let mut out = Floater::new(body, hull.clone()?)?;
        for changed in parts.changed.iter().filter(|c| c.body == body) {
            let [more, less] = changed.steps().map(|t| (changed.hull)(t));
            let both = [Floater::new(body, more)?, Floater::new(body, less)?];
            let both = both.map(Box::new);
            out.changed.push((changed.parameter, changed.step, both));
        }
        Some(out)
    };
    let hulls: Vec<_> = (parts.hulls.iter().enumerate())
        .filter_map(floater)
        .collect();
    let gravity = Vec3::from(parts.scene.gravity).norm();
    (!hulls.is_empty()).then(|| {
        Box::new(Floating {
            surface,
            gravity,
            hulls,
        }) as Box<dyn ForceModel>
    })
}

impl Floater {
    fn new(body: usize, hull: Hull) -> Option<Self> {
        let whole = Below::new(&hull, &Vec3::z(), f64::INFINITY);
        (whole.volume > 0.0).then_some(Self {
            body,
            hull,
            volume: volume(body),
            mesh_volume: whole.volume,
            center: center_of_buoyancy(body),
            mesh_center: whole.moment / whole.volume,
            changed: Vec::new(),
        })
    }

    /// What its mesh displaces, in the world.
    fn displaced(&self, surface: &Waterline, place: &Place) -> Below {
        let mut pose = place.poses[self.body];
        let moved = place.parameters.point(self.center) - self.mesh_center;
        pose.translation += pose.rotation * moved;
        let normal = pose.rotation.tr_mul(&surface.up);
        let height = surface.depth(&pose.translation);
        let own = Below::new(&self.hull, &normal, height);
        own.moved(&pose)
    }

    /// The body's volume over that of its mesh.
    fn fill(&self, parameters: &Parameters) -> f64 {
        parameters[self.volume] / self.mesh_volume
    }
}

/// Wrench of unit weight of the water that is displaced.
fn wrench(below: &Below, up: &Vec3) -> Vec6 {
    six(&(below.volume * up), &below.moment.cross(up))
}

/// Cotangent of the pose for the power of [`wrench`] on the twist `z`.
fn wrench_vjp(below: &Below, up: &Vec3, z: &Vec6) -> Vec6 {
    // The power is c V + y·N. A displacement takes the volume along, and raises the body by η·e against the surface.
    let (c, y) = (up.dot(&linear(z)), up.cross(&angular(z)));
    let (risen, tilted) = below.vjp(c, &y);
    six(
        &(below.volume * y - risen * up),
        &(below.moment.cross(&y) + tilted.cross(up)),
    )
}

impl Floating {
    /// |g| ρ.
    fn weight(&self, parameters: &Parameters) -> f64 {
        self.gravity * parameters[DENSITY]
    }
}

impl ForceModel for Floating {
    fn name(&self) -> &'static str {
        "buoyancy"
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        let weight = self.weight(at.place.parameters);
        for hull in &self.hulls {
            let displaced = hull.displaced(&self.surface, &at.place);
            let weight = weight * hull.fill(at.place.parameters);
            out.wrenches[hull.body] += weight * wrench(&displaced, &self.surface.up);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        let weight = self.weight(at.place.parameters);
        for hull in &self.hulls {
            let (up, virt) = (&self.surface.up, &z.twists[hull.body]);
            let displaced = hull.displaced(&self.surface, &at.place);
            let fill = hull.fill(at.place.parameters);
            let pose_bar = weight * fill * wrench_vjp(&displaced, up, virt);
            bar.pose[hull.body] += pose_bar;
            // The surface is displaced alone.
            let turned = at.place.poses[hull.body]
                .rotation
                .tr_mul(&linear(&pose_bar));
            bar.parameters.add_point(hull.center, &turned);
            let power = wrench(&displaced, up).dot(virt);
            bar.parameters[DENSITY] += self.gravity * fill * power;
            bar.parameters[hull.volume] += weight / hull.mesh_volume * power;
            for (parameter, step, both) in &hull.changed {
                // At a given volume and centre: these follow by themselves.
                let [more, less] = both.each_ref().map(|changed| {
                    let displaced = changed.displaced(&self.surface, &at.place);
                    changed.fill(at.place.parameters) * wrench(&displaced, up).dot(virt)
                });
                bar.parameters[*parameter] += weight * (more - less) / (2.0 * step);
            }
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(Vec::new())
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        match self.hulls.iter().any(|hull| group.holds(hull.body)) {
            true => Outside::Along(self.surface.up),
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, _: &Parameters) -> bool {
        true
    }

    fn displaced(&self, place: &Place) -> Vec<(f64, Vec3)> {
        let out_of_it = |hull: &Floater| {
            let below = hull.displaced(&self.surface, place);
            let (fill, whole) = (hull.fill(place.parameters), place.parameters[hull.volume]);
            let center = place.poses[hull.body].apply(&place.parameters.point(hull.center));
            (
                fill * below.volume - whole,
                fill * below.moment - whole * center,
            )
        };
        self.hulls.iter().map(out_of_it).collect()
    }

    fn potential_energy(&self, place: &Place) -> f64 {
        let of = |hull: &Floater| {
            let below = hull.displaced(&self.surface, place);
            let unit = self.surface.height * below.volume - self.surface.up.dot(&below.moment);
            hull.fill(place.parameters) * unit
        };
        self.weight(place.parameters) * self.hulls.iter().map(of).sum::<f64>()
    }
}
