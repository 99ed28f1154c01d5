// out[x][y] = Σ_j g_jx a_jy: dot products of columns. A workgroup makes one. Twin: solver::Columns::dots.

//! uses:
//! constants:

struct Task {
    rows: u32,
    g_stride: u32,
    g_offset: u32,
    a_stride: u32,
    a_offset: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<storage, read> g: array<real>;
@group(0) @binding(1) var<storage, read> a: array<real>;
@group(0) @binding(2) var<storage, read_write> out: array<real>;
@group(0) @binding(3) var<uniform> task: Task;

var<workgroup> parts: array<real, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    var sum = num(0.0);
    for (var j = lane; j < task.rows; j += 64u) {
        let x = g[j * task.g_stride + task.g_offset + group.x];
        sum = add(sum, mul(x, a[j * task.a_stride + task.a_offset + group.y]));
    }
    parts[lane] = sum;
    workgroupBarrier();
    if lane == 0u {
        var total = num(0.0);
        for (var l = 0u; l < 64u; l++) {
            total = add(total, parts[l]);
        }
        out[group.x * groups.y + group.y] = total;
    }
}
