// Displacements of the sources that a workgroup works on, and the rates of the weights.

// [image][target body][source body][4]: rate of sign times weight, rate of slopes.wgsl's vector.
@group(2) @binding(3) var<storage, read> rates: array<real>;

var<workgroup> shifts: array<real, 192>;

fn put_shift(lane: u32, v: V3) {
    shifts[3u * lane] = v.x;
    shifts[3u * lane + 1u] = v.y;
    shifts[3u * lane + 2u] = v.z;
}

fn shift_at(j: u32) -> V3 {
    return V3(shifts[3u * j], shifts[3u * j + 1u], shifts[3u * j + 2u]);
}
