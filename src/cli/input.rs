//! Scenes and meshes that the commands work on.

use std::path::Path;

use crate::scene::{Body, Fluid, Scene, Shape};
use crate::{Error, Result};

/// The scene of a file; one without a name is called as the file.
pub(super) fn load(path: &Path) -> Result<Scene> {
    let mut scene = Scene::load(path)?;
    if scene.name.is_empty() {
        let stem = path.file_stem().unwrap_or_default();
        scene.name = stem.to_string_lossy().into_owned();
    }
    Ok(scene)
}

/// The scene of a file, with so many steps if that is asked for, checked.
pub(super) fn scene(path: &Path, steps: Option<usize>) -> Result<Scene> {
    let mut scene = load(path)?;
    scene.steps = steps.unwrap_or(scene.steps);
    scene.validate()?;
    Ok(scene)
}

/// What `added-mass` is asked about: a scene file, a mesh file or a shape; `density` replaces the
/// water's.
pub(super) fn scene_or_shape(
    file: Option<&Path>,
    shape: Option<&Shape>,
    density: Option<f64>,
) -> Result<Scene> {
    let alone = |shape: Shape, name: &str| {
        let mut scene = Scene::new(Fluid::fresh_water());
        let density = scene.fluid.density;
        scene.name = name.into();
        scene.add(Body::new(shape).named(name).density(density));
        scene
    };
    let mut scene = if let Some(shape) = shape {
        alone(shape.clone(), shape.kind())
    } else {
        // The command line asks for one of the two.
        let path = file.unwrap_or(Path::new(""));
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        match extension.to_ascii_lowercase().as_str() {
            "toml" => Scene::load(path)?,
            "obj" | "stl" | "ply" => alone(Shape::mesh(path), &stem),
            _ => {
                return Err(Error::input(
                    path.display().to_string(),
                    format!("a name that ends in {extension:?}"),
                    "give a scene (.toml), a mesh (.obj, .stl, .ply), or a shape by --shape, \
                     e.g. --shape sphere:0.5",
                ));
            }
        }
    };
    if let Some(density) = density {
        scene.fluid.density = density;
    }
    scene.validate()?;
    Ok(scene)
}
