// out = x · coefficients: combinations of columns, several blocks of them at once. Twin:
// solver::Columns::combine.

//! uses:
//! constants:

struct Task { rows: u32, blocks: u32, from_count: u32, to_count: u32 }

@group(0) @binding(0) var<storage, read> x: array<real>;              // [row][blocks][from]
@group(0) @binding(1) var<storage, read> coefficients: array<real>;   // [from][to]
@group(0) @binding(2) var<storage, read_write> out: array<real>;      // [row][blocks][to]
@group(0) @binding(3) var<uniform> task: Task;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.blocks * task.to_count {
        return;
    }
    let row = at / task.to_count;
    let k = at % task.to_count;
    var sum = num(0.0);
    for (var c = 0u; c < task.from_count; c++) {
        sum = add(sum, mul(x[row * task.from_count + c], coefficients[c * task.to_count + k]));
    }
    out[at] = sum;
}
