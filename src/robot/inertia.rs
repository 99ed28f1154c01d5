//! Masses of links, and of what moves together.

use super::file::File;
use super::options::LinkChoice;
use super::report::Report;
use super::tree::{Group, link_place, placed};
use crate::geometry::impossible_inertia;
use crate::{Error, Result};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Of the largest principal moment, what may be missing: files round to two digits and more.
const SLACK: f64 = 0.02;

/// Mass, centre of mass and inertia about it, in the axes of some frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Inertial {
    /// kg.
    pub mass: f64,
    /// m.
    pub center: Vector3<f64>,
    /// kg m², about the centre of mass.
    pub inertia: Matrix3<f64>,
}

impl Inertial {
    /// Whether it has neither mass nor inertia.
    pub fn is_none(&self) -> bool {
        self.mass == 0.0 && self.inertia == Matrix3::zeros()
    }

    pub fn moved(&self, at: &Isometry3<f64>) -> Self {
        let turn = at.rotation.to_rotation_matrix();
        Self {
            mass: self.mass,
            center: (at * nalgebra::Point3::from(self.center)).coords,
            inertia: turn * self.inertia * turn.inverse(),
        }
    }

    /// Inertia about another point than the centre of mass.
    fn about(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let d = self.center - point;
        let outer = d * d.transpose();
        self.inertia + self.mass * (Matrix3::identity() * d.norm_squared() - outer)
    }

    /// Of several in the axes of one frame.
    pub fn together(parts: &[Self]) -> Self {
        let mass: f64 = parts.iter().map(|p| p.mass).sum();
        let first: Vector3<f64> = parts.iter().map(|p| p.mass * p.center).sum();
        let center = match mass > 0.0 {
            true => first / mass,
            false => Vector3::zeros(),
        };
        Self {
            mass,
            center,
            inertia: parts.iter().map(|p| p.about(&center)).sum(),
        }
    }

    /// xx, yy, zz, xy, xz, yz.
    pub fn six(&self) -> [f64; 6] {
        let i = &self.inertia;
        [
            i[(0, 0)],
            i[(1, 1)],
            i[(2, 2)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 2)],
        ]
    }

    /// The principal moments, smallest first.
    pub fn moments(&self) -> [f64; 3] {
        let mut moments = self.inertia.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        moments.into()
    }
}

/// xx, yy, zz, xy, xz, yz as the file gives them.
fn six(file: &File, link: usize) -> [f64; 6] {
    let i = &file.robot.links[link].inertial.inertia;
    [i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz]
}

/// Of a link, in its frame, as the file gives it; `chosen` is what is chosen for the link whose frame its body has, which may stand in place of what the file says.
pub(super) fn of_link(file: &File, link: usize, chosen: Option<&LinkChoice>) -> Result<Inertial> {
    let given = &file.robot.links[link].inertial;
    let mass = given.mass.value;
    let i = &given.inertia;
    if mass < 0.0 && !chosen.is_some_and(|c| c.has("density")) {
        return Err(Error::input(
            format!("{}: mass", link_place(file, link)),
            mass,
            "give zero (a massless link) or more, in kg",
        ));
    }
    let own = Inertial {
        // Of a negative one nothing is used but that it is there.
        mass: mass.abs(),
        center: Vector3::zeros(),
        inertia: Matrix3::new(
            i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz,
        ),
    };
    Ok(own.moved(&placed(&given.origin)))
}

/// Of all links of a group, in its frame, from each link's `own`; `chosen` is what is chosen for its body. What no distribution of mass has is mended where rounding may
/// have made it, refused of the whole, and of a part that is nothing beside the others told.
pub(super) fn of_group(
    file: &File,
    group: &Group,
    own: &[Inertial],
    chosen: Option<&LinkChoice>,
    report: &mut Report,
) -> Result<Inertial> {
    let parts: Vec<Inertial> = (group.parts.iter())
        .map(|part| own[part.link].moved(&part.at))
        .collect();
    // One link alone is as the file gives it, to the bit.
    let mut whole = match parts[..] {
        [one] => one,
        _ => Inertial::together(&parts),
    };
    if chosen.is_some_and(|c| c.has("density") || c.has("inertia")) {
        return Ok(whole);
    }
    let name = |link: usize| &file.robot.links[link].name;
    let alone = |link: usize| impossible_inertia(&six(file, link), SLACK);
    let links = group.parts.iter().map(|part| part.link);
    let bad: Vec<usize> = links.filter(|link| alone(*link).is_some()).collect();
    if let Some(why) = impossible_inertia(&whole.six(), SLACK) {
        let link = bad.first().copied().unwrap_or(group.top());
        let (six, why) = match alone(link) {
            Some(why) => (six(file, link), why),
            None => (whole.six(), why),
        };
        let remedy = match group.top() == link {
            true => "give the link a `density`, from which it follows".to_string(),
            false => format!(
                "give link {:?}, whose body it is part of, a `density`, from which that body's follows",
                name(group.top())
            ),
        };
        return Err(Error::input(
            format!("{}: inertia", link_place(file, link)),
            format!("{six:?} (xx, yy, zz, xy, xz, yz)"),
            format!("{why}; correct it, or {remedy}"),
        ));
    }
    if group.parts.len() > 1 {
        for link in bad {
            report.note(format!(
                "link {:?}: its inertia, {:?} kg m² (xx, yy, zz, xy, xz, yz), is one that no distribution of mass has; that of body {:?}, which it is part of, can be, and is used",
                name(link),
                six(file, link),
                name(group.top())
            ));
        }
    }
    if impossible_inertia(&whole.six(), 1e-9).is_some() {
        // As much on all moments: then the largest is the sum of the others.
        let [a, b, c] = whole.moments();
        let missing = (c - a - b).max(-a);
        whole.inertia += Matrix3::identity() * missing;
        report.note(format!(
            "link {:?}: its inertia has the principal moments {a:?}, {b:?}, {c:?} kg m², which no distribution of mass has, by what rounding may do: {missing:.3e} was added to each",
            name(group.top())
        ));
    }
    Ok(whole)
}
