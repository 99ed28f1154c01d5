// How sources move relative to the faces that see them, as bodies are displaced by spatial twists about
// the scene's middle: d = (u_c − u_b) + (w_c − w_b) × s for a source s of (the image of) c seen from b.

// [image][source body][6], then [target body][6]: (u, w).
@group(1) @binding(3) var<storage, read> motions: array<real>;

struct Motion { u: V3, w: V3 }

fn relative_motion(target_body: u32, source_body: u32, image: u32) -> Motion {
    let c = 6u * (image * sizes.bodies + source_body);
    let b = 6u * (sizes.images * sizes.bodies + target_body);
    return Motion(
        V3(
            sub(motions[c], motions[b]),
            sub(motions[c + 1u], motions[b + 1u]),
            sub(motions[c + 2u], motions[b + 2u]),
        ),
        V3(
            sub(motions[c + 3u], motions[b + 3u]),
            sub(motions[c + 4u], motions[b + 4u]),
            sub(motions[c + 5u], motions[b + 5u]),
        ),
    );
}

fn displacement(m: Motion, s: V3) -> V3 {
    return v_add(m.u, v_cross(m.w, s));
}

// A body doesn't move relative to itself; its images do.
fn moves(target_body: u32, source_body: u32, image: u32) -> bool {
    return seen_by_potentials(target_body, source_body, image);
}
