// Conjugate gradients on R⁻ᵀ (KᵀK + D²) R⁻¹, every column with its own coefficients: what isn't a product.
// Twin: solver::cgls.

//! uses: gate_state total
//! constants: COLUMNS

struct Task { rows: u32, pad0: u32, pad1: u32, pad2: u32 }

@group(0) @binding(0) var<storage, read_write> p: array<f32>;          // [source][COLUMNS]
@group(0) @binding(1) var<storage, read> q: array<f32>;
@group(0) @binding(2) var<storage, read> direction: array<f32>;
@group(0) @binding(3) var<storage, read_write> x: array<f32>;
@group(0) @binding(4) var<storage, read_write> s: array<f32>;
@group(0) @binding(5) var<storage, read_write> scalars: array<f32>;    // [column][4]: γ, α, β, γ to end at
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;     // [column][4]: iterations, …
@group(0) @binding(7) var<uniform> task: Task;

// α = γ/(p·q).
@compute @workgroup_size(256)
fn curvature(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = 0.0;
    for (var i = lane; i < task.rows; i += 256u) {
        own += p[i * COLUMNS + k] * q[i * COLUMNS + k];
    }
    let curvature = total(lane, own);
    if lane == 0u && going[k] != 0u {
        if curvature > 0.0 {
            scalars[4u * k + 1u] = scalars[4u * k] / curvature;
        } else {
            scalars[4u * k + 1u] = 0.0;
            going[k] = 0u;
        }
    }
}

// x += α R⁻¹p, s −= α q.
@compute @workgroup_size(64)
fn advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let k = at % COLUMNS;
    if going[k] == 0u {
        return;
    }
    let alpha = scalars[4u * k + 1u];
    x[at] += alpha * direction[at];
    s[at] -= alpha * q[at];
}

// β = γ⁺/γ, γ = γ⁺, and whether the column is done.
@compute @workgroup_size(256)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = 0.0;
    for (var i = lane; i < task.rows; i += 256u) {
        let value = s[i * COLUMNS + k];
        own += value * value;
    }
    let next = total(lane, own);
    if lane == 0u && going[k] != 0u {
        scalars[4u * k + 2u] = next / scalars[4u * k];
        scalars[4u * k] = next;
        counts[4u * k] += 1u;
        if next <= scalars[4u * k + 3u] {
            counts[4u * k + 1u] = 1u;
            going[k] = 0u;
        }
    }
}

// p = s + β p.
@compute @workgroup_size(64)
fn turn(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let k = at % COLUMNS;
    if going[k] == 0u {
        return;
    }
    p[at] = s[at] + scalars[4u * k + 2u] * p[at];
}
