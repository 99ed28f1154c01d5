// A face as a panel that carries a single and a double layer, seen by the centroids of other bodies' panels or of their images.

// [face]: corners a, b, c; centroid; twice the area times the normal; p, q; area over 4π, 1/|m|, trace, ρ² (layers.wgsl).
const FACE: u32 = 25u;

// How a panel's layers are seen: by its own body as they are in closed form; with the opposite sign, by images in free surfaces.
const OWN: u32 = 1u;
const NEGATIVE: u32 = 2u;

fn vector_at(k: u32) -> V3 {
    return V3(faces[k], faces[k + 1u], faces[k + 2u]);
}

fn face_at(i: u32) -> Face {
    let k = i * FACE;
    return Face(
        vector_at(k),
        vector_at(k + 3u),
        vector_at(k + 6u),
        vector_at(k + 9u),
        vector_at(k + 12u),
        vector_at(k + 15u),
        vector_at(k + 18u),
        faces[k + 21u],
        faces[k + 22u],
        faces[k + 23u],
        faces[k + 24u],
    );
}

// The layers have their weight in them.
fn row_weight(i: u32) -> real {
    return num(1.0);
}

fn way(target_body: u32, source_body: u32, image: u32, method: u32) -> u32 {
    if image == 0u && target_body == source_body {
        return OWN;
    }
    return NEGATIVE * relations[sizes.bodies * sizes.bodies + image];
}

fn signed(way: u32, value: real) -> real {
    if way == NEGATIVE {
        return neg(value);
    }
    return value;
}

fn signed_vector(way: u32, v: V3) -> V3 {
    if way == NEGATIVE {
        return v_neg(v);
    }
    return v;
}

// A_ij: ½ of a panel itself, Ω/4π of others.
fn row(f: Face, way: u32, s: V3) -> real {
    let own = way == OWN;
    if own {
        let r = v_sub(s, f.centre);
        if narrow(v_dot(r, r)) <= 1e-10 * narrow(f.reach) {
            return num(0.5);
        }
    }
    return signed(way, double_layer(f, s, own));
}

fn row_gradient(f: Face, way: u32, s: V3) -> V3 {
    return signed_vector(way, double_layer_gradient(f, s));
}

// S_ij.
fn charge(f: Face, way: u32, s: V3) -> real {
    return signed(way, single_layer(f, s));
}

fn charge_gradient(f: Face, way: u32, s: V3) -> V3 {
    return signed_vector(way, single_layer_gradient(f, s));
}
