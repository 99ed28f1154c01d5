//! Proxies and candidates where smaller gaps are resolved than elsewhere.

use super::proxies::{CANDIDATES, DEPTH, Proxies, SPACING, TANGENT};
use super::samples::{self, Ball, Candidate, Layer};
use crate::coupling::reduced::Region;
use crate::geometry::Interior;

/// Most proxies that a region may add; a smaller gap isn't resolved in so large a region.
const MOST_ADDED: f64 = 4500.0;
/// Proxies are added in this many parts of what the finest distance has, as distances double: 1 + 1/4 + 1/16 …
const COARSER: f64 = 4.0 / 3.0;
/// Candidates nearer to one another than this part of the gap are one.
const SAME: f64 = 1e-3;

/// Adds proxies and candidates within `regions` at the distances from the surface between `gap`, which is resolved everywhere, and each
/// region's own. The regions as they are resolved: with gaps under `gap` only, none too small for its size.
pub(super) fn add(
    surface: &Interior,
    gap: f64,
    regions: &[Region],
    (fitted, checked): (&mut Proxies, &mut Proxies),
    candidates: &mut Vec<Candidate>,
) -> Vec<Region> {
    let mut out = Vec::with_capacity(regions.len());
    for region in regions {
        let ball = Ball {
            center: region.center,
            radius: region.radius,
        };
        let area = samples::area_within(surface, &ball);
        let finest = (COARSER * area / MOST_ADDED).sqrt() / SPACING;
        let own = region.gap.max(finest);
        let levels = (gap / own).log2().ceil();
        if levels < 1.0 {
            continue;
        }
        for level in 1..=levels as usize {
            // At most halved from one to the next, and the last one the region's own.
            let offset = gap * (own / gap).powf(level as f64 / levels);
            let near = samples::around(surface, offset, SPACING * offset, Some(&ball));
            fitted.add(checked, near, offset);
            let wider = Ball {
                radius: ball.radius + offset,
                ..ball
            };
            let layer = Layer {
                depth: DEPTH * offset,
                spacing: CANDIDATES,
                tangent: TANGENT,
                plate: CANDIDATES * DEPTH * own,
            };
            candidates.extend(samples::inside(surface, layer, Some(&wider)));
        }
        out.push(Region {
            gap: own,
            ..*region
        });
    }
    let finest = out.iter().map(|r| r.gap).fold(gap, f64::min);
    if !out.is_empty() {
        *candidates = samples::thin(std::mem::take(candidates), SAME * finest, |c| c.point);
    }
    out
}
