//! The physical parameters that a trajectory is differentiated with respect to.
//!
//! There is one table of them: each is declared once, by what uses it (the fluid, a body's inertia, a force, contact),
//! with its name, its bounds and the size of a change that says something. Values and cotangents are rows with a shared
//! table; packing, names, checks and gradient checks read the table.

use super::body_parameters::{
    BUOYANCY, CENTER, CONTACT, FLUID, INERTIA, MASS, NO_VOLUME, VOLUME, contact,
};
use crate::adjoint::lie::Vec3;
use crate::scene::impossible_inertia;
use crate::{Error, Result};
use std::fmt;
use std::ops::{Index, IndexMut};
use std::sync::Arc;

pub use super::body_parameters::{
    BodyValues, DENSITY, center_of_buoyancy, center_of_mass, inertia, mass, volume,
};
pub use super::declared::{Declared, Entry, Owner, Parameter, Range, Typical};

/// What is told of a shape's parameter that is set.
const BUILT: &str = "a shape's water is solved when the scene is built: change the shape in the scene (with_shape_parameter) and simulate that";

/// All parameters of a system.
#[derive(Clone, Debug)]
pub struct ParameterTable {
    /// In the order of packing.
    entries: Vec<Entry>,
    /// Place of each parameter in that order, by its number of declaration.
    places: Vec<usize>,
    bodies: usize,
}

/// A table in the making, with the values that it starts from.
#[derive(Clone, Debug)]
pub struct Declarations {
    bodies: Vec<String>,
    /// Entries with their values, in the order of declaration.
    made: Vec<(Entry, f64)>,
}

impl Declarations {
    /// Density (kg/m³) and bodies; those of contact are zero.
    pub fn new(density: f64, bodies: &[BodyValues]) -> Self {
        let mut out = Self {
            bodies: bodies.iter().map(|b| b.name.clone()).collect(),
            made: Vec::new(),
        };
        out.declare(Owner::Fluid, FLUID, density);
        for (b, body) in bodies.iter().enumerate() {
            let volume = match body.volume {
                Some(volume) => (VOLUME, volume),
                None => (NO_VOLUME, 0.0),
            };
            let inertia = INERTIA.into_iter().zip(body.inertia);
            let center = CENTER.into_iter().zip(body.center_of_mass.iter().copied());
            let buoyancy = BUOYANCY.into_iter();
            let buoyancy = buoyancy.zip(body.center_of_buoyancy.iter().copied());
            let all = std::iter::once((MASS, body.mass)).chain(inertia);
            for (declared, value) in all.chain(center).chain([volume]).chain(buoyancy) {
                out.declare(Owner::Body(b), declared, value);
            }
        }
        for declared in CONTACT {
            out.declare(Owner::Named("contact".into()), declared, 0.0);
        }
        out
    }

    /// Adds a parameter with its value.
    pub fn declare(&mut self, owner: Owner, declared: Declared, value: f64) -> Parameter {
        self.declare_named(owner, declared, declared.name, value)
    }

    /// The parameter of this name that its owner has declared already, or else it is added with this value.
    pub fn declare_once(&mut self, owner: Owner, declared: Declared, value: f64) -> Parameter {
        let same = |entry: &Entry| entry.owner == owner && entry.declared.name == declared.name;
        match self.made.iter().position(|(entry, _)| same(entry)) {
            Some(i) => Parameter(i),
            None => self.declare(owner, declared, value),
        }
    }

    /// Adds one of several parameters that are declared alike: its name ends in a dot and `part`.
    pub fn declare_part(
        &mut self,
        owner: Owner,
        declared: Declared,
        part: &str,
        value: f64,
    ) -> Parameter {
        self.declare_named(owner, declared, &format!("{}.{part}", declared.name), value)
    }

    fn declare_named(
        &mut self,
        owner: Owner,
        declared: Declared,
        name: &str,
        value: f64,
    ) -> Parameter {
        let of = match &owner {
            Owner::Fluid => "fluid",
            Owner::Body(b) => &self.bodies[*b],
            Owner::Named(name) => name,
        };
        let entry = Entry {
            name: format!("{of}.{name}"),
            owner,
            declared,
        };
        self.made.push((entry, value));
        Parameter(self.made.len() - 1)
    }

    /// The parameters, with the values that were declared.
    pub fn finish(self) -> Parameters {
        let rank = |i: usize| match &self.made[i].0.owner {
            Owner::Fluid => (0, 0),
            Owner::Body(b) => (1, *b),
            Owner::Named(_) => (2, 0),
        };
        let mut order: Vec<usize> = (0..self.made.len()).collect();
        order.sort_by_key(|i| rank(*i));
        let mut places = vec![0; order.len()];
        for (place, i) in order.iter().enumerate() {
            places[*i] = place;
        }
        let (entries, values) = order.iter().map(|i| self.made[*i].clone()).unzip();
        Parameters {
            table: Arc::new(ParameterTable {
                entries,
                places,
                bodies: self.bodies.len(),
            }),
            values,
        }
    }
}

/// Values of all parameters of a system, or their cotangents. Clones share the table.
#[derive(Clone)]
pub struct Parameters {
    table: Arc<ParameterTable>,
    values: Vec<f64>,
}

impl Index<Parameter> for Parameters {
    type Output = f64;

    fn index(&self, at: Parameter) -> &f64 {
        &self.values[self.table.places[at.0]]
    }
}

impl IndexMut<Parameter> for Parameters {
    fn index_mut(&mut self, at: Parameter) -> &mut f64 {
        &mut self.values[self.table.places[at.0]]
    }
}

impl PartialEq for Parameters {
    fn eq(&self, other: &Self) -> bool {
        self.same_table(other) && self.values == other.values
    }
}

impl fmt::Debug for Parameters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map()
            .entries(self.names().zip(&self.values))
            .finish()
    }
}

impl Parameters {
    /// The table.
    pub fn table(&self) -> &[Entry] {
        &self.table.entries
    }

    /// Names, in the order of [`Parameters::to_vec`]: the fluid's density; per body mass, inertia, centre of mass, volume, centre of
    /// buoyancy and what its forces declare; contact; what belongs to other things.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.table.entries.iter().map(|e| e.name.as_str())
    }

    /// All values in one row.
    pub fn to_vec(&self) -> Vec<f64> {
        self.values.clone()
    }

    /// The same, borrowed.
    pub fn as_slice(&self) -> &[f64] {
        &self.values
    }

    /// Inverse of [`Parameters::to_vec`] with the same table; `None` if the length is wrong.
    pub fn with_values(&self, values: &[f64]) -> Option<Self> {
        (values.len() == self.values.len()).then(|| Self {
            table: self.table.clone(),
            values: values.to_vec(),
        })
    }

    /// All zero, with the same table.
    pub fn zeros(&self) -> Self {
        Self {
            table: self.table.clone(),
            values: vec![0.0; self.values.len()],
        }
    }

    /// The value of this name.
    ///
    /// # Errors
    /// A name that isn't in the table.
    pub fn get(&self, name: &str) -> Result<f64> {
        Ok(self.values[self.place(name)?])
    }

    /// Sets the value of this name, unchecked.
    ///
    /// # Errors
    /// A name that isn't in the table.
    pub fn set(&mut self, name: &str, value: f64) -> Result<()> {
        let at = self.place(name)?;
        self.values[at] = value;
        Ok(())
    }

    /// Where the value of this name stands in [`Parameters::to_vec`].
    ///
    /// # Errors
    /// A name that isn't in the table.
    pub fn place(&self, name: &str) -> Result<usize> {
        self.names().position(|n| n == name).ok_or_else(|| {
            let known: Vec<&str> = self.names().collect();
            Error::input(
                "parameters",
                format!("{name:?}"),
                format!("must be one of {known:?}"),
            )
        })
    }

    /// Where the value of a declared parameter stands in [`Parameters::to_vec`].
    pub fn place_of(&self, parameter: Parameter) -> usize {
        self.table.places[parameter.0]
    }

    /// Density of the fluid, kg/m³.
    pub fn density(&self) -> f64 {
        self[DENSITY]
    }

    /// The same, to be changed.
    pub fn density_mut(&mut self) -> &mut f64 {
        &mut self[DENSITY]
    }

    /// Mass of body `b`, kg.
    pub fn mass(&self, b: usize) -> f64 {
        self[mass(b)]
    }

    /// The same, to be changed.
    pub fn mass_mut(&mut self, b: usize) -> &mut f64 {
        &mut self[mass(b)]
    }

    /// Inertia of body `b` about its centre of mass, body axes: xx, yy, zz, xy, xz, yz, kg m².
    pub fn inertia(&self, b: usize) -> [f64; 6] {
        inertia(b).map(|i| self[i])
    }

    /// Adds to the inertia of body `b`.
    pub fn add_inertia(&mut self, b: usize, more: &[f64; 6]) {
        for (i, x) in inertia(b).into_iter().zip(more) {
            self[i] += x;
        }
    }

    /// Centre of mass of body `b` in its frame, m.
    pub fn center_of_mass(&self, b: usize) -> Vec3 {
        self.point(center_of_mass(b))
    }

    /// Adds to the centre of mass of body `b`.
    pub fn add_center_of_mass(&mut self, b: usize, more: &Vec3) {
        self.add_point(center_of_mass(b), more);
    }

    /// Volume by which body `b` is buoyant, m³.
    pub fn volume(&self, b: usize) -> f64 {
        self[volume(b)]
    }

    /// Centre of buoyancy of body `b` in its frame, m.
    pub fn center_of_buoyancy(&self, b: usize) -> Vec3 {
        self.point(center_of_buoyancy(b))
    }

    pub(super) fn point(&self, of: [Parameter; 3]) -> Vec3 {
        Vec3::from(of.map(|i| self[i]))
    }

    pub(super) fn add_point(&mut self, of: [Parameter; 3], more: &Vec3) {
        for (i, x) in of.into_iter().zip(more.iter()) {
            self[i] += x;
        }
    }

    /// Parameters of contact: stiffness of each point (N/m), dissipation of Hunt and Crossley (s/m), friction coefficient, torsional
    /// and rolling friction (m).
    pub fn contact(&self) -> [f64; 5] {
        contact(self.table.bodies).map(|i| self[i])
    }

    /// Divides the stiffness of contact.
    pub fn soften_contact(&mut self, factor: f64) {
        let [stiffness, ..] = contact(self.table.bodies);
        self[stiffness] /= factor;
    }

    /// Adds to the parameters of contact.
    pub fn add_contact(&mut self, more: [f64; 5]) {
        for (i, x) in contact(self.table.bodies).into_iter().zip(more) {
            self[i] += x;
        }
    }

    /// Adds another set of values.
    pub fn add(&mut self, other: &Self) {
        self.add_scaled(1.0, other);
    }

    /// Adds `scale` times another set of values.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        for (x, y) in self.values.iter_mut().zip(&other.values) {
            *x += scale * y;
        }
    }

    /// Whether both have the same parameters, by name.
    pub fn same_table(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.table, &other.table) || self.names().eq(other.names())
    }

    /// Holds every value against what it may be.
    ///
    /// # Errors
    /// The first one that is out of its range.
    pub fn check(&self) -> Result<()> {
        for (entry, value) in self.table.entries.iter().zip(&self.values) {
            let refused = match entry.declared.range {
                Range::Zero(remedy) if *value != 0.0 => remedy,
                Range::Built(built) if *value != built => BUILT,
                Range::NotNegative if !(*value >= 0.0 && value.is_finite()) => {
                    "must be finite and not negative"
                }
                Range::Positive if !(*value > 0.0 && value.is_finite()) => {
                    "must be finite and above zero"
                }
                Range::Finite if !value.is_finite() => "must be finite",
                _ => continue,
            };
            let place = format!("parameter {}", entry.name);
            return Err(Error::input(place, value, refused));
        }
        for b in 0..self.table.bodies {
            // To a thousandth, so that differences about a thin plate can be taken.
            if let Some(why) = impossible_inertia(&self.inertia(b), 1e-3) {
                let first = self.table.places[inertia(b)[0].0];
                let of = &self.table.entries[first].name;
                let place = format!("parameters {}", of.replace(".xx", ""));
                return Err(Error::input(place, format!("{:?}", self.inertia(b)), why));
            }
        }
        Ok(())
    }

    /// Sizes of changes that say something, in the order of [`Parameters::to_vec`].
    pub fn sizes(&self, speed: f64, length: f64) -> Vec<f64> {
        let size = |(entry, value): (&Entry, &f64)| {
            let moment = match entry.owner {
                Owner::Body(b) => self.inertia(b)[0..3].iter().copied().fold(0.0, f64::max),
                _ => 0.0,
            };
            let typical = Typical {
                density: self.density(),
                speed,
                length,
                moment,
            };
            (entry.declared.size)(*value, &typical)
        };
        let each = self.table.entries.iter().zip(&self.values);
        each.map(size).collect()
    }
}
