//! How much of one body lies inside another.

use super::super::mesh::TriMesh;
use super::surface::Surface;
use crate::error::Result;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Points at which each cone from a body's centroid to a face is asked, in shells of equal volume.
const SHELLS: usize = 3;

/// The part of one body's volume that lies inside another body.
#[derive(Clone, Debug)]
pub struct Share {
    inner: usize,
    outer: usize,
    surface: Surface,
    /// Points of the inner body, in its frame, with their parts of its volume: cones from the
    /// centroid to the faces, negative where the body isn't seen from there.
    samples: Vec<(Vec3, f64)>,
}

impl Share {
    /// The part of the smaller one of two bodies inside the larger, by volume; none if one of them
    /// has no surface. `meshes` in body frames.
    ///
    /// # Errors
    /// [`crate::Error::Mesh`] if a mesh has no faces or a vertex that isn't finite.
    pub fn new(
        meshes: &[Option<&TriMesh>],
        (first, second): (usize, usize),
    ) -> Result<Option<Self>> {
        let mesh = |i: usize| meshes.get(i).copied().flatten();
        let (Some(a), Some(b)) = (mesh(first), mesh(second)) else {
            return Ok(None);
        };
        let volume = |m: &TriMesh| m.mass_properties().volume;
        let (inner, outer, small, large) = if volume(a) < volume(b) {
            (first, second, a, b)
        } else {
            (second, first, b, a)
        };
        let mass = small.mass_properties();
        let apex = mass.centroid;
        let cones = (0..small.faces().len()).flat_map(|f| {
            let [a, b, c] = small.corners(f).map(|x| x - apex);
            let part = a.dot(&b.cross(&c)) / 6.0 / mass.volume / SHELLS as f64;
            let center = (a + b + c) / 3.0;
            (0..SHELLS).map(move |s| {
                let out = ((s as f64 + 0.5) / SHELLS as f64).cbrt();
                (apex + center * out, part)
            })
        });
        Ok(Some(Self {
            inner,
            outer,
            surface: Surface::new(large)?,
            samples: cones.collect(),
        }))
    }

    /// Numbers of the smaller body and of the one that it is in.
    pub fn bodies(&self) -> (usize, usize) {
        (self.inner, self.outer)
    }

    /// The part at these poses, one per mesh: 0 apart, 1 with the smaller body all inside. To some
    /// hundredths for a hundred faces.
    pub fn at(&self, poses: &[Pose]) -> f64 {
        let (inner, outer) = (&poses[self.inner], &poses[self.outer]);
        let inside = |x: &Vec3| {
            let there = outer.apply_inverse(&inner.apply(x));
            self.surface.depth_above(&there, 0.0).is_some()
        };
        let parts = self.samples.iter().filter(|(x, _)| inside(x));
        parts.map(|(_, part)| part).sum::<f64>() + 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;
    use hydrograd_adjoint::lie::exp_matrix;

    fn mesh(shape: Shape, faces: usize) -> TriMesh {
        crate::shape::build(&shape, std::path::Path::new(""), Some(faces)).unwrap()
    }

    fn share(a: &TriMesh, b: &TriMesh, shift: [f64; 3]) -> f64 {
        let turn = exp_matrix(&Vec3::new(0.3, -0.2, 0.5));
        let first = Pose::new(turn, Vec3::new(1.0, 2.0, 3.0));
        let poses = [
            first,
            Pose::new(turn, first.translation + turn * Vec3::from(shift)),
        ];
        let either = Share::new(&[Some(a), Some(b)], (0, 1)).unwrap().unwrap();
        either.at(&poses)
    }

    #[test]
    fn the_lens_of_two_balls() {
        for (faces, within) in [(80, 0.06), (320, 0.03), (1280, 0.02)] {
            let ball = mesh(Shape::sphere(0.5), faces);
            for d in [0.1, 0.3, 0.5, 0.8] {
                let x: f64 = d / 0.5;
                let exact = 1.0 - 0.75 * x + x.powi(3) / 16.0;
                let found = share(&ball, &ball, [0.0, d * 0.6, d * 0.8]);
                println!("{faces} {d}: {found:.4} of {exact:.4}");
                assert!(
                    (found - exact).abs() < within,
                    "{faces} {d}: {found} {exact}"
                );
            }
            assert_eq!(share(&ball, &ball, [1.01, 0.0, 0.0]), 0.0);
        }
    }

    #[test]
    fn the_smaller_one_counts_in_either_order() {
        let (plate, peg) = (
            mesh(Shape::cuboid([1.0, 1.0, 0.2]), 300),
            mesh(Shape::cylinder(0.1, 0.8), 300),
        );
        // A quarter of the peg's length is in the plate.
        for (a, b) in [(&plate, &peg), (&peg, &plate)] {
            let found = share(a, b, [0.1, 0.2, 0.05]);
            assert!((found - 0.25).abs() < 0.03, "{found}");
        }
        let small = mesh(Shape::sphere(0.05), 80);
        assert!((share(&small, &plate, [0.0; 3]) - 1.0).abs() < 1e-12);
        assert!(Share::new(&[Some(&plate), None], (0, 1)).unwrap().is_none());
    }
}
