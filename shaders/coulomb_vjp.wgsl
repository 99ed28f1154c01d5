// What the charges of every column pull at each point with, per unit charge there:
//
//   F_i = ∂φ/∂x_i = −Σ_j w ∇P x_j           at the point itself
//   D_i = Σ w' e Σ_j P x_j                   at the centre of its body, where weights fade
//
// G is symmetric and images are their own inverses, so that the energy 4π α_xᵀ G α_y gives the force
// 4π (α_x F_y + α_y F_x) at a point (wrench.wgsl). Twins: coupling::reduced's pull_back; adjoint
// kernel::potential_vjp.

//! uses: vector potential points slopes
//! constants: COLUMNS FADING

struct Task { shares: u32, columns: u32, stride: u32, offset: u32 }

@group(1) @binding(0) var<storage, read> x: array<real>;            // [point][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][point][F, D][columns]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> charges: array<real, BLOCK * COLUMNS>;

fn put(at: u32, v: V3) {
    out[at] = v.x;
    out[at + task.columns] = v.y;
    out[at + 2u * task.columns] = v.z;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group.x * BLOCK + lane;
    let i = min(row, sizes.points - 1u);
    let body = owners[i];
    let at = point_at(0u, i);
    var pulls: array<V3, COLUMNS>;
    var fades: array<V3, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        pulls[k] = v_zero();
        fades[k] = v_zero();
    }
    let first = group.y * sizes.blocks / task.shares;
    let last = (group.y + 1u) * sizes.blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[b];
        for (var image = 0u; image < sizes.images; image++) {
            workgroupBarrier();
            if lane < other.z {
                put_place(lane, point_at(image, other.y + lane));
                if image == 0u {
                    for (var k = 0u; k < COLUMNS; k++) {
                        var charge = num(0.0);
                        if k < task.columns {
                            charge = x[(other.y + lane) * task.stride + task.offset + k];
                        }
                        charges[lane * COLUMNS + k] = charge;
                    }
                }
            }
            workgroupBarrier();
            let seen = relation(image, body, other.x);
            let weight = weights[seen];
            if narrow(weight) != 0.0 {
                for (var j = 0u; j < other.z; j++) {
                    let s = place_at(j);
                    let pull = v_scale(neg(weight), potential_gradient(at, s));
                    for (var k = 0u; k < COLUMNS; k++) {
                        pulls[k] = v_fused(charges[j * COLUMNS + k], pull, pulls[k]);
                    }
                    if FADING {
                        let fade = v_scale(potential(at, s), slope_at(seen));
                        for (var k = 0u; k < COLUMNS; k++) {
                            fades[k] = v_fused(charges[j * COLUMNS + k], fade, fades[k]);
                        }
                    }
                }
            }
        }
    }
    if row < sizes.points {
        var width = 3u;
        if FADING {
            width = 6u;
        }
        let to = (group.y * sizes.points + row) * width * task.columns;
        for (var k = 0u; k < task.columns; k++) {
            put(to + k, pulls[k]);
            if FADING {
                put(to + 3u * task.columns + k, fades[k]);
            }
        }
    }
}
