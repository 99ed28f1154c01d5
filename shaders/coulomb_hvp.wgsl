// The pulls of coulomb_vjp.wgsl with their tangents as the bodies are displaced and the charges change:
//
//   δF_i = −Σ_j {w (∇∇P d x_j + ∇P δx_j) + δw ∇P x_j}
//   δD_i = Σ {δ(w' e) Σ_j P x_j + w' e Σ_j (∇P·d x_j + P δx_j)}
//
// d the displacement of the source (or its image) less that of the point. Twins: coupling::reduced's
// link_tangent; adjoint kernel::potential_hvp.

//! uses: vector potential points slopes displaced shifts
//! constants: COLUMNS FADING

struct Task { shares: u32, pad0: u32, pad1: u32, pad2: u32 }

@group(1) @binding(0) var<storage, read> x: array<real>;            // [point][COLUMNS]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][point][F, D, δF, δD][COLUMNS]
@group(1) @binding(2) var<uniform> task: Task;
@group(1) @binding(3) var<storage, read> dx: array<real>;           // [point][COLUMNS]

var<workgroup> charges: array<real, BLOCK * 2u * COLUMNS>;

fn put(at: u32, v: V3) {
    out[at] = v.x;
    out[at + COLUMNS] = v.y;
    out[at + 2u * COLUMNS] = v.z;
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
    let moved = displaced(0u, body, at);
    var pulls: array<V3, COLUMNS>;
    var dpulls: array<V3, COLUMNS>;
    var fades: array<V3, COLUMNS>;
    var dfades: array<V3, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        pulls[k] = v_zero();
        dpulls[k] = v_zero();
        fades[k] = v_zero();
        dfades[k] = v_zero();
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
                        charges[lane * 2u * COLUMNS + k] = x[(other.y + lane) * COLUMNS + k];
                        charges[(lane * 2u + 1u) * COLUMNS + k] = dx[(other.y + lane) * COLUMNS + k];
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
                    let p = potential_hessian_product(at, s, d);
                    let pull = v_scale(neg(weight), p.gradient);
                    var dpull = v_scale(neg(weight), p.product);
                    if FADING {
                        dpull = v_sub(dpull, v_scale(rates[4u * seen], p.gradient));
                    }
                    for (var k = 0u; k < COLUMNS; k++) {
                        let charge = charges[j * 2u * COLUMNS + k];
                        let dcharge = charges[(j * 2u + 1u) * COLUMNS + k];
                        pulls[k] = v_fused(charge, pull, pulls[k]);
                        dpulls[k] = v_fused(charge, dpull, v_fused(dcharge, pull, dpulls[k]));
                    }
                    if FADING {
                        let value = potential(at, s);
                        let slope = slope_at(seen);
                        let bend = V3(rates[4u * seen + 1u], rates[4u * seen + 2u], rates[4u * seen + 3u]);
                        let fade = v_scale(value, slope);
                        let dfade = v_fused(v_dot(p.gradient, d), slope, v_scale(value, bend));
                        for (var k = 0u; k < COLUMNS; k++) {
                            let charge = charges[j * 2u * COLUMNS + k];
                            let dcharge = charges[(j * 2u + 1u) * COLUMNS + k];
                            fades[k] = v_fused(charge, fade, fades[k]);
                            dfades[k] = v_fused(charge, dfade, v_fused(dcharge, fade, dfades[k]));
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
        let to = (group.y * sizes.points + row) * 2u * width * COLUMNS;
        for (var k = 0u; k < COLUMNS; k++) {
            put(to + k, pulls[k]);
            put(to + width * COLUMNS + k, dpulls[k]);
            if FADING {
                put(to + 3u * COLUMNS + k, fades[k]);
                put(to + (width + 3u) * COLUMNS + k, dfades[k]);
            }
        }
    }
}
