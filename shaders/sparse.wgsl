// out = L x of every body that has a sparse factor, or Lᵀ x: a thread a row. The other bodies' rows stay as they are. Twin:
// solver SparseRows::product.

//! uses: gate
//! constants: COLUMNS TRANSPOSE

struct Task { sources: u32, pad0: u32, pad1: u32, pad2: u32 }

@group(0) @binding(0) var<storage, read> reach: array<vec4<u32>>;     // [L's rows; Lᵀ's rows]: first entry, end, first source of the body
@group(0) @binding(1) var<storage, read> entries: array<vec2<u32>>;   // the body's source, a value's bits
@group(0) @binding(2) var<storage, read> x: array<real>;              // [source][COLUMNS]
@group(0) @binding(3) var<storage, read_write> out: array<real>;      // [source][COLUMNS]
@group(0) @binding(4) var<uniform> task: Task;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    if idle() {
        return;
    }
    let i = id.y * groups.x * 64u + id.x;
    if i >= task.sources {
        return;
    }
    var row = reach[i];
    if TRANSPOSE {
        row = reach[task.sources + i];
    }
    if row.x == row.y {
        return;
    }
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    for (var at = row.x; at < row.y; at++) {
        let entry = entries[at];
        let value = num(bitcast<f32>(entry.y));
        let source = (row.z + entry.x) * COLUMNS;
        for (var k = 0u; k < COLUMNS; k++) {
            sums[k] = add(sums[k], mul(value, x[source + k]));
        }
    }
    for (var k = 0u; k < COLUMNS; k++) {
        out[i * COLUMNS + k] = sums[k];
    }
}
