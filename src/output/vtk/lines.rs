//! Lines along the water's velocity.

use super::file::array;
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::simulate::{Rollout, StreamlineSettings};
use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};

/// Streamlines in every frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamlines {
    /// Where lines go through, m, world frame; at states where the flow isn't known there ([`Rollout::flow_resolved`]) a line is left out.
    pub seeds: Vec<[f64; 3]>,
    /// How they are drawn.
    pub settings: StreamlineSettings,
}

/// The lines at state `n`, with the velocity at each of their points, and the number of the seed of each.
pub(super) fn frame(rollout: &Rollout, drawn: &Streamlines, n: usize) -> Result<DataSet> {
    let seeds: Vec<Vec3> = drawn.seeds.iter().map(|x| Vec3::from(*x)).collect();
    let known = rollout.flow_resolved(n, &seeds)?;
    // What isn't finite is refused below, by its place.
    let there =
        |(_, (x, known)): &(usize, (&Vec3, &bool))| **known || x.iter().any(|x| !x.is_finite());
    let (numbers, clear): (Vec<i32>, Vec<Vec3>) = (seeds.iter().zip(&known).enumerate())
        .filter(there)
        .map(|(k, (x, _))| (k as i32, *x))
        .unzip();
    let lines = match clear.is_empty() {
        true => Vec::new(),
        false => rollout.streamlines(n, &clear, &drawn.settings)?,
    };
    let all = |of: fn(&crate::simulate::Streamline) -> &[Vec3]| -> Vec<f64> {
        let vectors = lines.iter().flat_map(of);
        vectors.flat_map(|x| [x.x, x.y, x.z]).collect()
    };
    let mut points = all(|line| &line.points);
    let mut velocities = all(|line| &line.velocities);
    let connectivity = (0..points.len() as u64 / 3).collect();
    // The format's readers want a point: it is on no line.
    if points.is_empty() {
        points.extend(seeds.first().map_or([0.0; 3], |x| [x.x, x.y, x.z]));
        velocities.extend([f64::NAN; 3]);
    }
    let mut data = Attributes::new();
    data.point.push(array("velocity", 3, velocities));
    data.cell.push(array("seed", 1, numbers));
    let mut end = 0;
    let offsets = lines.iter().map(|line| {
        end += line.points.len() as u64;
        end
    });
    Ok(DataSet::inline(PolyDataPiece {
        lines: Some(VertexNumbers::XML {
            offsets: offsets.collect(),
            connectivity,
        }),
        points: points.into(),
        data,
        ..PolyDataPiece::default()
    }))
}
