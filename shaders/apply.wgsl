// out = K x, or P x: what all sources of strengths x make on every face.
//
// A workgroup takes one block of faces and one share of the blocks of sources; shares are added up by
// sum.wgsl in a fixed order. Twins: coupling::full System::apply; adjoint kernel::{flux_fill, potential_fill}.

//! uses: vector surface gate
//! constants: COLUMNS POTENTIAL SURFACE

struct Task { shares: u32, stride: u32, offset: u32, pad: u32 }

@group(1) @binding(0) var<storage, read> x: array<real>;            // [source][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][face][COLUMNS]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> points: array<real, 192>;
var<workgroup> strengths: array<real, BLOCK * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if idle() {
        return;
    }
    let own = blocks[group.x];
    let i = own.y + min(lane, own.z - 1u);
    let face = face_at(i);
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    let first = group.y * sizes.source_blocks / task.shares;
    let last = (group.y + 1u) * sizes.source_blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[sizes.face_blocks + b];
        for (var image = 0u; image < sizes.images; image++) {
            var seen = false;
            if POTENTIAL {
                seen = seen_by_potentials(own.x, other.x, image);
            } else {
                seen = seen_by_rows(own.x, other.x, image);
            }
            workgroupBarrier();
            if seen && lane < other.z {
                let s = source_at(image, other.y + lane);
                points[3u * lane] = s.x;
                points[3u * lane + 1u] = s.y;
                points[3u * lane + 2u] = s.z;
                for (var k = 0u; k < COLUMNS; k++) {
                    strengths[lane * COLUMNS + k] = x[(other.y + lane) * task.stride + task.offset + k];
                }
            }
            workgroupBarrier();
            if seen {
                let seen_by = way(own.x, other.x, image, own.w);
                for (var j = 0u; j < other.z; j++) {
                    let s = V3(points[3u * j], points[3u * j + 1u], points[3u * j + 2u]);
                    var entry = num(0.0);
                    if POTENTIAL {
                        entry = charge(face, seen_by, s);
                    } else {
                        entry = row(face, seen_by, s);
                    }
                    for (var k = 0u; k < COLUMNS; k++) {
                        sums[k] = add(sums[k], mul(entry, strengths[j * COLUMNS + k]));
                    }
                }
            }
        }
    }
    if lane < own.z {
        for (var k = 0u; k < COLUMNS; k++) {
            var sum = sums[k];
            if !POTENTIAL {
                sum = mul(row_weight(i), sum);
            }
            out[(group.y * sizes.faces + i) * COLUMNS + k] = sum;
        }
    }
}
