// GMRES in single precision on A M⁻¹, M the right preconditioner, every column with its own coefficients: what isn't a product. The
// basis begins with the right-hand side, which refine.wgsl gives in units of its norm, and is orthogonalised by classical
// Gram–Schmidt: a cycle gains a few digits only. Twin: solver::gmres.

//! uses: gate_state total
//! constants: COLUMNS

// `step`: vectors of the basis before the last one; `most`: the most that there are.
struct Task { rows: u32, step: u32, most: u32, pad: u32 }

@group(0) @binding(0) var<storage, read_write> basis: array<f32>;      // [most][row][COLUMNS]
@group(0) @binding(1) var<storage, read_write> q: array<f32>;          // [row][COLUMNS]: A M⁻¹ of the last vector
@group(0) @binding(2) var<storage, read_write> dots: array<f32>;       // [column][most + 1]
@group(0) @binding(3) var<storage, read_write> triangle: array<f32>;   // [column][column of R][row of R]
@group(0) @binding(4) var<storage, read_write> rotations: array<f32>;  // [column][most][2]
@group(0) @binding(5) var<storage, read_write> right: array<f32>;      // [column][most + 1]
@group(0) @binding(6) var<storage, read_write> scalars: array<f32>;    // [column][4]: γ, 1/‖q‖, -, γ to end at
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;     // [column][4]: iterations, whether the end was reached, …
@group(0) @binding(8) var<storage, read_write> spans: array<u32>;      // [column]: vectors that its solution is made of
@group(0) @binding(9) var<storage, read_write> x: array<f32>;          // [row][COLUMNS]
@group(0) @binding(10) var<storage, read_write> p: array<f32>;         // [row][COLUMNS]: the last vector
@group(0) @binding(11) var<uniform> task: Task;

// The first vector of the basis.
@compute @workgroup_size(64)
fn begin(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    basis[at] = p[at];
}

// Products with the basis so far: a workgroup makes one.
@compute @workgroup_size(256)
fn project(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = 0.0;
    for (var i = lane; i < task.rows; i += 256u) {
        own += basis[(group.y * task.rows + i) * COLUMNS + k] * q[i * COLUMNS + k];
    }
    let dot = total(lane, own);
    if lane == 0u {
        dots[k * (task.most + 1u) + group.y] = dot;
    }
}

// q less its part along the basis.
@compute @workgroup_size(64)
fn subtract(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let k = at % COLUMNS;
    if going[k] == 0u {
        return;
    }
    var sum = 0.0;
    for (var j = 0u; j <= task.step; j++) {
        sum += dots[k * (task.most + 1u) + j] * basis[j * task.rows * COLUMNS + at];
    }
    q[at] -= sum;
}

// The new column of R, and whether the residual is small enough.
@compute @workgroup_size(256)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = 0.0;
    for (var i = lane; i < task.rows; i += 256u) {
        let value = q[i * COLUMNS + k];
        own += value * value;
    }
    let last = sqrt(total(lane, own));
    if lane != 0u || going[k] == 0u {
        return;
    }
    let first = k * (task.most + 1u);
    let column = (k * task.most + task.step) * task.most;
    if task.step == 0u {
        right[first] = sqrt(scalars[4u * k]);
    }
    var top = dots[first];
    for (var j = 0u; j < task.step; j++) {
        let c = rotations[2u * (k * task.most + j)];
        let s = rotations[2u * (k * task.most + j) + 1u];
        let below = dots[first + j + 1u];
        triangle[column + j] = c * top + s * below;
        top = c * below - s * top;
    }
    let radius = sqrt(top * top + last * last);
    var c = 1.0;
    var s = 0.0;
    if radius > 0.0 {
        c = top / radius;
        s = last / radius;
    }
    triangle[column + task.step] = radius;
    rotations[2u * (k * task.most + task.step)] = c;
    rotations[2u * (k * task.most + task.step) + 1u] = s;
    let left = right[first + task.step];
    right[first + task.step] = c * left;
    let rest = -s * left;
    right[first + task.step + 1u] = rest;
    spans[k] = task.step + 1u;
    counts[4u * k] += 1u;
    scalars[4u * k + 1u] = 0.0;
    // Not what isn't a number either.
    let done = !(rest * rest > scalars[4u * k + 3u]);
    if done || !(last > 1e-7 * radius) {
        counts[4u * k + 1u] = 1u;
        going[k] = 0u;
    } else {
        scalars[4u * k + 1u] = 1.0 / last;
    }
}

// The next vector of the basis.
@compute @workgroup_size(64)
fn extend(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let next = scalars[4u * (at % COLUMNS) + 1u] * q[at];
    p[at] = next;
    // The last one has no place.
    if task.step + 1u < task.most {
        basis[(task.step + 1u) * task.rows * COLUMNS + at] = next;
    }
}

// Coefficients of the basis: R y = right.
@compute @workgroup_size(64)
fn solve(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.x;
    if k >= COLUMNS {
        return;
    }
    let first = k * (task.most + 1u);
    for (var n = 0u; n < spans[k]; n++) {
        let j = spans[k] - 1u - n;
        var sum = right[first + j];
        for (var i = j + 1u; i < spans[k]; i++) {
            sum -= triangle[(k * task.most + i) * task.most + j] * dots[first + i];
        }
        let pivot = triangle[(k * task.most + j) * task.most + j];
        dots[first + j] = 0.0;
        if pivot != 0.0 {
            dots[first + j] = sum / pivot;
        }
    }
}

// M x, the combination of the basis.
@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let k = at % COLUMNS;
    var sum = 0.0;
    for (var j = 0u; j < spans[k]; j++) {
        sum += dots[k * (task.most + 1u) + j] * basis[j * task.rows * COLUMNS + at];
    }
    x[at] = sum;
}
