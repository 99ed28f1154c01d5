// The faces and sources of all bodies where they are, and which bodies see each other. What a face sees of a source stands in
// faces.wgsl, for sources inside the bodies, and in panels.wgsl, whose sources are the panels' centroids.
//
// Lengths are in units of the scene's size, positions relative to its middle (place.wgsl). A block is up
// to 64 faces or sources of one body; a workgroup works on one block at a time, so that whether two bodies
// see each other is the same for all its threads.

struct Sizes {
    faces: u32,
    sources: u32,
    bodies: u32,
    images: u32,
    face_blocks: u32,
    source_blocks: u32,
    pad0: u32,
    pad1: u32,
}

// [face][FACE].
@group(0) @binding(0) var<storage, read> faces: array<real>;
// [image][source][3].
@group(0) @binding(1) var<storage, read> sources: array<real>;
// Blocks of faces, then blocks of sources: body, first, count, method of the body's rows.
@group(0) @binding(2) var<storage, read> blocks: array<vec4<u32>>;
// [target body][source body]: 0 for different bodies, 1 for the body itself, 2 for an excluded pair; then of every image
// whether it has the opposite sign.
@group(0) @binding(3) var<storage, read> relations: array<u32>;
@group(0) @binding(4) var<uniform> sizes: Sizes;

const BLOCK: u32 = 64u;

// Boundary rows K exist of a body with itself, potentials P between bodies do not; images count always.
fn seen_by_rows(target_body: u32, source_body: u32, image: u32) -> bool {
    return image > 0u || relations[target_body * sizes.bodies + source_body] != 2u;
}

fn seen_by_potentials(target_body: u32, source_body: u32, image: u32) -> bool {
    return image > 0u || relations[target_body * sizes.bodies + source_body] == 0u;
}

fn source_at(image: u32, j: u32) -> V3 {
    let k = 3u * (image * sizes.sources + j);
    return V3(sources[k], sources[k + 1u], sources[k + 2u]);
}
