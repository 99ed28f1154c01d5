//! Where the meshes that a URDF file names lie.

use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// The folders in which packages are looked for: those given, those of `ROS_PACKAGE_PATH`, and the folder of the file with all above it.
pub(super) struct Folders {
    /// Where the file itself lies.
    own: PathBuf,
    packages: Vec<PathBuf>,
}

impl Folders {
    pub fn new(file: &Path, given: &[PathBuf]) -> Self {
        let whole = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let own = whole.parent().unwrap_or(Path::new("")).to_owned();
        let environment = std::env::var_os("ROS_PACKAGE_PATH").unwrap_or_default();
        let listed = std::env::split_paths(&environment).filter(|p| !p.as_os_str().is_empty());
        let above = own.ancestors().map(Path::to_path_buf);
        let packages = given.iter().cloned().chain(listed).chain(above);
        Self {
            packages: packages.collect(),
            own,
        }
    }

    /// The file that a mesh's name stands for; `place` begins the message if there is none.
    pub fn find(&self, name: &str, place: &str) -> Result<PathBuf> {
        let tried = self.candidates(name.trim());
        if let Some(found) = tried.iter().find(|path| path.is_file()) {
            return Ok(found.clone());
        }
        let remedy = match tried.is_empty() {
            true => "give a path, file://…, package://PACKAGE/… or model://MODEL/…".to_string(),
            false => {
                let tried: Vec<String> = tried.iter().map(|p| p.display().to_string()).collect();
                format!(
                    "no such file; tried {}. Give the folder that holds the package by `package_path` (--package-path) or in ROS_PACKAGE_PATH",
                    tried.join(", ")
                )
            }
        };
        Err(Error::input(
            format!("{place}: mesh"),
            format!("{name:?}"),
            remedy,
        ))
    }

    fn candidates(&self, name: &str) -> Vec<PathBuf> {
        let scheme = |prefix: &str| name.strip_prefix(prefix);
        if let Some(rest) = scheme("package://").or(scheme("model://")) {
            // Some exporters write `package:///PACKAGE/…`.
            let rest = rest.trim_start_matches('/');
            let (package, inner) = rest.split_once('/').unwrap_or((rest, ""));
            if package.is_empty() || inner.is_empty() {
                return Vec::new();
            }
            // A folder may hold the package, or be the package.
            let both = |folder: &PathBuf| {
                let itself = folder.file_name().is_some_and(|n| n == package);
                let itself = itself.then(|| folder.join(inner));
                [Some(folder.join(package).join(inner)), itself]
            };
            let all: Vec<PathBuf> = (self.packages.iter().flat_map(both).flatten()).collect();
            return all;
        }
        if let Some(rest) = scheme("file://") {
            return vec![self.own.join(rest)];
        }
        if name.is_empty() || name.contains("://") {
            return Vec::new();
        }
        let given = self.packages.iter();
        let mut all = vec![self.own.join(name)];
        all.extend(given.map(|folder| folder.join(name)));
        all.dedup();
        all
    }
}
