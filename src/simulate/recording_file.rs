//! A recording as CSV and as JSON: written whole or not at all, and read again to be gone on with.

use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

use super::recording::CONTROLS;
use super::{Checkpoint, Recording};
use crate::{Error, Result};

impl Recording {
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
        for (name, _, _) in self.columns() {
            line.push(',');
            line.push_str(&cell(name));
        }
        writeln!(file, "{line}")?;
        for (k, time) in self.time.iter().enumerate() {
            line.clear();
            // Debug digits read back to the same bits, with an exponent where it is shorter.
            let _ = write!(line, "{time:?}");
            for (_, recorded, i) in self.columns() {
                line.push(',');
                let x = recorded.values[k][i];
                if !x.is_nan() {
                    let _ = write!(line, "{x:?}");
                }
            }
            writeln!(file, "{line}")?;
        }
        Ok(())
    }
}

impl Serialize for Recording {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("scene", &self.scene)?;
        map.serialize_entry("dt", &self.dt)?;
        for (key, name) in [
            ("coordinates", "q"),
            ("velocities", "v"),
            ("controls", CONTROLS),
        ] {
            let Some(o) = self.observables.iter().find(|o| o.name == name) else {
                continue;
            };
            // One of the observables has the name of these labels.
            match self.observables.iter().any(|o| o.name == key) {
                true => map.serialize_entry(&format!("{key}_labels"), &o.labels)?,
                false => map.serialize_entry(key, &o.labels)?,
            }
        }
        map.serialize_entry("time", &self.time)?;
        for o in &self.observables {
            match o.scalar {
                true => {
                    let numbers: Vec<f64> = o.values.iter().map(|row| row[0]).collect();
                    map.serialize_entry(o.name, &numbers)?;
                }
                false => map.serialize_entry(o.name, &o.values)?,
            }
        }
        if let Some(state) = &self.state {
            map.serialize_entry("state", state)?;
        }
        map.end()
    }
}

/// A `trajectory.json` as it was written, to be gone on with.
pub struct Earlier {
    path: PathBuf,
    values: Value,
    state: Checkpoint,
}

impl Earlier {
    /// Reads a file that [`Recording::write`] made.
    ///
    /// # Errors
    /// A file that can't be read or isn't such a one.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read(path).map_err(|source| Error::File {
            path: path.to_owned(),
            action: "read",
            source,
        })?;
        let parsed = serde_json::from_slice(&text).map_err(|e| e.to_string());
        let parsed = parsed.and_then(|mut values: Value| {
            let state = values.get_mut("state").map(Value::take);
            let state = state.ok_or("no state; give a trajectory.json of `hydrograd run --out`")?;
            Ok((
                serde_json::from_value(state).map_err(|e| e.to_string())?,
                values,
            ))
        });
        let (state, values) = parsed.map_err(|message| not_understood(path, message))?;
        Ok(Self {
            path: path.to_owned(),
            values,
            state,
        })
    }

    /// Where the run stands after its last row.
    pub fn state(&self) -> &Checkpoint {
        &self.state
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Puts its rows, but for the last, which is the first of `later`, before those.
    ///
    /// # Errors
    /// Rows that are of another recording.
    pub fn put_before(&self, later: &mut Recording) -> Result<()> {
        let time = rows(&self.values, "time", 1).ok_or("time");
        let all = time.and_then(|time| {
            let of = |o: &super::Recorded| {
                let found = rows(&self.values, o.name, o.labels.len());
                found.filter(|rows| rows.len() == time.len()).ok_or(o.name)
            };
            let observed = later.observables.iter().map(of);
            let observed: Vec<_> = observed.collect::<std::result::Result<_, _>>()?;
            Ok((time, observed))
        });
        let (time, observed) = all.map_err(|name: &str| {
            not_understood(
                &self.path,
                format!("rows of `{name}` are missing or of another length; give a trajectory.json of this scene, written by this version"),
            )
        })?;
        let before = time.len().saturating_sub(1);
        let time = time.into_iter().take(before).flatten();
        later.time.splice(0..0, time);
        for (o, rows) in later.observables.iter_mut().zip(observed) {
            o.values.splice(0..0, rows.into_iter().take(before));
        }
        Ok(())
    }
}

/// Rows of so many numbers, or numbers for rows of one; null where there is none.
fn rows(values: &Value, name: &str, width: usize) -> Option<Vec<Vec<f64>>> {
    let number = |x: &Value| match x {
        Value::Null => Some(f64::NAN),
        x => x.as_f64(),
    };
    let row = |x: &Value| match x.as_array() {
        Some(row) if row.len() == width => row.iter().map(number).collect(),
        Some(_) => None,
        None if width == 1 => Some(vec![number(x)?]),
        None => None,
    };
    values.get(name)?.as_array()?.iter().map(row).collect()
}

fn not_understood(path: &Path, message: String) -> Error {
    Error::Parse {
        path: path.to_owned(),
        message,
    }
}

/// Writes beside the file and renames, so that the file is never seen half written.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
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
    use super::super::Recorded;
    use super::*;

    fn example() -> Recording {
        let recorded = |name, label: &str, scalar, values: [Vec<f64>; 2]| Recorded {
            name,
            labels: vec![label.into()],
            scalar,
            values: values.into(),
        };
        let momentum = Recorded {
            labels: (0..6).map(|k| format!("momentum_{k}")).collect(),
            ..recorded("momentum", "", false, [vec![0.0; 6], vec![0.0; 6]])
        };
        Recording {
            scene: "two".into(),
            dt: 0.1,
            time: vec![0.0, 0.1],
            observables: vec![
                recorded("q", "a, b.position", false, [vec![1.0 / 3.0], vec![1e-300]]),
                recorded("v", "a, b.rate", false, [vec![-0.0], vec![2.0]]),
                recorded("energy", "energy", true, [vec![1.0], vec![1.0]]),
                momentum,
                recorded("min_gap", "min_gap", true, [vec![f64::NAN], vec![0.25]]),
            ],
            state: None,
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
