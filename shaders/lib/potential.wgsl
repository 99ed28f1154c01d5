// Potential of a point source at a point x: 1/|r| with r = x − s, and its derivatives in s.
// Twin: hydrograd_adjoint::kernel::potential.

fn potential(x: V3, s: V3) -> real {
    let r = v_sub(x, s);
    return div(num(1.0), root(v_dot(r, r)));
}

// ∇ = r/r³.
fn potential_gradient(x: V3, s: V3) -> V3 {
    let r = v_sub(x, s);
    let r2 = v_dot(r, r);
    return v_scale(div(num(1.0), mul(r2, root(r2))), r);
}

// ∇∇ d = {−d + 3 (r·d) r/r²}/r³, and ∇.
fn potential_hessian_product(x: V3, s: V3, d: V3) -> Bent {
    let r = v_sub(x, s);
    let r2 = v_dot(r, r);
    let cube = div(num(1.0), mul(r2, root(r2)));
    let along = div(mul(num(3.0), v_dot(r, d)), r2);
    return Bent(v_scale(cube, r), v_scale(cube, v_sub(v_scale(along, r), d)));
}
