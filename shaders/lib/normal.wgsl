// Normal velocity of a point source at a point x: n·r/|r|³ with r = x − s, and its derivatives in s.
// Twin: hydrograd_adjoint::kernel::normal.

fn normal(x: V3, n: V3, s: V3) -> real {
    let r = v_sub(x, s);
    let r2 = v_dot(r, r);
    return div(v_dot(n, r), mul(r2, root(r2)));
}

// ∇ = (−n + 3 (n·r) r/r²)/r³.
fn normal_gradient(x: V3, n: V3, s: V3) -> V3 {
    let r = v_sub(x, s);
    let r2 = v_dot(r, r);
    let cube = div(num(1.0), mul(r2, root(r2)));
    let along = div(mul(num(3.0), v_dot(n, r)), r2);
    return v_scale(cube, v_sub(v_scale(along, r), n));
}

// ∇∇ d = 3 { −n (r·d) − (n·d) r − (n·r) d + 5 (n·r)(r·d) r/r² }/r⁵, and ∇.
fn normal_hessian_product(x: V3, n: V3, s: V3, d: V3) -> Bent {
    let r = v_sub(x, s);
    let r2 = v_dot(r, r);
    let cube = div(num(1.0), mul(r2, root(r2)));
    let inverse = div(num(1.0), r2);
    let nr = v_dot(n, r);
    let rd = v_dot(r, d);
    let along = mul(num(3.0), mul(nr, inverse));
    let gradient = v_scale(cube, v_sub(v_scale(along, r), n));
    let radial = sub(mul(num(5.0), mul(mul(nr, rd), inverse)), v_dot(n, d));
    let bent = v_sub(v_sub(v_scale(radial, r), v_scale(rd, n)), v_scale(nr, d));
    return Bent(gradient, v_scale(mul(num(3.0), mul(cube, inverse)), bent));
}
