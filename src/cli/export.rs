//! `hydrograd run --vtk --gltf`: a run as files of other programs.

use clap::{ArgGroup, Args};
use std::path::{Path, PathBuf};

use super::options::{length, rate};
use crate::output::{Frames, gltf, vtk};
use crate::scene::Scene;
use crate::simulate::{Recording, Rollout, StreamlineSettings};
use crate::{Error, Result};

#[derive(Clone, Debug, Args)]
#[command(group(ArgGroup::new("animated").args(["vtk", "gltf"]).multiple(true)))]
pub(super) struct Export {
    /// Folder for files of VTK, which ParaView opens: bodies.pvd with velocities of all faces, walls.vtp [default: none are written]. They hold the steps
    /// made now, as does --gltf.
    #[arg(long, value_name = "DIR")]
    vtk: Option<PathBuf>,
    /// Write loads.pvd into the folder of --vtk as well: forces and moments on every body, kind by kind. Takes a solve a frame.
    #[arg(long, requires = "vtk")]
    vtk_loads: bool,
    /// Have the water's pressure and velocity on every face in the files of bodies.pvd as well. Takes solves of its own a frame.
    #[arg(long, requires = "vtk")]
    vtk_pressure: bool,
    /// Write streamlines.pvd into the folder of --vtk as well: lines along the water's velocity through this point, m; give it once for each line. Takes a solve a frame.
    #[arg(long, value_name = "X,Y,Z", requires = "vtk", value_parser = point, allow_hyphen_values = true)]
    vtk_seed: Vec<[f64; 3]>,
    /// Length of these lines each way at most, m.
    #[arg(
        long,
        value_name = "M",
        value_parser = length,
        requires = "vtk_seed",
        default_value = "1",
        allow_negative_numbers = true
    )]
    vtk_line_length: f64,
    /// File of an animated scene in glTF 2.0, which Blender and browsers open [default: none is written].
    #[arg(long, value_name = "FILE.glb")]
    gltf: Option<PathBuf>,
    /// Frames in a second of simulated time, at most, of --vtk and --gltf.
    #[arg(long, value_name = "N", value_parser = rate, requires = "animated", default_value = "30", allow_negative_numbers = true)]
    frames_per_second: f64,
}

impl Export {
    /// Tries to write where files are to be, and refuses what a scene can't have in them, so that a long run isn't lost to a wrong path or wish.
    pub fn prepare(&self, scene: &Scene) -> Result<()> {
        if self.vtk_pressure && scene.fluid.density == 0.0 {
            return Err(Error::input(
                "--vtk-pressure: fluid.density",
                scene.fluid.density,
                "must be above zero: without water there is no pressure",
            ));
        }
        if let Some(folder) = &self.vtk {
            Recording::prepare(folder)?;
        }
        if let Some(file) = &self.gltf {
            gltf::prepare(file)?;
        }
        Ok(())
    }

    /// Writes what was asked for: gives the files to open, and why others couldn't be written.
    pub fn write(&self, rollout: &Rollout) -> (Vec<PathBuf>, Vec<Error>) {
        let (mut files, mut lost) = (Vec::new(), Vec::new());
        if let Some(folder) = &self.vtk {
            match self.write_vtk(rollout, folder) {
                Ok(written) => files.extend(written),
                Err(error) => lost.push(error),
            }
        }
        if let Some(file) = &self.gltf {
            let options = gltf::Options {
                frames: self.frames(),
                ..gltf::Options::default()
            };
            match gltf::write(rollout, file, &options) {
                Ok(()) => files.push(file.clone()),
                Err(error) => lost.push(error),
            }
        }
        (files, lost)
    }

    fn write_vtk(&self, rollout: &Rollout, folder: &Path) -> Result<Vec<PathBuf>> {
        let options = vtk::Options {
            frames: self.frames(),
            loads: self.vtk_loads,
            pressure: self.vtk_pressure,
            flow: None,
            streamlines: (!self.vtk_seed.is_empty()).then(|| vtk::Streamlines {
                seeds: self.vtk_seed.clone(),
                settings: StreamlineSettings::new(self.vtk_line_length),
            }),
        };
        vtk::write(rollout, folder, &options)
    }

    fn frames(&self) -> Frames {
        Frames::PerSecond(self.frames_per_second)
    }
}

/// A point from its coordinates.
fn point(text: &str) -> std::result::Result<[f64; 3], String> {
    let numbers: Vec<f64> = (text.split(','))
        .map(|x| x.trim().parse().map_err(|e| format!("{x:?}: {e}")))
        .collect::<std::result::Result<_, String>>()?;
    let count = numbers.len();
    let found = <[f64; 3]>::try_from(numbers);
    let found = found.map_err(|_| format!("{count} numbers: give three, X,Y,Z in m"))?;
    match found.iter().all(|x| x.is_finite()) {
        true => Ok(found),
        false => Err("coordinates must be finite".into()),
    }
}
