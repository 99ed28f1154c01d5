// How the weights change with the places of the bodies' centres: w' e, e the direction from the source body's
// (image's) centre to the target body's.

// [image][target body][source body][3], with the sign.
@group(2) @binding(1) var<storage, read> slopes: array<real>;

fn slope_at(relation: u32) -> V3 {
    return V3(slopes[3u * relation], slopes[3u * relation + 1u], slopes[3u * relation + 2u]);
}
