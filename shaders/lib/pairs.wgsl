// The faces and sources of all bodies where they are, and what a face sees of a source.
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

// [face][13]: corners a, b, c; twice the area times the normal (flux) or the unit normal; row weight.
@group(0) @binding(0) var<storage, read> faces: array<real>;
// [image][source][3].
@group(0) @binding(1) var<storage, read> sources: array<real>;
// Blocks of faces, then blocks of sources: body, first, count, method of the body's rows.
@group(0) @binding(2) var<storage, read> blocks: array<vec4<u32>>;
// [target body][source body]: 0 for different bodies, 1 for the body itself, 2 for an excluded pair.
@group(0) @binding(3) var<storage, read> relations: array<u32>;
@group(0) @binding(4) var<uniform> sizes: Sizes;

const FACE: u32 = 13u;
const BLOCK: u32 = 64u;
const FLUX: u32 = 0u;

struct Face { a: V3, b: V3, c: V3, m: V3, weight: real }

// Boundary rows K exist of a body with itself, potentials P between bodies do not; images count always.
fn seen_by_rows(target_body: u32, source_body: u32, image: u32) -> bool {
    return image > 0u || relations[target_body * sizes.bodies + source_body] != 2u;
}

fn seen_by_potentials(target_body: u32, source_body: u32, image: u32) -> bool {
    return image > 0u || relations[target_body * sizes.bodies + source_body] == 0u;
}

fn face_at(i: u32) -> Face {
    let k = i * FACE;
    return Face(
        V3(faces[k], faces[k + 1u], faces[k + 2u]),
        V3(faces[k + 3u], faces[k + 4u], faces[k + 5u]),
        V3(faces[k + 6u], faces[k + 7u], faces[k + 8u]),
        V3(faces[k + 9u], faces[k + 10u], faces[k + 11u]),
        faces[k + 12u],
    );
}

fn source_at(image: u32, j: u32) -> V3 {
    let k = 3u * (image * sizes.sources + j);
    return V3(sources[k], sources[k + 1u], sources[k + 2u]);
}

fn centre(f: Face) -> V3 {
    return v_scale(third(), v_add(f.a, v_add(f.b, f.c)));
}

// K_ij without the row weight.
fn row(f: Face, method: u32, s: V3) -> real {
    if method == FLUX {
        return flux(f.a, f.b, f.c, f.m, s);
    }
    return normal(centre(f), f.m, s);
}

fn row_gradient(f: Face, method: u32, s: V3) -> V3 {
    if method == FLUX {
        return flux_gradient(f.a, f.b, f.c, f.m, s);
    }
    return normal_gradient(centre(f), f.m, s);
}

fn row_hessian_product(f: Face, method: u32, s: V3, d: V3) -> Bent {
    if method == FLUX {
        return flux_hessian_product(f.a, f.b, f.c, f.m, s, d);
    }
    return normal_hessian_product(centre(f), f.m, s, d);
}
