// out = Kᵀ y, or Pᵀ y: what every source gathers from all faces.
//
// A workgroup takes one block of sources and one share of the blocks of faces. Twins: coupling::full
// System::apply_transpose; adjoint kernel::potential_sum.

//! uses: vector surface tile surface_tile gate
//! constants: COLUMNS POTENTIAL SURFACE

struct Task { shares: u32, stride: u32, offset: u32, pad: u32 }

@group(1) @binding(0) var<storage, read> y: array<real>;            // [face][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][source][COLUMNS]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> weights: array<real, BLOCK * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if idle() {
        return;
    }
    let own = blocks[sizes.face_blocks + group.x];
    let j = own.y + min(lane, own.z - 1u);
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    let first = group.y * sizes.face_blocks / task.shares;
    let last = (group.y + 1u) * sizes.face_blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[b];
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            for (var k = 0u; k < COLUMNS; k++) {
                var weight = y[i * task.stride + task.offset + k];
                if !POTENTIAL {
                    weight = mul(row_weight(i), weight);
                }
                weights[lane * COLUMNS + k] = weight;
            }
        }
        workgroupBarrier();
        for (var image = 0u; image < sizes.images; image++) {
            var seen = false;
            if POTENTIAL {
                seen = seen_by_potentials(other.x, own.x, image);
            } else {
                seen = seen_by_rows(other.x, own.x, image);
            }
            if !seen {
                continue;
            }
            let s = source_at(image, j);
            let seen_by = way(other.x, own.x, image, other.w);
            for (var i = 0u; i < other.z; i++) {
                let face = tile_face(i);
                var entry = num(0.0);
                if POTENTIAL {
                    entry = charge(face, seen_by, s);
                } else {
                    entry = row(face, seen_by, s);
                }
                for (var k = 0u; k < COLUMNS; k++) {
                    sums[k] = add(sums[k], mul(entry, weights[i * COLUMNS + k]));
                }
            }
        }
    }
    if lane < own.z {
        for (var k = 0u; k < COLUMNS; k++) {
            out[(group.y * sizes.sources + j) * COLUMNS + k] = sums[k];
        }
    }
}
