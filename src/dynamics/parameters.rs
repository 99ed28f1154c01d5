//! The physical parameters that a trajectory is differentiated with respect to.

use serde::Serialize;

/// Parameters of a system; the same structure holds their cotangents.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameters {
    /// Fluid density, kg/m³.
    pub density: f64,
    /// Mass of each body, kg.
    pub mass: Vec<f64>,
    /// Inertia of each body about its centre of mass, body axes: xx, yy, zz, xy, xz, yz, kg m².
    pub inertia: Vec<[f64; 6]>,
    /// Linear drag coefficient of each body, kg/(m² s): νρ of Eq. 22.
    pub linear_drag: Vec<f64>,
    /// Quadratic drag coefficient of each body, dimensionless. Zero, with zero derivative, for a body whose scene gives no
    /// drag at all: its surface isn't kept.
    pub quadratic_drag: Vec<f64>,
    /// Contact, the same for all surfaces.
    pub contact: Contact,
}

/// Parameters of contact that a trajectory is differentiated with respect to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Contact {
    /// Stiffness of each point, N/m.
    pub stiffness: f64,
    /// Dissipation of Hunt and Crossley, s/m.
    pub dissipation: f64,
    /// Friction coefficient.
    pub friction: f64,
}

impl Parameters {
    /// All zero, for `bodies` bodies.
    pub fn zeros(bodies: usize) -> Self {
        Self {
            density: 0.0,
            mass: vec![0.0; bodies],
            inertia: vec![[0.0; 6]; bodies],
            linear_drag: vec![0.0; bodies],
            quadratic_drag: vec![0.0; bodies],
            contact: Contact::default(),
        }
    }

    /// All values in one row: density, then per body mass, inertia (6), linear and quadratic drag; then
    /// stiffness, dissipation and friction of contact.
    pub fn to_vec(&self) -> Vec<f64> {
        let mut out = vec![self.density];
        for b in 0..self.mass.len() {
            out.push(self.mass[b]);
            out.extend(self.inertia[b]);
            out.push(self.linear_drag[b]);
            out.push(self.quadratic_drag[b]);
        }
        out.extend([
            self.contact.stiffness,
            self.contact.dissipation,
            self.contact.friction,
        ]);
        out
    }

    /// Inverse of [`Parameters::to_vec`] for the same number of bodies; `None` if the length is wrong.
    pub fn with_values(&self, values: &[f64]) -> Option<Self> {
        let bodies = self.mass.len();
        if values.len() != 4 + 9 * bodies {
            return None;
        }
        let mut out = Self::zeros(bodies);
        out.density = values[0];
        for b in 0..bodies {
            let row = &values[1 + 9 * b..10 + 9 * b];
            out.mass[b] = row[0];
            out.inertia[b].copy_from_slice(&row[1..7]);
            out.linear_drag[b] = row[7];
            out.quadratic_drag[b] = row[8];
        }
        let row = &values[1 + 9 * bodies..];
        out.contact = Contact {
            stiffness: row[0],
            dissipation: row[1],
            friction: row[2],
        };
        Some(out)
    }

    /// Names of [`Parameters::to_vec`]'s entries, with the given body names.
    pub fn names(&self, bodies: &[String]) -> Vec<String> {
        let mut out = vec!["fluid.density".to_string()];
        for name in bodies {
            out.push(format!("{name}.mass"));
            for axis in ["xx", "yy", "zz", "xy", "xz", "yz"] {
                out.push(format!("{name}.inertia.{axis}"));
            }
            out.push(format!("{name}.drag.linear"));
            out.push(format!("{name}.drag.quadratic"));
        }
        out.extend(["stiffness", "dissipation", "friction"].map(|n| format!("contact.{n}")));
        out
    }

    /// Adds another set of values.
    pub fn add(&mut self, other: &Self) {
        self.add_scaled(1.0, other);
    }

    /// Adds `scale` times another set of values.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        self.density += scale * other.density;
        for b in 0..self.mass.len() {
            self.mass[b] += scale * other.mass[b];
            for k in 0..6 {
                self.inertia[b][k] += scale * other.inertia[b][k];
            }
            self.linear_drag[b] += scale * other.linear_drag[b];
            self.quadratic_drag[b] += scale * other.quadratic_drag[b];
        }
        self.contact.stiffness += scale * other.contact.stiffness;
        self.contact.dissipation += scale * other.contact.dissipation;
        self.contact.friction += scale * other.contact.friction;
    }
}
