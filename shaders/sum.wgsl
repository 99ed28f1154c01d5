// out = scale · (sum of the shares, in their order) + base + diagonal · vector.

//! uses: gate
//! constants:

struct Task {
    rows: u32,
    shares: u32,
    width: u32,
    columns: u32,
    out_stride: u32,
    out_offset: u32,
    base_stride: u32,
    base_offset: u32,
    vector_stride: u32,
    vector_offset: u32,
    // 0: nothing, 1: `base`, 2: what `out` holds.
    base_kind: u32,
    // Whether the diagonal counts.
    damped: u32,
    scale: f32,
    pad1: u32,
    // First column of `parts`.
    first: u32,
    pad: u32,
}

@group(0) @binding(0) var<storage, read> parts: array<real>;       // [share][row][width]
@group(0) @binding(1) var<storage, read_write> out: array<real>;   // [row][out_stride]
@group(0) @binding(2) var<storage, read> base: array<real>;        // [row][base_stride]
@group(0) @binding(3) var<storage, read> diagonal: array<real>;    // [row]
@group(0) @binding(4) var<storage, read> vector: array<real>;      // [row][vector_stride]
@group(0) @binding(5) var<uniform> task: Task;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns || idle() {
        return;
    }
    let i = at / task.columns;
    let k = at % task.columns;
    var sum = num(0.0);
    for (var s = 0u; s < task.shares; s++) {
        sum = add(sum, parts[(s * task.rows + i) * task.width + task.first + k]);
    }
    sum = mul(num(task.scale), sum);
    let to = i * task.out_stride + task.out_offset + k;
    if task.base_kind == 1u {
        sum = add(sum, base[i * task.base_stride + task.base_offset + k]);
    } else if task.base_kind == 2u {
        sum = add(sum, out[to]);
    }
    if task.damped != 0u {
        let x = vector[i * task.vector_stride + task.vector_offset + k];
        sum = add(sum, mul(num(task.scale), mul(diagonal[i], x)));
    }
    out[to] = sum;
}
