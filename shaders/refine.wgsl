// Iterative refinement around the single-precision solve of cgls.wgsl: its right-hand sides, its ends, and
// the solution that it corrects, in the fine arithmetic. Twin: the stopping rule of solver::cgls.

//! uses: gate_state
//! constants: COLUMNS

struct Task { rows: u32, first: u32, stride: u32, offset: u32, tolerance: f32, inner: f32, pad0: u32, pad1: u32 }

@group(0) @binding(0) var<storage, read> rho: array<real>;               // [source][COLUMNS]: the residual
@group(0) @binding(1) var<storage, read_write> norms: array<real>;       // [column][2]: ‖ρ‖, ‖R⁻ᵀg‖
@group(0) @binding(2) var<storage, read_write> shrunk: array<f32>;       // [source][COLUMNS]: ρ/‖ρ‖
@group(0) @binding(3) var<storage, read_write> s: array<f32>;            // [source][COLUMNS]: R⁻ᵀρ/‖ρ‖
@group(0) @binding(4) var<storage, read_write> p: array<f32>;
@group(0) @binding(5) var<storage, read_write> x: array<f32>;
@group(0) @binding(6) var<storage, read_write> scalars: array<f32>;      // as in cgls.wgsl
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;       // [column][4]: iterations, inner solve reached its end, stalled, unused
@group(0) @binding(8) var<storage, read_write> relative: array<f32>;     // [column]: residual reached
@group(0) @binding(9) var<storage, read_write> unfinished: array<u32>;   // [column]
@group(0) @binding(10) var<storage, read_write> solution: array<real>;   // [source][stride]
@group(0) @binding(11) var<uniform> task: Task;

var<workgroup> parts: array<real, 64>;
var<workgroup> singles: array<f32, 64>;

// ‖ρ‖ of every column.
@compute @workgroup_size(64)
fn norm(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var sum = num(0.0);
    for (var i = lane; i < task.rows; i += 64u) {
        let value = rho[i * COLUMNS + k];
        sum = add(sum, mul(value, value));
    }
    parts[lane] = sum;
    workgroupBarrier();
    if lane == 0u && unfinished[k] != 0u {
        var all = num(0.0);
        for (var l = 0u; l < 64u; l++) {
            all = add(all, parts[l]);
        }
        norms[2u * k] = root(all);
    }
}

// ρ/‖ρ‖ in single precision.
@compute @workgroup_size(64)
fn shrink(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let size = norms[2u * (at % COLUMNS)];
    if narrow(size) > 0.0 {
        shrunk[at] = narrow(div(rho[at], size));
    } else {
        shrunk[at] = 0.0;
    }
}

// Whether a column has reached the tolerance; if not, where its next inner solve ends.
@compute @workgroup_size(64)
fn begin(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x;
    var own = 0.0;
    for (var i = lane; i < task.rows; i += 64u) {
        let value = s[i * COLUMNS + k];
        own += value * value;
    }
    singles[lane] = own;
    workgroupBarrier();
    if lane == 0u && unfinished[k] != 0u {
        var gamma = 0.0;
        for (var l = 0u; l < 64u; l++) {
            gamma += singles[l];
        }
        let size = mul(norms[2u * k], num(sqrt(gamma)));
        let before = relative[k];
        if task.first != 0u {
            norms[2u * k + 1u] = size;
        }
        var now = 0.0;
        if narrow(norms[2u * k + 1u]) > 0.0 {
            now = narrow(div(size, norms[2u * k + 1u]));
        }
        relative[k] = now;
        let again = task.first == 0u && counts[4u * k + 1u] != 0u;
        let stalled = again && now > 0.5 * before;
        if !(now > task.tolerance) || stalled {
            unfinished[k] = 0u;
            going[k] = 0u;
            if stalled && now > task.tolerance {
                counts[4u * k + 2u] = 1u;
            }
        } else {
            going[k] = 1u;
        }
        counts[4u * k + 1u] = 0u;
        let end = max(task.inner, 0.5 * task.tolerance / max(now, task.tolerance));
        scalars[4u * k] = gamma;
        scalars[4u * k + 3u] = gamma * end * end;
    }
}

// The inner solve starts at zero.
@compute @workgroup_size(64)
fn start(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    p[at] = s[at];
    x[at] = 0.0;
}

// The solution corrected.
@compute @workgroup_size(64)
fn correct(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * COLUMNS {
        return;
    }
    let k = at % COLUMNS;
    if unfinished[k] == 0u {
        return;
    }
    let to = at / COLUMNS * task.stride + task.offset + k;
    solution[to] = add(solution[to], mul(norms[2u * k], num(x[at])));
}
