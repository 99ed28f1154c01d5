// Products with the bodies' dense blocks [L, Ū], which bodies of equal shape share. Twins: coupling::reduced's
// charges (expand) and tangent_solution (project).

//! uses: gate
//! constants:

struct Task {
    rows: u32,
    columns: u32,
    x_stride: u32,
    x_offset: u32,
    out_stride: u32,
    out_offset: u32,
    base_stride: u32,
    base_offset: u32,
    // 0: the modes L, 1: the strengths Ū.
    part: u32,
    // What is added to: 0 nothing, 1 `base`, 2 what `out` holds.
    based: u32,
    scale: f32,
    pad: u32,
}

@group(0) @binding(0) var<storage, read> table: array<real>;          // [shape]: points × (modes + 6), row-major
@group(0) @binding(1) var<storage, read> bodies: array<vec4<u32>>;    // first point, points, first mode, modes
@group(0) @binding(2) var<storage, read> shapes: array<u32>;          // [body]: where its shape's block begins
@group(0) @binding(3) var<storage, read> owners: array<u32>;          // [point]: body
@group(0) @binding(4) var<storage, read> mode_owners: array<u32>;     // [mode]: body
@group(0) @binding(5) var<storage, read> x: array<real>;
@group(0) @binding(6) var<storage, read> base: array<real>;
@group(0) @binding(7) var<storage, read_write> out: array<real>;
@group(0) @binding(8) var<uniform> task: Task;

// out[point] = base + scale · block · x[mode, or body's twist].
@compute @workgroup_size(64)
fn expand(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns || idle() {
        return;
    }
    let i = at / task.columns;
    let k = at % task.columns;
    let b = owners[i];
    let body = bodies[b];
    let row = shapes[b] + (i - body.x) * (body.w + 6u);
    var first = row;
    var start = body.z;
    var count = body.w;
    if task.part == 1u {
        first = row + body.w;
        start = 6u * b;
        count = 6u;
    }
    var sum = num(0.0);
    for (var c = 0u; c < count; c++) {
        sum = add(sum, mul(table[first + c], x[(start + c) * task.x_stride + task.x_offset + k]));
    }
    sum = mul(num(task.scale), sum);
    let to = i * task.out_stride + task.out_offset + k;
    if task.based == 1u {
        sum = add(sum, base[i * task.base_stride + task.base_offset + k]);
    } else if task.based == 2u {
        sum = add(sum, out[to]);
    }
    out[to] = sum;
}

// out[mode, or body's twist] = base + scale · blockᵀ · x[point].
@compute @workgroup_size(64)
fn project(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns || idle() {
        return;
    }
    let row = at / task.columns;
    let k = at % task.columns;
    var b = row / 6u;
    if task.part == 0u {
        b = mode_owners[row];
    }
    let body = bodies[b];
    var column = shapes[b] + row - body.z;
    if task.part == 1u {
        column = shapes[b] + body.w + row % 6u;
    }
    var sum = num(0.0);
    for (var i = 0u; i < body.y; i++) {
        let value = x[(body.x + i) * task.x_stride + task.x_offset + k];
        sum = add(sum, mul(table[column + i * (body.w + 6u)], value));
    }
    sum = mul(num(task.scale), sum);
    let to = row * task.out_stride + task.out_offset + k;
    if task.based == 1u {
        sum = add(sum, base[row * task.base_stride + task.base_offset + k]);
    } else if task.based == 2u {
        sum = add(sum, out[to]);
    }
    out[to] = sum;
}
