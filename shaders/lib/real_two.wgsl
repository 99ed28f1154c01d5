// Real numbers as unevaluated sums of two singles, high and low: about 14 digits, for adapters without
// double precision. See real_single.wgsl. Never add or multiply them with the operators of vectors.
//
// References: Dekker, Numer. Math. 18 (1971) 224; Knuth, The Art of Computer Programming 2, 4.2.2.

alias real = vec2<f32>;

// Zero, which no compiler knows: what passes through `keep` isn't simplified away. (Compilers may take
// (a + b) − a for b; rounding errors are what this arithmetic lives on.)
@group(3) @binding(0) var<uniform> nothing: vec4<u32>;

fn keep(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) ^ nothing.x); }

fn num(x: f32) -> real { return vec2<f32>(x, 0.0); }
fn narrow(x: real) -> f32 { return x.x; }

// a + b exactly, for |a| ≥ |b|.
fn ordered_sum(a: f32, b: f32) -> real {
    let s = keep(a + b);
    return vec2<f32>(s, b - keep(s - a));
}

// a + b exactly.
fn exact_sum(a: f32, b: f32) -> real {
    let s = keep(a + b);
    let t = keep(s - a);
    return vec2<f32>(s, keep(a - keep(s - t)) + keep(b - t));
}

// The upper twelve bits: products of such parts are exact, fused or not.
fn upper(a: f32) -> f32 { return bitcast<f32>(bitcast<u32>(a) & 0xfffff000u); }

// a b exactly.
fn exact_product(a: f32, b: f32) -> real {
    let p = keep(a * b);
    let ah = upper(a);
    let al = a - ah;
    let bh = upper(b);
    let bl = b - bh;
    return vec2<f32>(p, ((keep(ah * bh - p) + ah * bl) + al * bh) + al * bl);
}

fn add(a: real, b: real) -> real {
    let s = exact_sum(a.x, b.x);
    let t = exact_sum(a.y, b.y);
    let u = ordered_sum(s.x, s.y + t.x);
    return ordered_sum(u.x, u.y + t.y);
}

fn neg(a: real) -> real { return vec2<f32>(-a.x, -a.y); }
fn sub(a: real, b: real) -> real { return add(a, neg(b)); }

fn mul(a: real, b: real) -> real {
    let p = exact_product(a.x, b.x);
    return ordered_sum(p.x, p.y + (a.x * b.y + a.y * b.x));
}

fn div(a: real, b: real) -> real {
    let first = a.x / b.x;
    let left = sub(a, mul(b, num(first)));
    let second = left.x / b.x;
    let rest = sub(left, mul(b, num(second)));
    return add(ordered_sum(first, second), num(rest.x / b.x));
}

fn root(a: real) -> real {
    if a.x <= 0.0 {
        return num(0.0);
    }
    let first = sqrt(a.x);
    let left = sub(a, exact_product(first, first));
    let second = left.x / (2.0 * first);
    let sum = ordered_sum(first, second);
    let rest = sub(a, mul(sum, sum));
    return add(sum, num(rest.x / (2.0 * first)));
}

// A step of Newton's from single precision doubles its digits.
fn inverse_root(a: real) -> real {
    let first = num(inverseSqrt(a.x));
    let left = sub(num(1.0), mul(a, mul(first, first)));
    return add(first, mul(first, vec2<f32>(0.5 * left.x, 0.5 * left.y)));
}
fn negative(a: real) -> bool { return a.x < 0.0; }
fn third() -> real { return vec2<f32>(0.33333334, -9.934108e-09); }
fn pi() -> real { return vec2<f32>(3.1415927, -8.742278e-08); }
fn inverse_4pi() -> real { return vec2<f32>(0.07957747, 3.210319e-09); }

const HALVINGS: u32 = 3u;
const SERIES: f32 = 0.02;

fn arctan_series(z: real) -> real {
    return sub(vec2<f32>(1.0, 0.0), mul(z, sub(vec2<f32>(0.33333334, -9.934108e-09), mul(z, sub(vec2<f32>(0.2, -2.9802323e-09), mul(z, sub(vec2<f32>(0.14285715, -6.386212e-09), mul(z, sub(vec2<f32>(0.11111111, -8.278423e-10), mul(z, sub(vec2<f32>(0.09090909, -2.7093021e-09), mul(z, sub(vec2<f32>(0.07692308, -2.865608e-09), mul(z, sub(vec2<f32>(0.06666667, -3.4769376e-09), mul(z, vec2<f32>(0.05882353, -2.1913472e-10)))))))))))))))));
}
