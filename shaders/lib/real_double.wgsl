// Real numbers of double precision, where the adapter has them (SHADER_F64). See real_single.wgsl.

alias real = f64;

fn num(x: f32) -> real { return f64(x); }
fn narrow(x: real) -> f32 { return f32(x); }
fn add(a: real, b: real) -> real { return a + b; }
fn sub(a: real, b: real) -> real { return a - b; }
fn mul(a: real, b: real) -> real { return a * b; }
fn div(a: real, b: real) -> real { return a / b; }
fn neg(a: real) -> real { return -a; }
fn root(a: real) -> real { return sqrt(a); }
// Two steps of Newton's from single precision: a fifth of what a root and a division take.
fn inverse_root(a: real) -> real {
    let half = 0.5lf * a;
    let first = f64(inverseSqrt(f32(a)));
    let second = first * (1.5lf - half * first * first);
    return second * (1.5lf - half * second * second);
}
fn negative(a: real) -> bool { return a < 0.0lf; }
fn third() -> real { return 0.3333333333333333lf; }
fn pi() -> real { return 3.141592653589793lf; }
fn inverse_4pi() -> real { return 0.07957747154594767lf; }

const HALVINGS: u32 = 3u;
const SERIES: f32 = 0.02;

fn arctan_series(z: real) -> real {
    return sub(1.0lf, mul(z, sub(0.3333333333333333lf, mul(z, sub(0.2lf, mul(z, sub(0.14285714285714285lf, mul(z, sub(0.1111111111111111lf, mul(z, sub(0.09090909090909091lf, mul(z, sub(0.07692307692307693lf, mul(z, sub(0.06666666666666667lf, mul(z, 0.058823529411764705lf))))))))))))))));
}
