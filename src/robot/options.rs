//! What may be chosen about a robot that is read.

use std::collections::BTreeMap;
use std::path::PathBuf;

choices! {
    /// Whether a robot hangs on the world.
    pub enum Base {
        /// It floats: six more coordinates.
        #[default]
        Free,
        /// Its root stands still.
        Fixed,
    }
}

choices! {
    /// What the water sees of a link.
    pub enum Wet {
        /// What it collides with; where it has none, what is seen of it.
        #[default]
        Collision,
        /// What is seen of it; where nothing is, what it collides with.
        Visual,
        /// The convex hull of what it collides with; where it has none, of what is seen of it.
        Hull,
        /// Nothing: the link is dry.
        None,
    }
}

choices! {
    /// What is done about meshes that aren't closed or cross themselves.
    pub enum BadMeshes {
        /// Their convex hulls stand for them.
        #[default]
        Hull,
        /// They are refused.
        Refuse,
    }
}

choices! {
    /// What is done about joints that follow others.
    pub enum Followers {
        /// A transmission moves them: one coordinate for leader and followers.
        #[default]
        Follow,
        /// Each has a coordinate of its own.
        Independent,
    }
}

/// What is chosen for a link.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LinkChoice {
    pub shape: Option<Wet>,
    pub mass: Option<f64>,
    pub density: Option<f64>,
    pub keep: bool,
    pub center_of_mass: Option<[f64; 3]>,
    pub volume: Option<f64>,
    pub center_of_buoyancy: Option<[f64; 3]>,
    /// What is chosen of the body that the link's frame and name are of, `density` too.
    pub of_body: Vec<&'static str>,
}

impl LinkChoice {
    /// Whether this is chosen of the link's body.
    pub fn has(&self, key: &str) -> bool {
        self.of_body.contains(&key)
    }
}

/// What is chosen for a joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct JointChoice {
    /// m or rad.
    pub limits: Option<[f64; 2]>,
    /// All that is chosen, by the keys' names.
    pub given: Vec<&'static str>,
}

/// What is chosen for a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Options {
    pub base: Option<Base>,
    pub package_path: Vec<PathBuf>,
    pub shape: Wet,
    pub bad_meshes: BadMeshes,
    pub faces: Option<usize>,
    pub followers: Followers,
    pub without_limits: bool,
    pub start: BTreeMap<String, f64>,
    /// Joints that motions drive, and where those begin.
    pub driven: BTreeMap<String, Vec<f64>>,
    /// Joints that get an offset, and that.
    pub zeroed: BTreeMap<String, f64>,
    pub joints: BTreeMap<String, JointChoice>,
    pub links: BTreeMap<String, LinkChoice>,
}
