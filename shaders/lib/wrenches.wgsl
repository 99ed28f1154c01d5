// What derivatives by pairs of bodies leave. A task is one block of sources, one image, and some blocks of faces of one body.

// Columns, the first that is taken on the left, and the tasks of this call.
struct Task { columns: u32, first: u32, first_task: u32, tasks: u32 }

@group(1) @binding(2) var<storage, read> tasks: array<vec4<u32>>; // source block, image, first and last block of faces
@group(1) @binding(4) var<storage, read_write> out: array<real>;  // [task of this call][LEFT][columns][6], or [12] with tangents
@group(1) @binding(5) var<uniform> task: Task;

// Once all faces are summed, their memory is that of the forces: 12 numbers a lane.
fn put(lane: u32, at: u32, v: V3) {
    tile[12u * lane + at] = v.x;
    tile[12u * lane + at + 1u] = v.y;
    tile[12u * lane + at + 2u] = v.z;
}

// The wrench of f at s and its tangent, δf as s moves by d, summed over a block: out[at..at + 12].
fn leave(lane: u32, count: u32, at: u32, s: V3, d: V3, f: V3, df: V3) {
    workgroupBarrier();
    put(lane, 0u, f);
    put(lane, 3u, v_cross(s, f));
    put(lane, 6u, df);
    put(lane, 9u, v_add(v_cross(d, f), v_cross(s, df)));
    workgroupBarrier();
    if lane < 12u {
        var sum = num(0.0);
        for (var l = 0u; l < count; l++) {
            sum = add(sum, tile[12u * l + lane]);
        }
        out[at + lane] = sum;
    }
}
