// out[pair][element] = sum over the pair's tasks, in their order, for some of the pairs.

//! uses:
//! constants:

struct Task { pairs: u32, elements: u32, first_pair: u32, first_task: u32 }

@group(0) @binding(0) var<storage, read> parts: array<real>;           // [task from first_task][element]
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;     // [pair]: first task, one past the last
@group(0) @binding(2) var<storage, read_write> out: array<real>;       // [pair][element]
@group(0) @binding(3) var<uniform> task: Task;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= task.pairs * task.elements {
        return;
    }
    let pair = task.first_pair + at / task.elements;
    let element = at % task.elements;
    var sum = num(0.0);
    for (var t = ranges[pair].x; t < ranges[pair].y; t++) {
        sum = add(sum, parts[(t - task.first_task) * task.elements + element]);
    }
    out[pair * task.elements + element] = sum;
}
