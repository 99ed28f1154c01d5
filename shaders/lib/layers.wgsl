// Single and double layer over 4π of a triangle at a point s: the closed form near it, two terms of its multipole series far from
// it, blended between 5 and 7 radii ρ from its centroid. With r = s − centroid, C the second moments,
//
//   near: S = n·(Σ λ_ab r_a × r_b − r_0 Ω)/4π,   λ_ab = 2 artanh(e/(l_a + l_b))/e over the edges,   D = Ω/4π
//         ∇S = (n Ω + n × Σ λ_ab e_ab)/4π,   ∇∇S d = (n (∇Ω·d) + n × Σ e_ab (∇λ_ab·d))/4π
//   far:  S = A f/4π,   D = A n·∇f/4π,   f = 1/r + ½ C:∇∇(1/r)
//
// Twin: hydrograd_adjoint::kernel::{single, double}, and what they share.

struct Face {
    a: V3,
    b: V3,
    c: V3,
    centre: V3,
    // Twice the area times the normal.
    m: V3,
    // C = p pᵀ + q qᵀ.
    p: V3,
    q: V3,
    // Area over 4π.
    charge: real,
    // 1/|m|.
    inverse: real,
    // Of C.
    trace: real,
    // ρ².
    reach: real,
}

// Halvings of an artanh, enough for a point as near to an edge as numbers tell.
const HALVED: u32 = 12u;

// 2 artanh(e/sum)/e, from e² and the sum of the distances of an edge's ends.
fn logarithm(square: real, sum: real) -> real {
    var z = div(square, mul(sum, sum));
    var factor = div(num(2.0), sum);
    for (var n = 0u; n < HALVED && narrow(z) > SERIES; n++) {
        // artanh t = 2 artanh t/(1 + √(1 − t²)).
        var rest = sub(num(1.0), z);
        if negative(rest) {
            rest = num(0.0);
        }
        let h = add(num(1.0), root(rest));
        factor = mul(factor, div(num(2.0), h));
        z = div(z, mul(h, h));
    }
    return mul(factor, arctan_series(neg(z)));
}

fn length_of(v: V3) -> real {
    return root(v_dot(v, v));
}

// λ_ab of the edges, from the distances of the corners.
fn logarithms(f: Face, l0: real, l1: real, l2: real) -> V3 {
    let e0 = v_sub(f.b, f.a);
    let e1 = v_sub(f.c, f.b);
    let e2 = v_sub(f.a, f.c);
    return V3(
        logarithm(v_dot(e0, e0), add(l0, l1)),
        logarithm(v_dot(e1, e1), add(l1, l2)),
        logarithm(v_dot(e2, e2), add(l2, l0)),
    );
}

// Σ w_ab e_ab of numbers of the edges.
fn edge_sum(f: Face, w: V3) -> V3 {
    let first = v_scale(w.x, v_sub(f.b, f.a));
    return v_fused(w.z, v_sub(f.a, f.c), v_fused(w.y, v_sub(f.c, f.b), first));
}

// Closed forms that share their terms: the single layer, its ∇, and the double layer.
struct Closed { single: real, gradient: V3, double: real }

fn near_both(f: Face, s: V3) -> Closed {
    let r0 = v_sub(f.a, s);
    let w = logarithms(f, length_of(r0), length_of(v_sub(f.b, s)), length_of(v_sub(f.c, s)));
    let edges = edge_sum(f, w);
    let angle = flux(f.a, f.b, f.c, f.m, s);
    // r_a × r_b is r_0 × e_ab, but for the edge that doesn't meet corner a, where e_0 × e_1 = m comes to it.
    let along = v_fused(w.y, f.m, v_cross(r0, edges));
    let plane = v_sub(along, v_scale(angle, r0));
    let scale = mul(inverse_4pi(), f.inverse);
    return Closed(
        mul(scale, v_dot(f.m, plane)),
        v_scale(scale, v_fused(angle, f.m, v_cross(f.m, edges))),
        mul(inverse_4pi(), angle),
    );
}

// ∇λ_ab·d, from the slopes r·d/l of its ends.
fn logarithm_slope(e: V3, sum: real, slopes: real) -> real {
    return div(mul(num(2.0), slopes), sub(mul(sum, sum), v_dot(e, e)));
}

fn near_single_product(f: Face, s: V3, d: V3, bend: V3) -> V3 {
    let r0 = v_sub(f.a, s);
    let r1 = v_sub(f.b, s);
    let r2 = v_sub(f.c, s);
    let l0 = length_of(r0);
    let l1 = length_of(r1);
    let l2 = length_of(r2);
    let d0 = div(v_dot(r0, d), l0);
    let d1 = div(v_dot(r1, d), l1);
    let d2 = div(v_dot(r2, d), l2);
    let w = V3(
        logarithm_slope(v_sub(f.b, f.a), add(l0, l1), add(d0, d1)),
        logarithm_slope(v_sub(f.c, f.b), add(l1, l2), add(d1, d2)),
        logarithm_slope(v_sub(f.a, f.c), add(l2, l0), add(d2, d0)),
    );
    let out = v_fused(v_dot(bend, d), f.m, v_cross(f.m, edge_sum(f, w)));
    return v_scale(mul(inverse_4pi(), f.inverse), out);
}

// f and its derivatives: r, 1/r², 1/r, p·r, q·r, r·C r.
struct Multipoles { r: V3, u: real, i: real, along_p: real, along_q: real, c: real }

fn multipoles(f: Face, r: V3, squared: real) -> Multipoles {
    let along_p = v_dot(f.p, r);
    let along_q = v_dot(f.q, r);
    let u = div(num(1.0), squared);
    return Multipoles(r, u, root(u), along_p, along_q, add(mul(along_p, along_p), mul(along_q, along_q)));
}

// a + b T u + e c u².
fn series(f: Face, x: Multipoles, a: f32, b: f32, e: f32) -> real {
    let inner = add(mul(num(e), mul(x.c, x.u)), mul(num(b), f.trace));
    return add(num(a), mul(inner, x.u));
}

// C v, from p·v and q·v.
fn spread(f: Face, along_p: real, along_q: real) -> V3 {
    return v_fused(along_p, f.p, v_scale(along_q, f.q));
}

// α of ∇f = α r + 3 i⁵ C r.
fn alpha(f: Face, x: Multipoles) -> real {
    return mul(mul(x.i, x.u), series(f, x, -1.0, 1.5, -7.5));
}

fn fifth_power(x: Multipoles) -> real {
    return mul(x.i, mul(x.u, x.u));
}

// β of ∇α = β r − 15 i⁷ C r.
fn beta(f: Face, x: Multipoles) -> real {
    return mul(fifth_power(x), series(f, x, 3.0, -7.5, 52.5));
}

fn alpha_gradient(f: Face, x: Multipoles) -> V3 {
    let bent = mul(num(-15.0), mul(fifth_power(x), x.u));
    return v_fused(beta(f, x), x.r, v_scale(bent, spread(f, x.along_p, x.along_q)));
}

fn far_single(f: Face, x: Multipoles) -> real {
    return mul(f.charge, mul(x.i, series(f, x, 1.0, -0.5, 1.5)));
}

fn far_single_gradient(f: Face, x: Multipoles) -> V3 {
    let bent = mul(num(3.0), fifth_power(x));
    let gradient = v_fused(alpha(f, x), x.r, v_scale(bent, spread(f, x.along_p, x.along_q)));
    return v_scale(f.charge, gradient);
}

fn far_single_product(f: Face, x: Multipoles, d: V3) -> V3 {
    let fifth = fifth_power(x);
    let turned = mul(mul(num(-15.0), mul(fifth, x.u)), v_dot(x.r, d));
    var out = v_scale(v_dot(alpha_gradient(f, x), d), x.r);
    out = v_fused(alpha(f, x), d, out);
    out = v_fused(mul(num(3.0), fifth), spread(f, v_dot(f.p, d), v_dot(f.q, d)), out);
    out = v_fused(turned, spread(f, x.along_p, x.along_q), out);
    return v_scale(f.charge, out);
}

// Area times the normal over 4π.
fn moment(f: Face) -> V3 {
    return v_scale(mul(num(0.5), inverse_4pi()), f.m);
}

fn far_double(f: Face, x: Multipoles) -> real {
    return mul(v_dot(moment(f), x.r), alpha(f, x));
}

fn far_double_gradient(f: Face, x: Multipoles) -> V3 {
    let out = v_scale(v_dot(moment(f), x.r), alpha_gradient(f, x));
    return v_fused(alpha(f, x), moment(f), out);
}

fn far_double_product(f: Face, x: Multipoles, d: V3) -> V3 {
    let slope = alpha_gradient(f, x);
    let fifth = fifth_power(x);
    let seventh = mul(fifth, x.u);
    let ninth = mul(seventh, x.u);
    let along_p = v_dot(f.p, d);
    let along_q = v_dot(f.q, d);
    let rd = v_dot(x.r, d);
    let crd = add(mul(x.along_p, along_p), mul(x.along_q, along_q));
    // ∇β·d.
    let rate = add(
        mul(mul(seventh, series(f, x, -15.0, 52.5, -472.5)), rd),
        mul(mul(num(105.0), ninth), crd),
    );
    // ∇∇α d.
    var bent = v_scale(rate, x.r);
    bent = v_fused(beta(f, x), d, bent);
    bent = v_fused(mul(num(-15.0), seventh), spread(f, along_p, along_q), bent);
    bent = v_fused(mul(mul(num(105.0), ninth), rd), spread(f, x.along_p, x.along_q), bent);
    var out = v_scale(v_dot(moment(f), x.r), bent);
    out = v_fused(v_dot(moment(f), d), slope, out);
    return v_fused(v_dot(slope, d), moment(f), out);
}

// The weight w of the closed form in the blend, and its first two derivatives by r².
struct Weight { value: real, slope: real, curvature: real }

fn weight(f: Face, squared: real) -> Weight {
    let rate = div(num(1.0), mul(num(24.0), f.reach));
    let t = mul(sub(squared, mul(num(25.0), f.reach)), rate);
    let rest = sub(num(1.0), t);
    let polynomial = add(mul(t, add(mul(t, num(6.0)), num(-15.0))), num(10.0));
    let bend = mul(t, rest);
    return Weight(
        sub(num(1.0), mul(mul(t, mul(t, t)), polynomial)),
        mul(mul(num(-30.0), rate), mul(bend, bend)),
        mul(mul(num(-60.0), mul(rate, rate)), mul(bend, sub(rest, t))),
    );
}

fn beyond(f: Face, squared: real) -> bool {
    return !negative(sub(squared, mul(num(49.0), f.reach)));
}

fn within(f: Face, squared: real) -> bool {
    return !negative(sub(mul(num(25.0), f.reach), squared));
}

// Each closed form stands once in a function: compilers put it wherever it is called.

fn single_layer(f: Face, s: V3) -> real {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    var near = num(0.0);
    if !beyond(f, squared) {
        near = near_both(f, s).single;
        if within(f, squared) {
            return near;
        }
    }
    let far = far_single(f, multipoles(f, r, squared));
    if beyond(f, squared) {
        return far;
    }
    return add(far, mul(weight(f, squared).value, sub(near, far)));
}

// By the closed form at any distance where `closed` says so.
fn double_layer(f: Face, s: V3, closed: bool) -> real {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    var near = num(0.0);
    if closed || !beyond(f, squared) {
        near = near_double(f, s);
        if closed || within(f, squared) {
            return near;
        }
    }
    let far = far_double(f, multipoles(f, r, squared));
    if beyond(f, squared) {
        return far;
    }
    return add(far, mul(weight(f, squared).value, sub(near, far)));
}

fn near_double(f: Face, s: V3) -> real {
    return mul(inverse_4pi(), flux(f.a, f.b, f.c, f.m, s));
}

// ∇K = ∇F + w ∇D + 2 w' D r, D the near form less the far one.
fn blended(w: Weight, r: V3, difference: real, near: V3, far: V3) -> V3 {
    let slope = mul(num(2.0), mul(w.slope, difference));
    return v_fused(slope, r, v_fused(w.value, v_sub(near, far), far));
}

fn single_layer_gradient(f: Face, s: V3) -> V3 {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    var near = Closed(num(0.0), v_zero(), num(0.0));
    if !beyond(f, squared) {
        near = near_both(f, s);
        if within(f, squared) {
            return near.gradient;
        }
    }
    let x = multipoles(f, r, squared);
    let far = far_single_gradient(f, x);
    if beyond(f, squared) {
        return far;
    }
    let difference = sub(near.single, far_single(f, x));
    return blended(weight(f, squared), r, difference, near.gradient, far);
}

fn double_layer_gradient(f: Face, s: V3) -> V3 {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    var near = v_zero();
    if !beyond(f, squared) {
        near = v_scale(inverse_4pi(), flux_gradient(f.a, f.b, f.c, f.m, s));
        if within(f, squared) {
            return near;
        }
    }
    let x = multipoles(f, r, squared);
    let far = far_double_gradient(f, x);
    if beyond(f, squared) {
        return far;
    }
    return blended(weight(f, squared), r, sub(near_double(f, s), far_double(f, x)), near, far);
}

// ∇ of both layers.
struct Slopes { single: V3, double: V3 }

fn layers_gradient(f: Face, s: V3) -> Slopes {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    var near = Closed(num(0.0), v_zero(), num(0.0));
    var angle = v_zero();
    if !beyond(f, squared) {
        near = near_both(f, s);
        angle = v_scale(inverse_4pi(), flux_gradient(f.a, f.b, f.c, f.m, s));
        if within(f, squared) {
            return Slopes(near.gradient, angle);
        }
    }
    let x = multipoles(f, r, squared);
    let single = far_single_gradient(f, x);
    let double = far_double_gradient(f, x);
    if beyond(f, squared) {
        return Slopes(single, double);
    }
    let w = weight(f, squared);
    return Slopes(
        blended(w, r, sub(near.single, far_single(f, x)), near.gradient, single),
        blended(w, r, sub(near.double, far_double(f, x)), angle, double),
    );
}

// ∇K and ∇∇K d = ∇∇F d + w ∇∇D d + 2 w' {(r·d) ∇D + (∇D·d) r + D d} + 4 w'' (r·d) D r.
fn blended_bent(w: Weight, r: V3, d: V3, difference: real, near: Bent, far: Bent) -> Bent {
    let gradient = v_sub(near.gradient, far.gradient);
    let slope = mul(num(2.0), w.slope);
    let rd = v_dot(r, d);
    let bent = mul(mul(num(4.0), w.curvature), mul(rd, difference));
    var out = v_fused(w.value, v_sub(near.product, far.product), far.product);
    out = v_fused(mul(slope, rd), gradient, out);
    out = v_fused(add(mul(slope, v_dot(gradient, d)), bent), r, out);
    out = v_fused(mul(slope, difference), d, out);
    return Bent(blended(w, r, difference, near.gradient, far.gradient), out);
}

// ∇ and ∇∇ d of both layers.
struct Layers { single: Bent, double: Bent }

fn near_bent(f: Face, s: V3, d: V3, near: Closed) -> Layers {
    let angle = flux_hessian_product(f.a, f.b, f.c, f.m, s, d);
    let w = inverse_4pi();
    return Layers(
        Bent(near.gradient, near_single_product(f, s, d, angle.gradient)),
        Bent(v_scale(w, angle.gradient), v_scale(w, angle.product)),
    );
}

fn layers_hessian_product(f: Face, s: V3, d: V3) -> Layers {
    let r = v_sub(s, f.centre);
    let squared = v_dot(r, r);
    let none = Bent(v_zero(), v_zero());
    var near = Closed(num(0.0), v_zero(), num(0.0));
    var bent = Layers(none, none);
    if !beyond(f, squared) {
        near = near_both(f, s);
        bent = near_bent(f, s, d, near);
        if within(f, squared) {
            return bent;
        }
    }
    let x = multipoles(f, r, squared);
    let single = Bent(far_single_gradient(f, x), far_single_product(f, x, d));
    let double = Bent(far_double_gradient(f, x), far_double_product(f, x, d));
    if beyond(f, squared) {
        return Layers(single, double);
    }
    let w = weight(f, squared);
    return Layers(
        blended_bent(w, r, d, sub(near.single, far_single(f, x)), bent.single, single),
        blended_bent(w, r, d, sub(near.double, far_double(f, x)), bent.double, double),
    );
}
