// out = δG x as the bodies are displaced: Σ {w ∇P·d + δw P} x_j, d the displacement of the source (or its image)
// less that of the point. Twins: coupling::reduced's tangent_potentials; adjoint kernel::potential_jvp.

//! uses: vector potential points displaced shifts
//! constants: COLUMNS FADING

struct Task { shares: u32, columns: u32, stride: u32, offset: u32 }

@group(1) @binding(0) var<storage, read> x: array<real>;            // [point][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][point][columns]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> charges: array<real, BLOCK * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group.x * BLOCK + lane;
    let i = min(row, sizes.points - 1u);
    let body = owners[i];
    let at = point_at(0u, i);
    let moved = displaced(0u, body, at);
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    let first = group.y * sizes.blocks / task.shares;
    let last = (group.y + 1u) * sizes.blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[b];
        for (var image = 0u; image < sizes.images; image++) {
            workgroupBarrier();
            if lane < other.z {
                let s = point_at(image, other.y + lane);
                put_place(lane, s);
                put_shift(lane, displaced(image, other.x, s));
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
                    let d = v_sub(shift_at(j), moved);
                    var entry = mul(weight, v_dot(potential_gradient(at, s), d));
                    if FADING {
                        entry = add(entry, mul(rates[4u * seen], potential(at, s)));
                    }
                    for (var k = 0u; k < COLUMNS; k++) {
                        sums[k] = add(sums[k], mul(entry, charges[j * COLUMNS + k]));
                    }
                }
            }
        }
    }
    if row < sizes.points {
        for (var k = 0u; k < task.columns; k++) {
            out[(group.y * sizes.points + row) * task.columns + k] = sums[k];
        }
    }
}
