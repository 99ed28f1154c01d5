// How points and their images move as bodies are displaced by spatial twists about the scene's middle.

// [image][body][6]: (u, w); the first image is the bodies themselves.
@group(2) @binding(2) var<storage, read> motions: array<real>;

// u + w × s.
fn displaced(image: u32, body: u32, s: V3) -> V3 {
    let k = 6u * (image * sizes.bodies + body);
    let u = V3(motions[k], motions[k + 1u], motions[k + 2u]);
    let w = V3(motions[k + 3u], motions[k + 4u], motions[k + 5u]);
    return v_add(u, v_cross(w, s));
}
