//! A trajectory as CSV and as JSON.

use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Rollout;
use crate::scene::Scene;
use crate::{Error, Result};

/// What is written of a run: one row for the start and one after each step. SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Recording {
    /// Name of the scene.
    pub scene: String,
    /// Time step, s.
    pub dt: f64,
    /// Names of the entries of q.
    pub coordinates: Vec<String>,
    /// Names of the entries of v.
    pub velocities: Vec<String>,
    /// Time, s.
    pub time: Vec<f64>,
    /// Joint coordinates, one row a time.
    pub q: Vec<Vec<f64>>,
    /// Generalised velocities, one row a time.
    pub v: Vec<Vec<f64>>,
    /// Kinetic energy of bodies and water, and potential energy, J.
    pub energy: Vec<f64>,
    /// Momentum of bodies and water: linear (kg m/s), then angular about the world's origin.
    pub momentum: Vec<[f64; 6]>,
    /// Smallest gap between bodies or to a wall, m; `None` where there is nothing to meet.
    pub min_gap: Vec<Option<f64>>,
}

impl Recording {
    /// Names of the columns of the momentum.
    pub const MOMENTA: [&str; 6] = [
        "momentum_x",
        "momentum_y",
        "momentum_z",
        "angular_momentum_x",
        "angular_momentum_y",
        "angular_momentum_z",
    ];

    /// Every state of a rollout of a scene.
    pub fn of(scene: &Scene, rollout: &Rollout) -> Self {
        let samples = rollout.samples();
        Self {
            scene: scene.name.clone(),
            dt: rollout.simulator().time_step(),
            coordinates: scene.coordinate_labels(),
            velocities: scene.velocity_labels(),
            time: samples.iter().map(|s| s.time).collect(),
            q: samples.iter().map(|s| s.q.as_slice().to_vec()).collect(),
            v: samples.iter().map(|s| s.v.as_slice().to_vec()).collect(),
            energy: samples.iter().map(|s| s.energy()).collect(),
            momentum: samples.iter().map(|s| s.momentum.into()).collect(),
            min_gap: rollout
                .gaps()
                .iter()
                .map(|g| g.map(|g| g.distance))
                .collect(),
        }
    }

    /// Writes `trajectory.csv` and `trajectory.json` into a folder; a file that stood there before
    /// is replaced only once the new one is complete.
    ///
    /// # Errors
    /// A folder or file that can't be written.
    pub fn write(&self, folder: &Path) -> Result<[PathBuf; 2]> {
        Self::prepare(folder)?;
        let csv = folder.join("trajectory.csv");
        let json = folder.join("trajectory.json");
        replace(&csv, |file| self.write_csv(file))?;
        replace(&json, |file| {
            serde_json::to_writer(&mut *file, self)?;
            writeln!(file)
        })?;
        Ok([csv, json])
    }

    /// Makes the folder and tries to write there, so that a long run isn't lost to a wrong path.
    ///
    /// # Errors
    /// A folder that can't be made or written to.
    pub fn prepare(folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        let probe = temporary(&folder.join("probe"));
        let made = OpenOptions::new().write(true).create_new(true).open(&probe);
        made.map_err(|e| failed(folder, e))?;
        fs::remove_file(&probe).map_err(|e| failed(folder, e))
    }

    fn write_csv(&self, file: &mut impl Write) -> io::Result<()> {
        let mut line = String::from("time");
        let q = self.coordinates.iter().map(String::as_str);
        let v = self.velocities.iter().map(String::as_str);
        for name in q
            .chain(v)
            .chain(["energy"])
            .chain(Self::MOMENTA)
            .chain(["min_gap"])
        {
            line.push(',');
            line.push_str(&cell(name));
        }
        writeln!(file, "{line}")?;
        for (k, time) in self.time.iter().enumerate() {
            line.clear();
            // Debug digits read back to the same bits, with an exponent where it is shorter.
            let _ = write!(line, "{time:?}");
            let numbers = self.q[k].iter().chain(&self.v[k]);
            let numbers = numbers.chain([&self.energy[k]]).chain(&self.momentum[k]);
            for x in numbers {
                let _ = write!(line, ",{x:?}");
            }
            line.push(',');
            if let Some(gap) = self.min_gap[k] {
                let _ = write!(line, "{gap:?}");
            }
            writeln!(file, "{line}")?;
        }
        Ok(())
    }
}

/// Writes beside the file and renames, so that the file is never seen half written.
fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    let beside = temporary(path);
    let attempt = || {
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&beside)?;
        let mut file = BufWriter::new(file);
        write(&mut file)?;
        file.flush()?;
        file.get_ref().sync_all()?;
        fs::rename(&beside, path)
    };
    attempt().map_err(|source| {
        let _ = fs::remove_file(&beside);
        failed(path, source)
    })
}

fn temporary(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let id = std::process::id();
    path.with_file_name(format!(".{name}.{id}.part"))
}

fn failed(path: &Path, source: io::Error) -> Error {
    Error::File {
        path: path.to_owned(),
        action: "write",
        source,
    }
}

/// A CSV cell, quoted if it must be.
fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Recording {
        Recording {
            scene: "two".into(),
            dt: 0.1,
            coordinates: vec!["a, b.position".into()],
            velocities: vec!["a, b.rate".into()],
            time: vec![0.0, 0.1],
            q: vec![vec![1.0 / 3.0], vec![1e-300]],
            v: vec![vec![-0.0], vec![2.0]],
            energy: vec![1.0, 1.0],
            momentum: vec![[0.0; 6]; 2],
            min_gap: vec![None, Some(0.25)],
        }
    }

    #[test]
    fn both_files_hold_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/deep");
        let trajectory = example();
        for _ in 0..2 {
            let [csv, json] = trajectory.write(&out).unwrap();
            let text = fs::read_to_string(csv).unwrap();
            let rows: Vec<&str> = text.lines().collect();
            assert_eq!(rows.len(), 3);
            assert!(rows[0].starts_with("time,\"a, b.position\",\"a, b.rate\",energy,"));
            let first: Vec<&str> = rows[1].split(',').collect();
            assert_eq!(first.len(), 11);
            assert_eq!(first[1].parse::<f64>().unwrap(), 1.0 / 3.0);
            assert!(
                rows[1].ends_with(','),
                "no gap is an empty cell: {}",
                rows[1]
            );
            assert!(rows[2].ends_with(",0.25"));

            let text = fs::read_to_string(json).unwrap();
            let value: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(value["q"][0][0].as_f64(), Some(1.0 / 3.0));
            assert!(value["min_gap"][0].is_null());
        }
        let left = fs::read_dir(&out).unwrap().count();
        assert_eq!(left, 2, "no temporary files stay behind");
    }

    #[test]
    fn folder_that_is_a_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("taken");
        fs::write(&file, "x").unwrap();
        let message = example().write(&file).unwrap_err().to_string();
        assert!(message.contains("taken: write failed"), "{message}");
        assert_eq!(fs::read_to_string(&file).unwrap(), "x");
    }
}
