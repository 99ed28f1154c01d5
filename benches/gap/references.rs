//! What the errors are measured against, for each case and gap.
//!
//! - Spheres: Lamb's series of images (Hydrodynamics §98), exact.
//! - Bodies of revolution over a wall: [`super::rings`] with elements well under the gap, on two meshes.
//! - Boxes, an edge, capsules: [`super::facets`] graded towards edges and the gap, on two meshes, extrapolated.
//! - Flat faces of boxes at the narrowest gaps, where facets as small as the gap would be too many: the film's limit and its rim ([`flat`]), with what is left
//!   fitted to facets at wider gaps; two boxes by that of one over a wall ([`near_boxes`]).

use super::facets::{self, Copy, Facet, graded, patch};
use super::kept;
use super::rings::{self, Piece};
use hydrograd::adjoint::lie::{Mat3, Vec3};
use std::f64::consts::{FRAC_PI_4, PI};

/// Half of the difference of the gaps' logarithms by which slopes are taken.
const STEP: f64 = 0.02;

/// M and dM/dgap at a gap, of a mass at any gap: exact where it goes as a power of the gap.
fn along(gap: f64, mass: impl Fn(f64) -> f64) -> [f64; 2] {
    let [near, far] = [-STEP, STEP].map(|s| mass(gap * f64::exp(s)));
    let slope = near * far;
    [
        slope.sqrt(),
        slope.sqrt() * (far / near).ln() / (2.0 * STEP * gap),
    ]
}

/// Powers of the meshes' lengths by which errors fall: about the exact surfaces of rings; about flat facets with graded edges, where three meshes of an edge, of a box and of
/// capsules tell 1.5 to 1.7.
const OF_RINGS: f64 = 2.0;
const OF_FACETS: f64 = 1.6;

/// From a finer mesh and a coarser one, `fall` times as far off: the limit, which may be off by half of what it is beyond the finer one.
fn limit(fine: [f64; 2], coarse: [f64; 2], fall: f64) -> [(f64, f64); 2] {
    [0, 1].map(|k| {
        let rest = (fine[k] - coarse[k]) / (fall - 1.0);
        (fine[k] + rest, 0.5 * rest.abs())
    })
}

/// A cylinder, flat over a wall.
fn cylinder([radius, length]: [f64; 2], gap: f64, level: usize) -> [f64; 2] {
    along(gap, |h| {
        let outline = [
            Piece::Line([0.0, h], [radius, h]),
            Piece::Line([radius, h], [radius, h + length]),
            Piece::Line([radius, h + length], [0.0, h + length]),
        ];
        rings::added_mass(&outline, 1.0, |[r, z]| {
            let rim = [h, h + length].map(|top| f64::hypot(r - radius, z - top));
            let rim = rim[0].min(rim[1]);
            let edge = (0.1 * gap.min(0.02) + 0.2 * rim).min(1.5 * gap + z - h);
            edge.min(0.04) / level as f64
        })
    })
}

fn disc(gap: f64, level: usize) -> [f64; 2] {
    cylinder([1.0, 0.25], gap, level)
}

fn round(semi: [f64; 2], gap: f64, level: usize) -> [f64; 2] {
    along(gap, |h| {
        let outline = [Piece::Ellipse(semi[1] + h, semi)];
        rings::added_mass(&outline, 1.0, |[_, z]| {
            // The gap widens with the square of the distance.
            let spread = (semi[0].powi(2) / semi[1] * (2.0 * z - gap)).sqrt();
            (0.3 * spread).min(0.04) / level as f64
        })
    })
}

fn mirror(signs: [f64; 3]) -> Mat3 {
    Mat3::from_diagonal(&Vec3::from(signs))
}

/// A quarter of a box 1 × 1 × 0.5 whose lower face is `height` over the plane z = 0.
fn quarter_box(height: f64, gap: f64, level: usize) -> Vec<Facet> {
    let (edge, top) = (0.3 * gap.min(0.1), 0.03);
    let side = graded(0.5, [1.0, edge], 0.5, (4.0 * gap).min(0.12), level);
    let above = graded(0.5, [1.0, top], 0.5, 0.12, level);
    let up = graded(0.5, [edge, top], 0.5, 0.12, level);
    let inside = Vec3::new(0.0, 0.0, height + 0.25);
    let mut out = patch([&side, &side], &inside, |x, y| Vec3::new(x, y, height));
    out.extend(patch([&above, &above], &inside, |x, y| {
        Vec3::new(x, y, height + 0.5)
    }));
    out.extend(patch([&above, &up], &inside, |x, z| {
        Vec3::new(x, 0.5, height + z)
    }));
    out.extend(patch([&above, &up], &inside, |y, z| {
        Vec3::new(0.5, y, height + z)
    }));
    out
}

/// All images of a quarter but itself, over what mirrors in the plane z = 0 with a sign.
fn quarters(sign: f64, below: Mat3) -> Vec<Copy> {
    let sides = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let own = sides.map(|[x, y]| mirror([x, y, 1.0]));
    let all = own.iter().flat_map(|m| {
        [(Mat3::identity(), 1.0), (below, sign)].map(|(b, sign)| Copy {
            placed: b * m,
            sign,
        })
    });
    all.skip(1).collect()
}

/// A box whose mirror image moves as it does, or against that, half the gap away.
fn square(gap: f64, sign: f64, level: usize) -> [f64; 2] {
    let copies = quarters(sign, mirror([1.0, 1.0, -1.0]));
    along(gap, |h| {
        facets::added_mass(&quarter_box(h, gap, level), 4.0, &copies)
    })
}

/// [`disc`] by facets, whose polygons have the circle's area.
fn faceted_disc(gap: f64, level: usize) -> [f64; 2] {
    let copies = quarters(1.0, mirror([1.0, 1.0, -1.0]));
    let sectors = 8 * level;
    let step = 0.5 * PI / sectors as f64;
    let radius = (step / step.sin()).sqrt();
    let around: Vec<f64> = (0..=sectors).map(|k| k as f64 * step).collect();
    let (edge, top) = (0.3 * gap.min(0.05), 0.02);
    let out = graded(1.0, [1.0, edge], 0.5, (4.0 * gap).min(0.15), level);
    let above = graded(1.0, [1.0, top], 0.5, 0.15, level);
    let up = graded(0.25, [edge, top], 0.5, 0.15, level);
    along(gap, |h| {
        let inside = Vec3::new(0.0, 0.0, h + 0.125);
        let at = |r: f64, t: f64, z: f64| Vec3::new(radius * r * t.cos(), radius * r * t.sin(), z);
        let mut all = patch([&out, &around], &inside, |r, t| at(r, t, h));
        all.extend(patch([&above, &around], &inside, |r, t| at(r, t, h + 0.25)));
        all.extend(patch([&up, &around], &inside, |z, t| at(1.0, t, h + z)));
        facets::added_mass(&all, 4.0, &copies)
    })
}

/// Half a box 1 × 1 × 0.5 with an edge along x down.
fn edge(gap: f64, level: usize) -> [f64; 2] {
    on_edge([1.0, 0.5], FRAC_PI_4, gap, level)
}

/// A brick 1 × 0.6 × 0.3, tilted about x.
fn tilted(gap: f64, level: usize) -> [f64; 2] {
    on_edge([0.6, 0.3], 0.1, gap, level)
}

/// Half a box, 1 along x, that stands on an edge along x; the first of its other sides at an angle over the wall.
fn on_edge([first, second]: [f64; 2], angle: f64, gap: f64, level: usize) -> [f64; 2] {
    let copies: Vec<Copy> = [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]
        .map(|[x, z]| Copy {
            placed: mirror([x, 1.0, z]),
            sign: 1.0,
        })
        .into();
    let (fine, other) = (0.3 * gap.min(0.1), 0.03);
    let along_edge = graded(0.5, [1.0, other], 0.5, 0.12, level);
    // Facets go with the height over the wall.
    let growth = f64::min(0.5, 2.0 * angle.tan());
    let low = |length| graded(length, [fine, other], growth, 0.12, level);
    let high = |length| graded(length, [other, other], 0.5, 0.12, level);
    along(gap, |h| {
        let (s, c) = angle.sin_cos();
        let at = |x: f64, y: f64, z: f64| Vec3::new(x, c * y - s * z, h + s * y + c * z);
        let inside = at(0.0, 0.5 * first, 0.5 * second);
        let mut out = patch([&along_edge, &low(first)], &inside, |x, y| at(x, y, 0.0));
        out.extend(patch([&along_edge, &low(second)], &inside, |x, z| {
            at(x, 0.0, z)
        }));
        out.extend(patch([&along_edge, &high(first)], &inside, |x, y| {
            at(x, y, second)
        }));
        out.extend(patch([&along_edge, &high(second)], &inside, |x, z| {
            at(x, first, z)
        }));
        out.extend(patch([&low(first), &low(second)], &inside, |y, z| {
            at(0.5, y, z)
        }));
        facets::added_mass(&out, 2.0, &copies)
    })
}

/// One of two capsules, radius 0.25 and 1 between the centres of the caps, crossed at right angles: the other is it turned by a right angle and mirrored.
fn crossed(gap: f64, sign: f64, level: usize) -> [f64; 2] {
    let radius = 0.25;
    let turned = Mat3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let copies = quarters(sign, turned);
    let near = 0.3 * (radius * gap).sqrt();
    let around = graded(PI, [near / radius, 0.35], 0.4, 0.35, level);
    let long = graded(0.5, [near, 0.08], 0.4, 0.12, level);
    let cap = graded(0.5 * PI, [0.35, 0.35], 0.4, 0.35, level);
    along(gap, |h| {
        let center = radius + 0.5 * h;
        let inside = Vec3::new(0.25, 0.0, center);
        let at = |x: f64, r: f64, t: f64| Vec3::new(x, r * t.sin(), center - r * t.cos());
        let mut out = patch([&long, &around], &inside, |x, t| at(x, radius, t));
        let end = |a: f64, t: f64| at(0.5 + radius * a.sin(), radius * a.cos(), t);
        out.extend(patch([&cap, &around], &inside, end));
        facets::added_mass(&out, 4.0, &copies)
    })
}

/// One of the capsules while the other rests.
fn capsules(gap: f64, level: usize) -> [f64; 2] {
    of_two([1.0, -1.0].map(|sign| crossed(gap, sign, level)))
}

/// Half of the sum of both: of one of two bodies while the other rests.
fn of_two(both: [[f64; 2]; 2]) -> [f64; 2] {
    [0, 1].map(|k| 0.5 * (both[0][k] + both[1][k]))
}

/// Two spheres, or one over a wall, by images of dipoles.
fn spheres(gap: f64, wall: bool) -> [f64; 2] {
    let of = |d: f64, sign: f64| {
        // With its derivative by d.
        let (mut at, mut strength, mut sum) = ([0.0, 0.0], [1.0_f64, 0.0], [0.0, 0.0]);
        while strength[0].abs() > 1e-14 {
            let s = [d - at[0], 1.0 - at[1]];
            let cube = sign / s[0].powi(3);
            strength = [
                strength[0] * cube,
                strength[1] * cube - 3.0 * strength[0] * cube * s[1] / s[0],
            ];
            at = [1.0 / s[0], -s[1] / (s[0] * s[0])];
            sum = [sum[0] + strength[0], sum[1] + strength[1]];
        }
        [2.0 / 3.0 * PI * (1.0 + 3.0 * sum[0]), 2.0 * PI * sum[1]]
    };
    if wall {
        let [m, slope] = of(2.0 + 2.0 * gap, 1.0);
        return [m, 2.0 * slope];
    }
    of_two([of(2.0 + gap, 1.0), of(2.0 + gap, -1.0)])
}

/// The first of two spheres of these radii while the other rests, by the images of its dipole in the one and the other in turn.
fn unequal([first, other]: [f64; 2], gap: f64) -> [f64; 2] {
    along(gap, |h| {
        let d = first + other + h;
        let (mut at, mut strength, mut sum) = (0.0, 1.0_f64, 0.0);
        while strength.abs() > 1e-14 {
            let there = d - other * other / (d - at);
            strength *= (first * other / ((d - at) * there)).powi(3);
            at = first * first / there;
            sum += strength;
        }
        2.0 / 3.0 * PI * first.powi(3) * (1.0 + 3.0 * sum)
    })
}

/// ∮ (∂u/∂n)² over π/2, and ∫ u, of a square of side 1 with −Δu = 1 in it and 0 around it.
const SQUARE_RIM: f64 = 0.178_99;
const SQUARE: f64 = 0.035_144_3;
/// Gaps, m, over which what the film leaves is fitted.
const FITTED: [f64; 3] = [0.05, 0.025, 0.0125];

/// A box's face 1 × 1 at a gap g over a wall: M = 0.0351/g + 0.179 ln(1/g) + c₀ + c₁ g ln(1/g) + c₂ g, from M at the fitted gaps. The second term is what leaves at the rim into
/// a right angle. A disc's, which goes as this does, comes out right to 10⁻⁴ from 0.1, 0.05 and 0.025 R.
fn flat(gap: f64, fitted: [f64; 3]) -> [f64; 2] {
    let film = |g: f64| SQUARE / g - SQUARE_RIM * g.ln();
    let left: [f64; 3] = [0, 1, 2].map(|k| fitted[k] - film(FITTED[k]));
    let terms = Mat3::from_fn(|i, j| {
        let g = FITTED[i];
        [1.0, -g * g.ln(), g][j]
    });
    let c = terms.try_inverse().expect("different gaps") * Vec3::from(left);
    let slope = -SQUARE / (gap * gap) - SQUARE_RIM / gap;
    [
        film(gap) + c[0] - c[1] * gap * gap.ln() + c[2] * gap,
        slope - c[1] * (gap.ln() + 1.0) + c[2],
    ]
}

/// One of the boxes over the other while that rests.
fn boxes(gap: f64, level: usize) -> [f64; 2] {
    let half = |sign| {
        // The plane of mirrors is half the gap away.
        let [m, slope] = square(0.5 * gap, sign, level);
        [m, 0.5 * slope]
    };
    of_two([half(1.0), half(-1.0)])
}

/// The same at a gap (m) too narrow for facets: half of the box's over a wall at half the gap, and half of what both have that move together, which goes straight with the
/// gap from M at 0.1 and 0.05 m on.
fn near_boxes(gap: f64, [far, near]: [f64; 2]) -> [f64; 2] {
    let rows = kept::of("box-wall").expect("kept");
    let wall = |g: f64| flat(g, [3, 4, 5].map(|k: usize| rows[k][0]));
    let together = |gap: f64, m: f64| 2.0 * m - wall(0.5 * gap)[0];
    let (far, near) = (2.0 * far - rows[3][0], together(0.05, near));
    let slope = (far - near) / 0.05;
    let [m, of_wall] = wall(0.5 * gap);
    of_two([[m, 0.5 * of_wall], [near + slope * (gap - 0.05), slope]])
}

/// A reference: M and dM/dgap, and how far each may be off, relative.
#[derive(Clone, Copy)]
pub struct Reference {
    pub values: [f64; 2],
    pub unsure: [f64; 2],
}

/// That of a case at one of [`super::GAPS`].
pub fn of(case: &str, gap: f64) -> Option<Reference> {
    if let "sphere-sphere" | "sphere-wall" = case {
        return Some(Reference {
            values: spheres(gap, case == "sphere-wall"),
            unsure: [1e-9; 2],
        });
    }
    if case == "small sphere over a large one" {
        return Some(Reference {
            values: unequal([0.4, 1.0], 0.4 * gap),
            unsure: [1e-9, 2.0 * STEP * STEP],
        });
    }
    if case == "rod upright over a wall" {
        let [coarse, fine] = [1, 2].map(|level| cylinder([0.4, 2.0], 0.4 * gap, level));
        let all = limit(fine, coarse, f64::powf(2.0, OF_RINGS));
        return Some(Reference {
            values: all.map(|x| x.0),
            unsure: all.map(|x| x.1 / x.0.abs()),
        });
    }
    let at = |gaps: &[f64]| gaps.iter().position(|g| *g == gap);
    let [m, slope, of_m, of_slope] = match case {
        "brick tilted over a wall" => kept::TILTED[at(&super::HELD_OUT)?],
        _ => kept::of(case)?[at(&super::GAPS)?],
    };
    Some(Reference {
        values: [m, slope],
        unsure: [of_m, of_slope],
    })
}

/// Finds the references of the cases whose names contain one of the words again, and prints them as they are kept; spheres by rings as well, which the series checks.
pub fn print(words: &[String]) {
    let chosen = |name: &str| words.is_empty() || words.iter().any(|w| name.contains(w.as_str()));
    for (name, found, levels, order) in ways() {
        let fall = (levels[1] as f64 / levels[0] as f64).powf(order);
        if !chosen(name) {
            continue;
        }
        println!("(\n    \"{name}\",\n    [");
        let mut direct: Vec<[f64; 2]> = Vec::new();
        let gaps = match name {
            "brick tilted over a wall" => &super::HELD_OUT[..],
            _ => &super::GAPS[..],
        };
        for gap in gaps.iter().copied() {
            let all = match name {
                // Facets as small as the gap would be too many.
                "disc-wall by facets" if gap < 0.02 => continue,
                "box-wall" if gap < 0.02 => {
                    let by = |m: usize| flat(0.5 * gap, [3, 4, 5].map(|k: usize| direct[k][m]));
                    by_both(by(1), by(0), fall)
                }
                "box-box" if gap < 0.1 => {
                    let by = |m: usize| near_boxes(0.5 * gap, [2, 3].map(|k: usize| direct[k][m]));
                    by_both(by(1), by(0), fall)
                }
                _ => {
                    let [coarse, fine] = levels.map(|level| found(gap, level));
                    direct.push([coarse[0], fine[0]]);
                    limit(fine, coarse, fall)
                }
            };
            let part = |k: usize| all[k].1 / all[k].0.abs();
            println!(
                "        [{:.6}, {:.6}, {:.1e}, {:.1e}],",
                all[0].0,
                all[1].0,
                part(0),
                part(1)
            );
        }
        println!("    ],\n),");
    }
}

/// [`limit`] of what was fitted, which may be off by that as well.
fn by_both(fine: [f64; 2], coarse: [f64; 2], fall: f64) -> [(f64, f64); 2] {
    limit(fine, coarse, fall).map(|(x, rest)| (x, rest.max(1e-3 * x.abs())))
}

/// M and dM/dgap at a gap in the case's unit on meshes of a level; the levels, and the power by which the error falls.
type Way = (&'static str, fn(f64, usize) -> [f64; 2], [usize; 2], f64);

fn ways() -> [Way; 9] {
    [
        (
            "sphere-wall",
            |gap, l| round([1.0, 1.0], gap, l),
            [4, 8],
            OF_RINGS,
        ),
        (
            "ellipsoid-wall",
            |gap, l| round([1.0, 0.25], gap, l),
            [4, 8],
            OF_RINGS,
        ),
        ("disc-wall", disc, [2, 4], OF_RINGS),
        ("disc-wall by facets", faceted_disc, [1, 2], OF_FACETS),
        (
            "box-wall",
            |gap, l| square(0.5 * gap, 1.0, l),
            [2, 3],
            OF_FACETS,
        ),
        ("box-box", |gap, l| boxes(0.5 * gap, l), [2, 3], OF_FACETS),
        ("edge-wall", |gap, l| edge(0.5 * gap, l), [2, 4], OF_FACETS),
        (
            "brick tilted over a wall",
            |gap, l| tilted(0.3 * gap, l),
            [1, 2],
            OF_FACETS,
        ),
        (
            "capsule-capsule",
            |gap, l| capsules(0.25 * gap, l),
            [2, 4],
            OF_FACETS,
        ),
    ]
}
