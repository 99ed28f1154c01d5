//! The pressure in a bearing at a pose, and the damping that it makes.

use super::Bearing;
use super::element::{Cell, Point, fade};
use super::patch::Patch;
use super::thickness::{Thickness, thickness};
use crate::Error;
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, point_velocity, point_wrench};
use crate::coupling::fade::{opening, opening_slope};
use crate::solver::{SparsePattern, elimination_order};
use nalgebra::{DMatrix, SMatrix};
use std::sync::Arc;

/// Parts of the reach between which the pressure goes over into that in the open.
const RIM: [f64; 2] = [0.5, 1.0];
/// How well the rim leads the flow away.
const OPENING: f64 = 20.0;

/// A bearing at a pose, at unit viscosity.
pub struct PlacedBearing {
    /// Damping C/μ over the twist of the first against the other, axes of the other, about the origin of the first: m, m², m³.
    pub damping: Mat6,
    pub(super) patch: Patch,
    pub(super) layers: Vec<Layer>,
    pub(super) cells: Vec<Cell>,
    /// ψ H² with ψ = A⁻¹ b, at the spots with a pressure × 6.
    pub(super) pressure: DMatrix<f64>,
    /// The shortest distance at a spot, m, and the way across there.
    least: (f64, Vec3),
}

/// The water at a spot.
#[derive(Clone, Copy)]
pub(super) struct Layer {
    pub thickness: Thickness,
    /// How far it is from where the film begins to end to where it has.
    pub outside: f64,
    /// Share of the spot in the area of faces, and of those that are sides, m².
    area: f64,
    side: f64,
    /// Its number among those with a pressure.
    pub number: Option<usize>,
}

/// Why there is no pressure in a gap with water in it.
#[derive(Clone, Copy, Debug)]
pub struct Unsolved {
    /// The shortest distance of the surfaces there, m.
    pub distance: f64,
    /// m
    pub roughness: f64,
}

impl Unsolved {
    /// The same of the gap between bodies of these names, of the second none for a wall.
    pub fn error(&self, first: &str, second: Option<&str>) -> Error {
        let other = second.map_or("a wall".into(), |name| format!("body {name:?}"));
        Error::Solver {
            what: format!(
                "lubrication between body {first:?} and {other}, {:.3e} m apart at a roughness of {:.3e} m",
                self.distance, self.roughness
            ),
            iterations: 0,
            residual: f64::INFINITY,
            tolerance: 0.0,
            remedy: "the pressure there is more than numbers hold: give the force the roughness that the surfaces have, or contact a gap that holds them apart"
                .into(),
        }
    }
}

impl PlacedBearing {
    pub(super) fn new(
        bearing: &Bearing,
        relative: &Pose,
        roughness: f64,
    ) -> Result<Option<Self>, Unsolved> {
        let Some(patch) = Patch::new(bearing, relative, roughness) else {
            return Ok(None);
        };
        let layer = |distance: f64| Layer {
            thickness: thickness(distance, roughness),
            outside: (distance / bearing.reach - RIM[0]) / (RIM[1] - RIM[0]),
            area: 0.0,
            side: 0.0,
            number: None,
        };
        let distances = patch.spots.iter().map(|spot| spot.field.distance);
        let mut layers: Vec<Layer> = distances.map(layer).collect();
        let cells: Vec<Cell> = (patch.faces.iter())
            .filter_map(|face| Cell::new(&patch, relative, face))
            .collect();
        let mut active = 0;
        for cell in &cells {
            let [looks, _] = cell.looks();
            for at in cell.corners {
                let layer = &mut layers[at];
                layer.area += cell.area / 3.0;
                layer.side += (1.0 - looks) * cell.area / 3.0;
                if looks > 0.0 && layer.outside < 1.0 && layer.number.is_none() {
                    layer.number = Some(active);
                    active += 1;
                }
            }
        }
        let fields = patch.spots.iter().map(|spot| &spot.field);
        let least = fields.min_by(|a, b| a.distance.total_cmp(&b.distance));
        let Some(least) = least.filter(|_| active > 0) else {
            return Ok(None);
        };
        let least = (least.distance, least.gradient);
        let mut out = Self {
            damping: Mat6::zeros(),
            least,
            pressure: DMatrix::zeros(active, 6),
            patch,
            layers,
            cells,
        };
        let filled = out.fill().is_some();
        match filled && out.damping.iter().all(|x| x.is_finite()) {
            true => Ok(Some(out)),
            false => Err(Unsolved {
                distance: out.distance(),
                roughness,
            }),
        }
    }

    /// The shortest distance of the surfaces, m.
    pub fn distance(&self) -> f64 {
        self.least.0
    }

    /// Unit vector from what is opposite to where the first is nearest, axes of the other.
    pub fn way(&self) -> Vec3 {
        self.least.1
    }

    /// Where its faces are far larger than they should be, as there would be too many: an edge over how long it should be, where that is most.
    pub fn coarse(&self) -> Option<f64> {
        self.patch.coarse
    }

    /// Number of pressures.
    pub fn unknowns(&self) -> usize {
        self.pressure.nrows()
    }

    /// A ψ = b, C = bᵀψ + S.
    fn fill(&mut self) -> Option<()> {
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for layer in &self.layers {
            if let Some(at) = layer.number {
                entries.push((at, at));
                values.push([layer.leak()[0]]);
            }
        }
        let mut loads = DMatrix::zeros(self.unknowns(), 6);
        let mut sheared = Mat6::zeros();
        for cell in &self.cells {
            let points = self.points(cell);
            let numbers = cell.corners.map(|s| self.layers[s].number);
            for point in &points {
                let strength = point.weight * (-point.log).exp();
                let rates: [Vec3; 3] = std::array::from_fn(|i| {
                    let along = cell.gradients.column(i);
                    along - 2.0 * point.shares[i] * point.slope
                });
                for i in 0..3 {
                    for j in 0..3 {
                        if let (Some(a), Some(b)) = (numbers[i], numbers[j])
                            && a >= b
                        {
                            entries.push((a, b));
                            values.push([strength / 12.0 * rates[i].dot(&rates[j])]);
                        }
                    }
                }
            }
            let [looks, _] = cell.looks();
            if looks == 0.0 {
                continue;
            }
            for point in &points {
                let here = self.here(cell, point);
                let pressed = looks * point.weight * (-2.0 * point.log).exp();
                let push = pressed * point_wrench(&here.position, &here.push).transpose();
                for (at, share) in numbers.iter().zip(point.shares) {
                    if let Some(at) = at {
                        let mut row = loads.fixed_view_mut::<1, 6>(*at, 0);
                        row += share * push;
                    }
                }
                let strength = looks * here.within * point.weight * (-point.log).exp();
                if strength > 0.0 {
                    // Columns: what unit twists move along the surface there.
                    let unit = |k: usize| Vec6::from_fn(|j, _| f64::from(j == k));
                    let columns =
                        [0, 1, 2, 3, 4, 5].map(|k| point_velocity(&unit(k), &here.position));
                    let u = SMatrix::<f64, 3, 6>::from_columns(&columns);
                    let across = here.way.transpose() * u;
                    sheared += strength * (u.tr_mul(&u) - across.tr_mul(&across));
                }
            }
        }
        let order = elimination_order(loads.nrows(), &entries)?;
        let factor = Arc::new(SparsePattern::new(&order, &entries)?).factor(&values)?;
        for (load, mut pressure) in loads.column_iter().zip(self.pressure.column_iter_mut()) {
            let mut found: Vec<[f64; 1]> = load.iter().map(|x| [*x]).collect();
            factor.solve(&mut found);
            (pressure.iter_mut().zip(&found)).for_each(|(to, x)| *to = x[0]);
        }
        let squeezed = loads.tr_mul(&self.pressure);
        let all = sheared + squeezed.fixed_view::<6, 6>(0, 0);
        self.damping = 0.5 * (all + all.transpose());
        Some(())
    }

    /// The points that a cell is integrated at.
    pub(super) fn points(&self, cell: &Cell) -> [Point; 6] {
        let log = |s: usize| self.layers[s].thickness.value.ln();
        cell.points(&[cell.corners.map(log), cell.halves.map(log)])
    }

    /// What is at a point of a cell.
    pub(super) fn here(&self, cell: &Cell, point: &Point) -> Here {
        let spots = cell.corners.map(|s| &self.patch.spots[s]);
        let way = point.mean_vector(&spots.map(|s| s.field.gradient));
        Here {
            position: point.mean_vector(&spots.map(|s| s.point)),
            push: 0.5 * (way - point.mean_vector(&cell.normals)),
            way,
            within: point.mean(&cell.corners.map(|s| fade(self.layers[s].outside)[0])),
        }
    }
}

/// What is at a point.
pub(super) struct Here {
    /// m, frame of the other.
    pub position: Vec3,
    /// Mean of both normals, m.
    pub push: Vec3,
    /// The other's normal.
    pub way: Vec3,
    /// How much of Couette's shear acts there: less where the film ends.
    pub within: f64,
}

impl Layer {
    /// What leads into the open where the film ends, of the pressure times H², and its derivatives by the thickness, by what is outside, and by the area of sides.
    pub fn leak(&self) -> [f64; 4] {
        let h = self.thickness.value;
        let (open, slope) = (opening(self.outside), opening_slope(self.outside));
        let scale = OPENING / 12.0 * h.powi(-3);
        let leak = scale * (self.area * open + self.side);
        [leak, -3.0 * leak / h, scale * self.area * slope, scale]
    }
}

/// Derivative of what is outside by the distance.
pub(super) fn outside_slope(reach: f64) -> f64 {
    1.0 / (reach * (RIM[1] - RIM[0]))
}
