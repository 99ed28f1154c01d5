// Flux of a point source through a triangle: its solid angle Ω seen from the source s, with r_c = v_c − s,
// l_c = |r_c|, m twice the area times the normal (Van Oosterom and Strackee 1983):
//
//   tan(Ω/2) = N/D,  N = m·r_0,  D = l_0 l_1 l_2 + (r_0·r_1) l_2 + (r_1·r_2) l_0 + (r_2·r_0) l_1
//   ∇Ω = q (D ∇N − N ∇D),  q = 2/(N² + D²),  ∇N = −m,  ∇l = −u,  u = r/l,  ∇(r·r') = −(r + r')
//
// with ∇ the gradient in s. The form with N and D keeps its digits where the source is many edges away,
// where the sum over edges that the CPU takes cancels. Twin: hydrograd_adjoint::kernel::flux.

// arctan2(n, d).
fn arctan2(n: real, d: real) -> real {
    let h = root(add(mul(n, n), mul(d, d)));
    if narrow(h) == 0.0 {
        return num(0.0);
    }
    let flip = negative(d);
    var positive = d;
    if flip {
        positive = neg(d);
    }
    var t = div(n, add(positive, h));
    var double = num(2.0);
    for (var k = 0u; k < HALVINGS; k++) {
        t = div(t, add(num(1.0), root(add(num(1.0), mul(t, t)))));
        double = add(double, double);
    }
    let angle = mul(double, mul(t, arctan_series(mul(t, t))));
    if !flip {
        return angle;
    }
    if negative(n) {
        return sub(neg(pi()), angle);
    }
    return sub(pi(), angle);
}

fn flux(a: V3, b: V3, c: V3, m: V3, s: V3) -> real {
    let r0 = v_sub(a, s);
    let r1 = v_sub(b, s);
    let r2 = v_sub(c, s);
    let l0 = root(v_dot(r0, r0));
    let l1 = root(v_dot(r1, r1));
    let l2 = root(v_dot(r2, r2));
    let n = v_dot(m, r0);
    let d = add(
        add(mul(mul(l0, l1), l2), mul(v_dot(r0, r1), l2)),
        add(mul(v_dot(r1, r2), l0), mul(v_dot(r2, r0), l1)),
    );
    return mul(num(2.0), arctan2(n, d));
}

// ∇Ω.
fn flux_gradient(a: V3, b: V3, c: V3, m: V3, s: V3) -> V3 {
    let r0 = v_sub(a, s);
    let r1 = v_sub(b, s);
    let r2 = v_sub(c, s);
    let l0 = root(v_dot(r0, r0));
    let l1 = root(v_dot(r1, r1));
    let l2 = root(v_dot(r2, r2));
    let d01 = v_dot(r0, r1);
    let d12 = v_dot(r1, r2);
    let d20 = v_dot(r2, r0);
    let n = v_dot(m, r0);
    let l01 = mul(l0, l1);
    let d = add(add(mul(l01, l2), mul(d01, l2)), add(mul(d12, l0), mul(d20, l1)));
    // −∇D, by the vectors it is a combination of.
    let w0 = div(add(mul(l1, l2), d12), l0);
    let w1 = div(add(mul(l2, l0), d20), l1);
    let w2 = div(add(l01, d01), l2);
    let grad = v_add(
        v_add(v_scale(add(w0, add(l2, l1)), r0), v_scale(add(w1, add(l2, l0)), r1)),
        v_scale(add(w2, add(l0, l1)), r2),
    );
    let q = div(num(2.0), add(mul(n, n), mul(d, d)));
    return v_scale(q, v_sub(v_scale(n, grad), v_scale(d, m)));
}

// ∇Ω and ∇∇Ω d.
fn flux_hessian_product(a: V3, b: V3, c: V3, m: V3, s: V3, d: V3) -> Bent {
    let r0 = v_sub(a, s);
    let r1 = v_sub(b, s);
    let r2 = v_sub(c, s);
    let l0 = root(v_dot(r0, r0));
    let l1 = root(v_dot(r1, r1));
    let l2 = root(v_dot(r2, r2));
    // δr = −d, δl = −u·d.
    let dl0 = neg(div(v_dot(r0, d), l0));
    let dl1 = neg(div(v_dot(r1, d), l1));
    let dl2 = neg(div(v_dot(r2, d), l2));
    let d01 = v_dot(r0, r1);
    let d12 = v_dot(r1, r2);
    let d20 = v_dot(r2, r0);
    let e01 = neg(v_dot(v_add(r0, r1), d));
    let e12 = neg(v_dot(v_add(r1, r2), d));
    let e20 = neg(v_dot(v_add(r2, r0), d));
    let n = v_dot(m, r0);
    let dn = neg(v_dot(m, d));
    let p = add(add(mul(mul(l0, l1), l2), mul(d01, l2)), add(mul(d12, l0), mul(d20, l1)));
    // The weights of r_0, r_1, r_2 in −∇D, and their tangents.
    let w0 = div(add(mul(l1, l2), d12), l0);
    let w1 = div(add(mul(l2, l0), d20), l1);
    let w2 = div(add(mul(l0, l1), d01), l2);
    let dw0 = div(sub(add(add(mul(dl1, l2), mul(l1, dl2)), e12), mul(w0, dl0)), l0);
    let dw1 = div(sub(add(add(mul(dl2, l0), mul(l2, dl0)), e20), mul(w1, dl1)), l1);
    let dw2 = div(sub(add(add(mul(dl0, l1), mul(l0, dl1)), e01), mul(w2, dl2)), l2);
    let c0 = add(w0, add(l1, l2));
    let c1 = add(w1, add(l2, l0));
    let c2 = add(w2, add(l0, l1));
    let grad = v_add(v_add(v_scale(c0, r0), v_scale(c1, r1)), v_scale(c2, r2));
    let dp = neg(v_dot(grad, d));
    let dgrad = v_sub(
        v_add(
            v_add(v_scale(add(dw0, add(dl1, dl2)), r0), v_scale(add(dw1, add(dl2, dl0)), r1)),
            v_scale(add(dw2, add(dl0, dl1)), r2),
        ),
        v_scale(add(add(c0, c1), c2), d),
    );
    let q = div(num(2.0), add(mul(n, n), mul(p, p)));
    // q² alone would leave the range of single precision.
    let dq = neg(mul(q, mul(q, add(mul(n, dn), mul(p, dp)))));
    let inner = v_sub(v_scale(n, grad), v_scale(p, m));
    let dinner = v_sub(v_add(v_scale(dn, grad), v_scale(n, dgrad)), v_scale(dp, m));
    return Bent(v_scale(q, inner), v_add(v_scale(dq, inner), v_scale(q, dinner)));
}
