//! What acts on every body, at its origin.

use super::file::array;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::error::in_order;
use crate::simulate::{Loads, Rollout};
use rayon::prelude::*;
use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};

/// The wrench across a body's own joint, from what carries it.
const JOINT: &str = "joint";

/// One set of points a frame, each with the same arrays: kinds that don't act at a state are zero there, since readers drop arrays that come and go.
pub(super) fn frames(rollout: &Rollout, states: &[usize]) -> Result<Vec<DataSet>> {
    let loads: Vec<Loads> = in_order(states.par_iter().map(|n| rollout.loads(*n)))?;
    let mut kinds: Vec<&str> = Vec::new();
    for kind in loads.iter().flat_map(Loads::kinds) {
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    let frame = |(n, loads): (&usize, &Loads)| {
        let poses = &rollout.samples()[*n].poses;
        let points = poses.iter().map(|p| p.translation);
        let points: Vec<f64> = points.flat_map(|x| [x.x, x.y, x.z]).collect();
        let count = poses.len();
        let mut data = Attributes::new();
        let body: Vec<i32> = (0..count as i32).collect();
        data.point.push(array("body", 1, body));
        let zero = vec![Vec6::zeros(); count];
        let acting = kinds.iter().map(|kind| {
            let wrenches = loads.wrenches(kind).unwrap_or(&zero);
            (*kind, wrenches)
        });
        for (kind, wrenches) in acting.chain([(JOINT, loads.joints())]) {
            let name = kind.replace(' ', "_");
            for (what, first) in [("force", 0), ("moment", 3)] {
                let part = wrenches
                    .iter()
                    .flat_map(|w| w.fixed_rows::<3>(first).into_owned().data.0[0]);
                let part: Vec<f64> = part.collect();
                data.point.push(array(&format!("{name}_{what}"), 3, part));
            }
        }
        let numbers: Vec<u64> = (0..count as u64).collect();
        DataSet::inline(PolyDataPiece {
            points: points.into(),
            verts: Some(VertexNumbers::XML {
                offsets: numbers.iter().map(|k| k + 1).collect(),
                connectivity: numbers,
            }),
            data,
            ..PolyDataPiece::default()
        })
    };
    Ok(states.iter().zip(&loads).map(frame).collect())
}
