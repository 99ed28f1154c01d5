//! Surfaces: bodies at a state with what is known of their faces, and walls.

use super::super::room::{Room, placed};
use super::file::array;
use super::placed::Placed;
use super::pressure;
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::geometry::WallSurface;
use crate::simulate::Rollout;
use nalgebra::DMatrix;
use vtkio::model::{Attribute, Attributes, DataSet, PolyDataPiece, VertexNumbers};

/// All bodies at state `n`; `velocities` are those of their origins and their angular ones ([`Rollout::velocities`]). With `pressed`, what the water does to their faces as well.
pub(super) fn bodies(
    rollout: &Rollout,
    room: &Room,
    velocities: &DMatrix<f64>,
    n: usize,
    pressed: bool,
) -> Result<DataSet> {
    let poses = &rollout.samples()[n].poses;
    let each = room.meshes.iter().zip(poses).enumerate();
    let each = each.map(|(body, (mesh, pose))| Placed {
        body,
        vertices: match mesh {
            Some(mesh) => placed(mesh, pose),
            None => vec![pose.translation],
        },
        faces: mesh.as_ref().map(|mesh| mesh.faces()),
    });
    // The format has points before triangles.
    let (points, surfaces): (Vec<_>, Vec<_>) = each.partition(|p| p.faces.is_none());
    let all = [points, surfaces].concat();
    // What is known of faces, body by body; one of a body without a shape.
    let mut fields = vec![velocity(rollout, velocities, &all, n)];
    if pressed {
        fields.extend(pressure::fields(rollout, &all, n)?);
    }

    let (mut points, mut corners, mut body) = (Vec::new(), Vec::new(), Vec::new());
    let mut before = 0;
    for placed in &all {
        let faces = placed.faces.unwrap_or_default();
        corners.extend(faces.iter().flatten().map(|i| (before + i) as u64));
        if placed.faces.is_none() {
            points.push(before as u64);
        }
        body.extend(std::iter::repeat_n(placed.body as i32, placed.count()));
        before += placed.vertices.len();
    }
    let mut data = Attributes::new();
    data.cell.push(array("body", 1, body));
    data.cell.extend(fields);
    let vertices = all.iter().flat_map(|p| &p.vertices);
    Ok(polygons(vertices, points, (corners, 3), data))
}

/// Velocities of the faces' centres, m/s, world axes.
fn velocity(rollout: &Rollout, velocities: &DMatrix<f64>, all: &[Placed], n: usize) -> Attribute {
    let of = |placed: &Placed| {
        let part = |first| {
            velocities
                .fixed_view::<3, 1>(6 * placed.body + first, n)
                .into_owned()
        };
        let (linear, angular): (Vec3, Vec3) = (part(0), part(3));
        let origin = rollout.samples()[n].poses[placed.body].translation;
        let faces = placed.centers().into_iter();
        faces.flat_map(move |center| {
            let u: Vec3 = linear + angular.cross(&(center - origin));
            [u.x, u.y, u.z]
        })
    };
    let values: Vec<f64> = all.iter().flat_map(of).collect();
    array("velocity", 3, values)
}

/// The walls; none where there are none.
pub(super) fn walls(rollout: &Rollout, room: &Room) -> Result<Option<DataSet>> {
    let squares = room.walls(rollout)?;
    if squares.is_empty() {
        return Ok(None);
    }
    let scene = rollout.simulator().scene();
    let free = scene.walls.iter().map(|w| w.surface == WallSurface::Free);
    let mut data = Attributes::new();
    let numbers: Vec<i32> = (0..squares.len() as i32).collect();
    data.cell.push(array("wall", 1, numbers));
    let free: Vec<u8> = free.map(u8::from).collect();
    data.cell.push(array("free", 1, free));
    let corners = (0..4 * squares.len() as u64).collect();
    let vertices = squares.iter().flatten();
    Ok(Some(polygons(vertices, Vec::new(), (corners, 4), data)))
}

/// Points, and polygons of so many corners each.
fn polygons<'a>(
    vertices: impl Iterator<Item = &'a Vec3>,
    points: Vec<u64>,
    (corners, each): (Vec<u64>, usize),
    data: Attributes,
) -> DataSet {
    let vertices: Vec<f64> = vertices.flat_map(|x| [x.x, x.y, x.z]).collect();
    let cells = |corners: Vec<u64>, each: usize| {
        let ends = (1..=corners.len() / each).map(|k| (k * each) as u64);
        // An element without cells is left out.
        (!corners.is_empty()).then(|| VertexNumbers::XML {
            offsets: ends.collect(),
            connectivity: corners,
        })
    };
    DataSet::inline(PolyDataPiece {
        points: vertices.into(),
        verts: cells(points, 1),
        polys: cells(corners, each),
        data,
        ..PolyDataPiece::default()
    })
}
