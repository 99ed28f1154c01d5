//! Masses of bodies: given, of geometry, and as the file asks of all.

use super::super::inertia::Inertial;
use super::Made;
use super::geometry::{Geometries, Placed};
use crate::Result;
use mjcf_rs::body::{Body, Geom, InertiaSpec, Inertial as Given};
use mjcf_rs::compiler::InertiaFromGeom;
use nalgebra::Matrix3;

impl Made<'_> {
    /// Mass and inertia of a body in its own axes: as given, or of its geoms, with the least that the file asks for.
    pub(super) fn mass(
        &mut self,
        body: &Body,
        of: &str,
        geometries: &Geometries,
        solids: &[(&Geom, Placed)],
    ) -> Result<Inertial> {
        // Geoms are asked only where there are any.
        let asked = self.model.compiler.inertia_from_geom;
        let from_geoms = match &body.inertial {
            None => asked != InertiaFromGeom::False,
            Some(_) => asked == InertiaFromGeom::True && !body.geoms.is_empty(),
        };
        let density = self.model.compiler.inertia_density;
        let found = match &body.inertial {
            _ if from_geoms => {
                let notes = &mut self.file.notes;
                let mut parts = Vec::new();
                for (geom, solid) in solids {
                    parts.extend(geometries.inertial(geom, solid, density, notes)?);
                }
                Inertial::together(&parts)
            }
            Some(given) => self.inertial(of, given)?,
            None => Inertial::together(&[]),
        };
        Ok(self.bounded(found))
    }

    /// With the least mass and the least principal moments that the file asks of every body. Bounds of zero are none: what is negative is refused.
    fn bounded(&self, mut found: Inertial) -> Inertial {
        let compiler = &self.model.compiler;
        if compiler.bound_mass > 0.0 {
            found.mass = found.mass.max(compiler.bound_mass);
        }
        let bound = compiler.bound_inertia;
        let less = |moment: &f64| *moment < bound;
        if bound > 0.0 && found.moments().iter().any(less) {
            let principal = found.inertia.symmetric_eigen();
            let moments = principal.eigenvalues.map(|moment| moment.max(bound));
            let axes = principal.eigenvectors;
            found.inertia = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
        }
        found
    }

    /// As given, in the body's axes.
    fn inertial(&self, of: &str, given: &Given) -> Result<Inertial> {
        let at = self.checked(&format!("{of}: inertial"), &given.pose)?;
        let six = match given.inertia {
            InertiaSpec::Diagonal([x, y, z]) => [x, y, z, 0.0, 0.0, 0.0],
            InertiaSpec::Full(six) => six,
        };
        if given.mass < 0.0 {
            let remedy = "give zero (a massless link) or more, in kg";
            return Err(self.wrong(&format!("{of}: mass"), given.mass, remedy));
        }
        let [xx, yy, zz, xy, xz, yz] = six;
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let turn = at.rotation.to_rotation_matrix();
        Ok(Inertial {
            mass: given.mass,
            center: at.translation.vector,
            inertia: turn * inertia * turn.inverse(),
        })
    }

    /// Masses that volumes, densities and factors make have the bounds of those that are written.
    pub(super) fn check_masses(&self) -> Result<()> {
        for link in &self.file.robot.links {
            let (mass, i) = (link.inertial.mass.value, &link.inertial.inertia);
            let numbers = [mass, i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz];
            self.check(
                &format!("body {:?}", link.name),
                "mass and inertia",
                &numbers,
            )?;
        }
        Ok(())
    }

    /// Masses in the ratio that makes their sum what is asked for.
    pub(super) fn total_mass(&mut self) {
        let asked = self.model.compiler.set_total_mass;
        let links = &mut self.file.robot.links;
        let sum: f64 = links.iter().map(|l| l.inertial.mass.value).sum();
        if !(asked > 0.0 && sum > 0.0) {
            return;
        }
        let factor = asked / sum;
        for link in links {
            link.inertial.mass.value *= factor;
            let all = &mut link.inertial.inertia;
            for x in [
                &mut all.ixx,
                &mut all.iyy,
                &mut all.izz,
                &mut all.ixy,
                &mut all.ixz,
                &mut all.iyz,
            ] {
                *x *= factor;
            }
        }
    }
}
