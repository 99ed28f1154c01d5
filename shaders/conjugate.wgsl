// Conjugate gradients on A = I − LᵀGL, every column with its own coefficients: what isn't a product. A column
// starts from its right-hand side over its norm. One whose direction has no positive curvature tells that A
// isn't positive definite. Twin: the Cholesky factor of coupling::reduced.

//! uses: gate_state
//! constants:

// `probe`: the column whose coefficients are kept, past the last one for none.
struct Task { rows: u32, columns: u32, probe: u32, most: u32, end: f32, pad0: u32, pad1: u32, pad2: u32 }

@group(0) @binding(0) var<storage, read> given: array<real>;             // [row][column]: right-hand sides
@group(0) @binding(1) var<storage, read_write> r: array<real>;           // [row][column]
@group(0) @binding(2) var<storage, read_write> p: array<real>;
@group(0) @binding(3) var<storage, read> q: array<real>;                 // A p
@group(0) @binding(4) var<storage, read_write> x: array<real>;
@group(0) @binding(5) var<storage, read_write> solution: array<real>;
@group(0) @binding(6) var<storage, read_write> scalars: array<real>;     // [column][4]: γ, α, β, ‖given‖
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;       // [column][4]: iterations, not definite, unfinished, 0
@group(0) @binding(8) var<storage, read_write> state: array<real>;       // [column][2]: ‖r‖², least p·Ap/p·p
@group(0) @binding(9) var<storage, read_write> history: array<real>;     // [iteration][2]: α, β of the probe
@group(0) @binding(10) var<uniform> task: Task;

var<workgroup> parts: array<real, 256>;

fn total(lane: u32, own: real) -> real {
    workgroupBarrier();
    parts[lane] = own;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if lane < half {
            parts[lane] = add(parts[lane], parts[lane + half]);
        }
        workgroupBarrier();
    }
    return parts[0];
}

@compute @workgroup_size(256)
fn begin(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = num(0.0);
    for (var i = lane; i < task.rows; i += 256u) {
        let value = given[i * task.columns + k];
        own = add(own, mul(value, value));
    }
    let norm = root(total(lane, own));
    if lane == 0u {
        scalars[4u * k] = num(1.0);
        scalars[4u * k + 3u] = norm;
        state[2u * k] = num(0.0);
        state[2u * k + 1u] = num(1.0);
        let some = select(0u, 1u, narrow(norm) > 0.0);
        going[k] = some;
        counts[4u * k] = 0u;
        counts[4u * k + 1u] = 0u;
        counts[4u * k + 2u] = some;
    }
}

@compute @workgroup_size(64)
fn start(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns {
        return;
    }
    let k = at % task.columns;
    var value = num(0.0);
    if going[k] != 0u {
        value = div(given[at], scalars[4u * k + 3u]);
    }
    r[at] = value;
    p[at] = value;
    x[at] = num(0.0);
}

// α = γ/(p·q).
@compute @workgroup_size(256)
fn curvature(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = num(0.0);
    var square = num(0.0);
    for (var i = lane; i < task.rows; i += 256u) {
        let value = p[i * task.columns + k];
        own = add(own, mul(value, q[i * task.columns + k]));
        square = add(square, mul(value, value));
    }
    let curvature = total(lane, own);
    let size = total(lane, square);
    if lane == 0u && going[k] != 0u {
        let quotient = div(curvature, size);
        if negative(sub(quotient, state[2u * k + 1u])) {
            state[2u * k + 1u] = quotient;
        }
        // Not what isn't a number either.
        if narrow(curvature) > 0.0 {
            scalars[4u * k + 1u] = div(scalars[4u * k], curvature);
        } else {
            scalars[4u * k + 1u] = num(0.0);
            counts[4u * k + 1u] = 1u;
            going[k] = 0u;
        }
    }
}

// x += α p, r −= α q.
@compute @workgroup_size(64)
fn advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns {
        return;
    }
    let k = at % task.columns;
    if going[k] == 0u {
        return;
    }
    let alpha = scalars[4u * k + 1u];
    x[at] = add(x[at], mul(alpha, p[at]));
    r[at] = sub(r[at], mul(alpha, q[at]));
}

// β = γ⁺/γ, γ = γ⁺, and whether the column is done.
@compute @workgroup_size(256)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = num(0.0);
    for (var i = lane; i < task.rows; i += 256u) {
        let value = r[i * task.columns + k];
        own = add(own, mul(value, value));
    }
    let next = total(lane, own);
    if lane == 0u && going[k] != 0u {
        let beta = div(next, scalars[4u * k]);
        let done = counts[4u * k];
        if k == task.probe && done < task.most {
            history[2u * done] = scalars[4u * k + 1u];
            history[2u * done + 1u] = beta;
        }
        scalars[4u * k + 2u] = beta;
        scalars[4u * k] = next;
        state[2u * k] = next;
        counts[4u * k] = done + 1u;
        if narrow(next) <= task.end {
            counts[4u * k + 2u] = 0u;
            going[k] = 0u;
        } else if done + 1u >= task.most {
            going[k] = 0u;
        }
    }
}

// p = r + β p.
@compute @workgroup_size(64)
fn turn(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns {
        return;
    }
    let k = at % task.columns;
    if going[k] == 0u {
        return;
    }
    p[at] = add(r[at], mul(scalars[4u * k + 2u], p[at]));
}

@compute @workgroup_size(64)
fn finish(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns {
        return;
    }
    solution[at] = mul(scalars[4u * (at % task.columns) + 3u], x[at]);
}
