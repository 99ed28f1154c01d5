// The points of all compressed bodies where they are, with their images, and what bodies see of each other.
//
// Lengths are in units of the scene's size, positions relative to its middle (place.wgsl). A workgroup makes
// 64 rows of G, of any bodies; it goes over the sources in blocks of up to 64 points of one body.

struct Sizes { points: u32, bodies: u32, images: u32, blocks: u32 }

// [image][point][3]; the first image is the points themselves.
@group(0) @binding(0) var<storage, read> points: array<real>;
// Of sources: body, first point, count.
@group(0) @binding(1) var<storage, read> blocks: array<vec4<u32>>;
// [point]: body.
@group(0) @binding(2) var<storage, read> owners: array<u32>;
// [image][target body][source body]: sign times weight, 0 for what isn't seen.
@group(0) @binding(3) var<storage, read> weights: array<real>;
@group(0) @binding(4) var<uniform> sizes: Sizes;

const BLOCK: u32 = 64u;

var<workgroup> places: array<real, 192>;

fn point_at(image: u32, j: u32) -> V3 {
    let k = 3u * (image * sizes.points + j);
    return V3(points[k], points[k + 1u], points[k + 2u]);
}

// Where an image of a source body as a target body sees it stands in the tables.
fn relation(image: u32, target_body: u32, source_body: u32) -> u32 {
    return (image * sizes.bodies + target_body) * sizes.bodies + source_body;
}

fn put_place(lane: u32, v: V3) {
    places[3u * lane] = v.x;
    places[3u * lane + 1u] = v.y;
    places[3u * lane + 2u] = v.z;
}

fn place_at(j: u32) -> V3 {
    return V3(places[3u * j], places[3u * j + 1u], places[3u * j + 2u]);
}
