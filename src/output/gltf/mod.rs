//! A run as an animated scene in one file of glTF 2.0 (`.glb`), for Blender, browsers and game engines.
//!
//! A node each body, called as it is, with its mesh; an animation that moves them, linear between the frames; walls as squares. Lengths are metres and times seconds, counted from the
//! first state written. y points up in glTF: the node `hydrograd` above all others turns z there, and what is below it has the axes of the simulation.

mod buffer;
mod color;

pub use color::PALETTE;

use super::frames::Frames;
use super::room::Room;
use crate::adjoint::lie::Vec3;
use crate::geometry::{TriMesh, Wall, WallSurface};
use crate::simulate::{Recording, Rollout, replace};
use crate::{Error, Result};
use buffer::Buffer;
use gltf::json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Index, Material, Mesh, Node, Root, Scene};
use nalgebra::Rotation3;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f32::consts::FRAC_1_SQRT_2;
use std::io;
use std::path::Path;

/// What is written of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The states.
    pub frames: Frames,
    /// Colours of bodies by their names, "#rrggbb"; others take the next of [`PALETTE`].
    pub colors: BTreeMap<String, String>,
}

/// Writes a run into a file, and makes the folder that it is to stand in. A file that stood there is replaced.
///
/// # Errors
/// Frames that select nothing ([`Frames::check`]) or follow each other faster than single precision tells apart; colours of bodies that there aren't, or that aren't "#rrggbb";
/// positions beyond single precision; more than 4 GB; a name that doesn't end in .glb, a folder or a file that can't be written, by its path.
pub fn write(rollout: &Rollout, path: &Path, options: &Options) -> Result<()> {
    let states = options.frames.states(rollout)?;
    let names = rollout.simulator().names();
    let colors = color::of_bodies(&names, &options.colors)?;
    prepare(path)?;
    let room = Room::of(rollout, &states)?;
    let mut file = File::default();
    let bodies = file.bodies(&names, &colors, &room.meshes)?;
    let animation = file.animation(rollout, &states, &names, &bodies)?;
    file.root.push(animation);
    let mut children = bodies;
    children.extend(file.walls(rollout, &room)?);
    file.write(path, children)
}

/// Makes the folder of a file and tries to write there, so that a long run isn't lost to a wrong path.
///
/// # Errors
/// A path without a name, that of a folder, a name that doesn't end in .glb, and a folder that can't be made or written to.
pub fn prepare(path: &Path) -> Result<()> {
    if path.file_name().is_none() || path.is_dir() {
        return Err(Error::File {
            path: path.to_owned(),
            action: "write",
            source: io::Error::new(
                io::ErrorKind::IsADirectory,
                "it must be a file, not a folder",
            ),
        });
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    if !extension.eq_ignore_ascii_case("glb") {
        return Err(Error::input(
            path.display().to_string(),
            format!("extension {extension:?}"),
            "animated scenes are written as .glb",
        ));
    }
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => Recording::prepare(folder),
        _ => Recording::prepare(Path::new(".")),
    }
}

/// A file as it grows.
#[derive(Default)]
struct File {
    root: Root,
    buffer: Buffer,
}

impl File {
    /// A node each body.
    fn bodies(
        &mut self,
        names: &[String],
        colors: &[[f32; 3]],
        meshes: &[Option<TriMesh>],
    ) -> Result<Vec<Index<Node>>> {
        let each = names.iter().zip(colors).zip(meshes);
        let node = |((name, color), mesh): ((&String, &[f32; 3]), &Option<TriMesh>)| {
            let mesh = mesh.as_ref().map(|mesh| {
                let material = color::material(name, *color, 1.0);
                self.mesh(name, mesh.vertices(), mesh.faces(), material)
            });
            let mesh = mesh.transpose()?;
            Ok(self.root.push(Node {
                mesh,
                name: Some(name.clone()),
                ..Node::default()
            }))
        };
        each.map(node).collect()
    }

    /// A node each wall.
    fn walls(&mut self, rollout: &Rollout, room: &Room) -> Result<Vec<Index<Node>>> {
        let squares = room.walls(rollout)?;
        let walls = rollout.simulator().scene().walls.iter();
        let node = |(k, (square, wall)): (usize, (&[Vec3; 4], &Wall))| {
            let name = format!("wall {k}");
            let color = match wall.surface {
                WallSurface::Rigid => color::RIGID,
                WallSurface::Free => color::FREE,
            };
            let material = color::material(&name, color, color::WALL_OPACITY);
            let mesh = self.mesh(&name, square, &[[0, 1, 2], [0, 2, 3]], material)?;
            Ok(self.root.push(Node {
                mesh: Some(mesh),
                name: Some(name),
                ..Node::default()
            }))
        };
        squares.iter().zip(walls).enumerate().map(node).collect()
    }

    /// A surface without normals: it is shaded face by face, as it is computed with.
    fn mesh(
        &mut self,
        name: &str,
        vertices: &[Vec3],
        faces: &[[usize; 3]],
        material: Material,
    ) -> Result<Index<Mesh>> {
        let place = format!("gltf: vertices of {name:?}");
        let points = vertices.iter().map(|x| single(&place, x));
        let points = points.collect::<Result<Vec<_>>>()?;
        let points = self.buffer.vertices(&mut self.root, &points);
        let corners = faces.iter().flatten().map(|i| *i as u32);
        let corners = self.buffer.corners(&mut self.root, corners.collect());
        let material = self.root.push(material);
        Ok(self.root.push(Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(name.into()),
            primitives: vec![Primitive {
                attributes: BTreeMap::from([(Valid(Semantic::Positions), points)]),
                extensions: None,
                extras: Default::default(),
                indices: Some(corners),
                material: Some(material),
                mode: Valid(Mode::Triangles),
                targets: None,
            }],
            weights: None,
        }))
    }

    /// Translations and rotations of all bodies; their nodes stand where they are first.
    fn animation(
        &mut self,
        rollout: &Rollout,
        states: &[usize],
        names: &[String],
        bodies: &[Index<Node>],
    ) -> Result<Animation> {
        let times = times(rollout, states)?;
        let input = self.buffer.numbers(&mut self.root, &times);
        let mut samplers = Vec::new();
        let mut channels = Vec::new();
        for (body, node) in bodies.iter().enumerate() {
            let poses = states.iter().map(|n| &rollout.samples()[*n].poses[body]);
            let place = format!("gltf: position of {:?}", names[body]);
            let moved = poses.clone().map(|p| single(&place, &p.translation));
            let moved = moved.collect::<Result<Vec<_>>>()?;
            let mut turned: Vec<[f32; 4]> = Vec::with_capacity(states.len());
            for pose in poses {
                let q = quaternion(&pose.rotation);
                // q and −q are one rotation: the nearer one is reached the shorter way round.
                let ahead = turned.last().is_none_or(|before| {
                    let dot: f32 = before.iter().zip(&q).map(|(a, b)| a * b).sum();
                    dot >= 0.0
                });
                turned.push(if ahead { q } else { q.map(|x| -x) });
            }
            let at = &mut self.root.nodes[node.value()];
            at.translation = moved.first().copied();
            at.rotation = turned.first().copied().map(UnitQuaternion);
            let outputs = [
                (
                    Property::Translation,
                    self.buffer.vectors(&mut self.root, &moved),
                ),
                (
                    Property::Rotation,
                    self.buffer.quaternions(&mut self.root, &turned),
                ),
            ];
            for (path, output) in outputs {
                samplers.push(Sampler {
                    extensions: None,
                    extras: Default::default(),
                    input,
                    interpolation: Valid(Interpolation::Linear),
                    output,
                });
                channels.push(Channel {
                    sampler: Index::new(samplers.len() as u32 - 1),
                    target: Target {
                        extensions: None,
                        extras: Default::default(),
                        node: *node,
                        path: Valid(path),
                    },
                    extensions: None,
                    extras: Default::default(),
                });
            }
        }
        Ok(Animation {
            extensions: None,
            extras: Default::default(),
            channels,
            name: Some(rollout.simulator().scene().name.clone()).filter(|n| !n.is_empty()),
            samplers,
        })
    }

    /// Writes it with a node above `children` that turns z up.
    fn write(mut self, path: &Path, children: Vec<Index<Node>>) -> Result<()> {
        let top = self.root.push(Node {
            children: Some(children),
            name: Some("hydrograd".into()),
            rotation: Some(UnitQuaternion([-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])),
            ..Node::default()
        });
        let scene = self.root.push(Scene {
            extensions: None,
            extras: Default::default(),
            name: None,
            nodes: vec![top],
        });
        self.root.scene = Some(scene);
        self.root.asset.generator = Some(concat!("hydrograd ", env!("CARGO_PKG_VERSION")).into());
        let bytes = self.buffer.finish(&mut self.root);
        let failed = |source| Error::File {
            path: path.to_owned(),
            action: "write",
            source,
        };
        let json = self
            .root
            .to_vec()
            .map_err(|e| failed(io::Error::other(e)))?;
        let size = bytes.len() + json.len();
        // Lengths are numbers of 32 bits; headers and padding are less than this.
        if size > u32::MAX as usize - 64 {
            return Err(Error::Unsupported {
                what: format!("a glTF file of {size} bytes"),
                why: "the format ends at 4 GB".into(),
                instead: "write fewer frames a second".into(),
            });
        }
        let glb = gltf::binary::Glb {
            header: gltf::binary::Header {
                magic: *b"glTF",
                version: 2,
                length: 0,
            },
            json: Cow::Owned(json),
            bin: Some(Cow::Owned(bytes)),
        };
        replace(path, |out| glb.to_writer(out).map_err(io::Error::other))
    }
}

/// Times of the states from the first on, s.
fn times(rollout: &Rollout, states: &[usize]) -> Result<Vec<f32>> {
    let samples = rollout.samples();
    let from = samples[states[0]].time;
    let times = states.iter().map(|n| (samples[*n].time - from) as f32);
    let times: Vec<f32> = times.collect();
    match times.windows(2).find(|t| t[0] >= t[1]) {
        None => Ok(times),
        Some(t) => Err(Error::input(
            "gltf: frames",
            format!("two at {} s", t[0]),
            "single precision, which the format has, doesn't tell their times apart: write fewer frames a second",
        )),
    }
}

/// A vector in single precision.
fn single(place: &str, x: &Vec3) -> Result<[f32; 3]> {
    let out = [x.x as f32, x.y as f32, x.z as f32];
    match out.iter().all(|x| x.is_finite()) {
        true => Ok(out),
        false => Err(Error::input(
            place,
            format!("{:?}", x.as_slice()),
            "must lie within the range of single precision, which the format has",
        )),
    }
}

/// x, y, z, w.
fn quaternion(rotation: &nalgebra::Matrix3<f64>) -> [f32; 4] {
    let rotation = Rotation3::from_matrix_unchecked(*rotation);
    let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    let q = nalgebra::UnitQuaternion::new_normalize(q.into_inner());
    [q.i as f32, q.j as f32, q.k as f32, q.w as f32]
}
