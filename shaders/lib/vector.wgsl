// Vectors of three reals.

struct V3 { x: real, y: real, z: real }

// ∇f, and ∇∇f d for some displacement d.
struct Bent { gradient: V3, product: V3 }

fn v_add(a: V3, b: V3) -> V3 { return V3(add(a.x, b.x), add(a.y, b.y), add(a.z, b.z)); }
fn v_sub(a: V3, b: V3) -> V3 { return V3(sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z)); }
fn v_neg(a: V3) -> V3 { return V3(neg(a.x), neg(a.y), neg(a.z)); }
fn v_zero() -> V3 { return V3(num(0.0), num(0.0), num(0.0)); }
fn v_scale(s: real, a: V3) -> V3 { return V3(mul(s, a.x), mul(s, a.y), mul(s, a.z)); }
fn v_fused(s: real, a: V3, b: V3) -> V3 { return v_add(v_scale(s, a), b); }
fn v_dot(a: V3, b: V3) -> real { return add(add(mul(a.x, b.x), mul(a.y, b.y)), mul(a.z, b.z)); }
fn v_cross(a: V3, b: V3) -> V3 {
    return V3(
        sub(mul(a.y, b.z), mul(a.z, b.y)),
        sub(mul(a.z, b.x), mul(a.x, b.z)),
        sub(mul(a.x, b.y), mul(a.y, b.x)),
    );
}
