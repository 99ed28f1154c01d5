// out = δKᵀ y, or δPᵀ y: the tangent of apply_transpose.wgsl as the bodies are displaced.
//
// Twins: adjoint kernel::{flux_vjp, normal_vjp, potential_vjp}, contracted with the displacement.

//! uses: vector surface tile surface_tile motion
//! constants: COLUMNS POTENTIAL SURFACE

struct Task { shares: u32, stride: u32, offset: u32, pad: u32 }

@group(1) @binding(0) var<storage, read> y: array<real>;            // [face][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][source][COLUMNS]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> weights: array<real, BLOCK * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = blocks[sizes.face_blocks + group.x];
    let j = own.y + min(lane, own.z - 1u);
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    let first = group.y * sizes.face_blocks / task.shares;
    let last = (group.y + 1u) * sizes.face_blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[b];
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            for (var k = 0u; k < COLUMNS; k++) {
                var weight = y[i * task.stride + task.offset + k];
                if !POTENTIAL {
                    weight = mul(row_weight(i), weight);
                }
                weights[lane * COLUMNS + k] = weight;
            }
        }
        workgroupBarrier();
        for (var image = 0u; image < sizes.images; image++) {
            if !moves(other.x, own.x, image) {
                continue;
            }
            let s = source_at(image, j);
            let seen_by = way(other.x, own.x, image, other.w);
            let d = displacement(relative_motion(other.x, own.x, image), s);
            for (var i = 0u; i < other.z; i++) {
                let face = tile_face(i);
                var slope = v_zero();
                if POTENTIAL {
                    slope = charge_gradient(face, seen_by, s);
                } else {
                    slope = row_gradient(face, seen_by, s);
                }
                let entry = v_dot(slope, d);
                for (var k = 0u; k < COLUMNS; k++) {
                    sums[k] = add(sums[k], mul(entry, weights[i * COLUMNS + k]));
                }
            }
        }
    }
    if lane < own.z {
        for (var k = 0u; k < COLUMNS; k++) {
            out[(group.y * sizes.sources + j) * COLUMNS + k] = sums[k];
        }
    }
}
