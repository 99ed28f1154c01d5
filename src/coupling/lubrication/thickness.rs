//! The thickness of the water between rough surfaces.

/// Thickness H at a distance, and its derivatives by both.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thickness {
    /// m
    pub value: f64,
    pub by_distance: f64,
    pub by_roughness: f64,
}

/// Surfaces of the roughness r touch at its tips, d = 0: H = d + r. Where they overlap it falls to half of r,
///
/// ```text
/// H = r + d/√(1 + (2d/r)²)      d < 0
/// ```
///
/// twice continuously differentiable.
pub(super) fn thickness(d: f64, r: f64) -> Thickness {
    if d >= 0.0 {
        return Thickness {
            value: d + r,
            by_distance: 1.0,
            by_roughness: 1.0,
        };
    }
    let x = d / r;
    let root = (1.0 + 4.0 * x * x).sqrt();
    let slope = root.powi(-3);
    let share = 1.0 + x / root;
    Thickness {
        value: r * share,
        by_distance: slope,
        by_roughness: share - x * slope,
    }
}
