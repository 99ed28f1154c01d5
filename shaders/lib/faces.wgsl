// A face over sources inside the bodies: its flux, or its normal velocity, and its potential.

// [face]: corners a, b, c; twice the area times the normal (flux) or the unit normal; row weight.
const FACE: u32 = 13u;
const FLUX: u32 = 0u;

struct Face { a: V3, b: V3, c: V3, m: V3, weight: real }

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

fn row_weight(i: u32) -> real {
    return faces[i * FACE + 12u];
}

// How the faces of a body see a source: by the method of its rows.
fn way(target_body: u32, source_body: u32, image: u32, method: u32) -> u32 {
    return method;
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

// P_ij.
fn charge(f: Face, method: u32, s: V3) -> real {
    return potential(centre(f), s);
}

fn charge_gradient(f: Face, method: u32, s: V3) -> V3 {
    return potential_gradient(centre(f), s);
}
