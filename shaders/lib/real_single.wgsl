// Real numbers of single precision.
//
// Every shader is written in terms of `real` and the functions here, so that one source serves three
// arithmetics: this one, real_double.wgsl and real_two.wgsl.

alias real = f32;

// An exact small number.
fn num(x: f32) -> real { return x; }
fn narrow(x: real) -> f32 { return x; }
fn add(a: real, b: real) -> real { return a + b; }
fn sub(a: real, b: real) -> real { return a - b; }
fn mul(a: real, b: real) -> real { return a * b; }
fn div(a: real, b: real) -> real { return a / b; }
fn neg(a: real) -> real { return -a; }
fn root(a: real) -> real { return sqrt(a); }
// 1/√a.
fn inverse_root(a: real) -> real { return inverseSqrt(a); }
fn negative(a: real) -> bool { return a < 0.0; }
fn third() -> real { return 0.33333334; }
fn pi() -> real { return 3.1415927; }
fn inverse_4pi() -> real { return 0.07957747; }

// Halvings of an angle up to 45 degrees after which the series below has rounding error only.
const HALVINGS: u32 = 1u;

// arctan(t)/t as a series in t²; artanh(t)/t with the sign of t² turned. Up to here it has rounding error only.
const SERIES: f32 = 0.17;

fn arctan_series(z: real) -> real {
    return sub(1.0, mul(z, sub(0.33333334, mul(z, sub(0.2, mul(z, sub(0.14285715, mul(z, sub(0.11111111, mul(z, sub(0.09090909, mul(z, sub(0.07692308, mul(z, 0.06666667))))))))))))));
}
