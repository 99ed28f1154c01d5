//! Recordings of a folder: `runs/NAME.csv`, as docs/tank.md describes.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Time between samples, s.
pub const STEP: f64 = 0.02;
pub const JOINTS: [&str; 4] = ["joint5", "joint4", "joint3", "joint2"];
const COLUMNS: [&str; 16] = [
    "t",
    "x",
    "y",
    "z",
    "yaw",
    "mocap_ok",
    "imu_roll",
    "imu_pitch",
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "joint5",
    "joint4",
    "joint3",
    "joint2",
    "free",
];
/// Columns that are empty where motion capture lost the vehicle.
const MAY_LACK: [&str; 4] = ["x", "y", "z", "yaw"];

/// A run, from its first free sample to its last.
pub struct Recording {
    pub name: String,
    columns: BTreeMap<&'static str, Vec<f64>>,
    pub free: Vec<bool>,
}

impl Recording {
    pub fn steps(&self) -> usize {
        self.free.len() - 1
    }

    pub fn column(&self, name: &str) -> &[f64] {
        &self.columns[name]
    }

    /// Roll and pitch (rad) or rates about the vehicle's x and y (rad/s), as the observables of these names.
    pub fn seen(&self, observable: &str, k: usize) -> &[f64] {
        match observable {
            "attitudes" => self.column(["imu_roll", "imu_pitch"][k]),
            _ => self.column(["gyro_x", "gyro_y"][k]),
        }
    }

    /// Means of attitude and rates over 0.2 s, and velocity (m/s) by a line over 1 s, turned by the heading.
    pub fn start(&self) -> ([f64; 2], [f64; 3], [f64; 3]) {
        let mean = |name: &str| self.column(name).iter().take(10).sum::<f64>() / 10.0;
        let seen = |n: &usize| {
            let placed = MAY_LACK
                .iter()
                .all(|name| self.column(name)[*n].is_finite());
            placed && self.column("mocap_ok")[*n] > 0.5
        };
        let seen: Vec<usize> = (0..51.min(self.free.len())).filter(seen).collect();
        let mut velocity = [0.0; 3];
        if seen.len() > 10 {
            let slope = |name: &str| slope(&seen, self.column("t"), self.column(name));
            let (s, c) = self.column("yaw")[seen[0]].sin_cos();
            let [x, y, z] = ["x", "y", "z"].map(slope);
            velocity = [x * c + y * s, y * c - x * s, z];
        }
        (
            ["imu_roll", "imu_pitch"].map(mean),
            ["gyro_x", "gyro_y", "gyro_z"].map(mean),
            velocity,
        )
    }
}

/// Of a line by least squares.
fn slope(at: &[usize], t: &[f64], x: &[f64]) -> f64 {
    let n = at.len() as f64;
    let mean = |of: &[f64]| at.iter().map(|i| of[*i]).sum::<f64>() / n;
    let (t0, x0) = (mean(t), mean(x));
    let both: f64 = at.iter().map(|i| (t[*i] - t0) * (x[*i] - x0)).sum();
    both / at.iter().map(|i| (t[*i] - t0).powi(2)).sum::<f64>()
}

fn read(path: &Path) -> Result<Recording, Box<dyn Error>> {
    let shown = path.display();
    let mut reader = csv::Reader::from_path(path).map_err(|e| format!("{shown}: {e}"))?;
    let header = reader
        .headers()
        .map_err(|e| format!("{shown}: {e}"))?
        .clone();
    let mut columns: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let mut places = Vec::new();
    for name in COLUMNS {
        let place = header.iter().position(|h| h == name);
        places.push((
            name,
            place.ok_or(format!("{shown}: column {name:?} is missing"))?,
        ));
    }
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(|e| format!("{shown}: {e}"))?;
        for (name, place) in &places {
            let text = record.get(*place).unwrap_or("");
            let value: f64 = match text {
                "" if MAY_LACK.contains(name) => f64::NAN,
                text => (text.parse().ok())
                    .filter(|x: &f64| x.is_finite())
                    .ok_or(format!(
                        "{shown}: column {name:?}, line {}: {text:?} isn't a finite number",
                        i + 2
                    ))?,
            };
            columns.entry(name).or_default().push(value);
        }
    }
    let t = columns.get("t").map_or(&[][..], Vec::as_slice);
    if let Some(i) = (1..t.len()).find(|i| (t[*i] - t[i - 1] - STEP).abs() > 1e-3) {
        return Err(format!(
            "{shown}: column \"t\", line {}: samples {STEP} s apart are wanted",
            i + 2
        )
        .into());
    }
    let late = |i: &usize| (t[*i] - t[0] - STEP * *i as f64).abs() > 0.5 * STEP;
    if let Some(i) = (0..t.len()).find(late) {
        return Err(format!("{shown}: column \"t\", line {}: half a sample off", i + 2).into());
    }
    for name in ["imu_roll", "imu_pitch"] {
        let of = columns.get(name).map_or(&[][..], Vec::as_slice);
        if let Some(i) = of.iter().position(|x| x.abs() > std::f64::consts::PI) {
            return Err(format!(
                "{shown}: column {name:?}, line {}: {} isn't an angle in rad",
                i + 2,
                of[i]
            )
            .into());
        }
    }
    let free: Vec<bool> = columns
        .get("free")
        .map_or(Vec::new(), |c| c.iter().map(|x| *x > 0.5).collect());
    let (first, last) = (free.iter().position(|f| *f), free.iter().rposition(|f| *f));
    let count = free.iter().filter(|f| **f).count();
    let (Some(first), Some(last), true) = (first, last, count >= 100) else {
        return Err(format!(
            "{shown}: column \"free\": {count} samples float freely; 100 at least are wanted"
        )
        .into());
    };
    columns
        .values_mut()
        .for_each(|c| *c = c[first..=last].to_vec());
    Ok(Recording {
        name: path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        columns,
        free: free[first..=last].to_vec(),
    })
}

/// The recordings of a folder, and its URDF.
pub fn folder(path: &Path) -> Result<(Vec<Recording>, PathBuf), Box<dyn Error>> {
    let runs = path.join("runs");
    let listed = std::fs::read_dir(&runs).map_err(|e| format!("{}: {e}", runs.display()))?;
    let mut files: Vec<PathBuf> = listed.filter_map(|f| Some(f.ok()?.path())).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "csv"));
    files.sort();
    if files.is_empty() {
        return Err(format!("{}: no recordings (*.csv)", runs.display()).into());
    }
    let urdf = path.join("blue_rov_hardware_fixedjaw.urdf");
    if !urdf.is_file() {
        return Err(format!("{}: no such file", urdf.display()).into());
    }
    let runs = files.iter().map(|f| read(f)).collect::<Result<_, _>>()?;
    Ok((runs, urdf))
}
