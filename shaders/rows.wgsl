// out = table · twists: what twists ask for on every face (F̄ x̄, B̄ x̄), or read out of every source
// (PᵀB̄ x̄ of the body itself). Twins: coupling::full WetBody::{twist_rows, readout_rows}.

//! uses:
//! constants:

struct Task {
    rows: u32,
    columns: u32,
    width: u32,
    first: u32,
    out_stride: u32,
    out_offset: u32,
    // Whether to add to what is there.
    accumulate: u32,
    pad: u32,
}

@group(0) @binding(0) var<storage, read> table: array<real>;          // [shape's row][width]
@group(0) @binding(1) var<storage, read> map: array<vec2<u32>>;       // [row]: body, shape's row
@group(0) @binding(2) var<storage, read> twists: array<real>;         // [body][6][columns]
@group(0) @binding(3) var<storage, read_write> out: array<real>;      // [row][out_stride]
@group(0) @binding(4) var<uniform> task: Task;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.rows * task.columns {
        return;
    }
    let i = at / task.columns;
    let k = at % task.columns;
    let to = i * task.out_stride + task.out_offset + k;
    var sum = num(0.0);
    if task.accumulate != 0u {
        sum = out[to];
    }
    let row = map[i].y * task.width + task.first;
    let twist = map[i].x * 6u * task.columns + k;
    for (var m = 0u; m < 6u; m++) {
        sum = add(sum, mul(table[row + m], twists[twist + m * task.columns]));
    }
    out[to] = sum;
}
