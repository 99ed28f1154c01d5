// Sums over a workgroup of 256, in a fixed order, in single precision whatever the arithmetic.

var<workgroup> parts: array<f32, 256>;

fn total(lane: u32, own: f32) -> f32 {
    parts[lane] = own;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if lane < half {
            parts[lane] += parts[lane + half];
        }
        workgroupBarrier();
    }
    return parts[0];
}
