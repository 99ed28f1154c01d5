//! How a physical parameter is declared: by what uses it, with its name, its bounds and the size of a change that says something.

/// What a parameter belongs to: the first part of its name, and its place in the order of all of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Owner {
    /// The fluid.
    Fluid,
    /// A body, by its number.
    Body(usize),
    /// Anything else, by its name; in the order of declaration, after the bodies.
    Named(String),
}

/// Values that a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Finite,
    /// Zero and above.
    NotNegative,
    /// Above zero.
    Positive,
    /// Zero alone; what would have to be done to change that.
    Zero(&'static str),
    /// This one alone, with which the scene was built: what follows from another one is made with the scene.
    Built(f64),
}

/// Sizes of a system's motion, which sizes of changes follow from.
#[derive(Clone, Copy, Debug)]
pub struct Typical {
    /// Density of the fluid, kg/m³.
    pub density: f64,
    /// Largest velocity of a joint, m/s or rad/s.
    pub speed: f64,
    /// Size of the largest body, m.
    pub length: f64,
    /// Largest moment of inertia of the body that the parameter belongs to, kg m²; zero if to none.
    pub moment: f64,
}

/// Declaration of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// Name, without its owner's; of parts declared alike, what they have in common.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Values that it may have.
    pub range: Range,
    /// Size of a change that says something, from its value.
    pub size: fn(f64, &Typical) -> f64,
}

impl Declared {
    /// A parameter that isn't negative, whose changes are measured by its value.
    pub const fn new(name: &'static str, unit: &'static str) -> Self {
        Self {
            name,
            unit,
            range: Range::NotNegative,
            size: |value, _| value,
        }
    }

    /// With other values allowed.
    pub const fn range(mut self, range: Range) -> Self {
        self.range = range;
        self
    }

    /// With another size of a change.
    pub const fn size(mut self, size: fn(f64, &Typical) -> f64) -> Self {
        self.size = size;
        self
    }
}

/// Where the value of a declared parameter stands: its index in [`Parameters`](super::Parameters).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter(pub(super) usize);

/// One line of the table.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Full name: its owner's, a dot, its own.
    pub name: String,
    /// What it belongs to.
    pub owner: Owner,
    /// How it was declared.
    pub declared: Declared,
}
