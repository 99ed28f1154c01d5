// out = G x: the potential that charges x make at every point, G_ij = Σ w/|x_i − x_j| over the images of j that
// the body of i sees.
//
// A workgroup takes 64 points and one share of the blocks of sources; shares are added up by sum.wgsl in a
// fixed order. Twins: coupling::reduced's potentials; adjoint kernel::potential_fill.

//! uses: vector potential points gate
//! constants: COLUMNS

struct Task { shares: u32, columns: u32, stride: u32, offset: u32 }

@group(1) @binding(0) var<storage, read> x: array<real>;            // [point][stride]
@group(1) @binding(1) var<storage, read_write> out: array<real>;    // [share][point][columns]
@group(1) @binding(2) var<uniform> task: Task;

var<workgroup> charges: array<real, BLOCK * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if idle() {
        return;
    }
    let row = group.x * BLOCK + lane;
    let i = min(row, sizes.points - 1u);
    let body = owners[i];
    let at = point_at(0u, i);
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    let first = group.y * sizes.blocks / task.shares;
    let last = (group.y + 1u) * sizes.blocks / task.shares;
    for (var b = first; b < last; b++) {
        let other = blocks[b];
        for (var image = 0u; image < sizes.images; image++) {
            workgroupBarrier();
            if lane < other.z {
                put_place(lane, point_at(image, other.y + lane));
                if image == 0u {
                    for (var k = 0u; k < COLUMNS; k++) {
                        var charge = num(0.0);
                        if k < task.columns {
                            charge = x[(other.y + lane) * task.stride + task.offset + k];
                        }
                        charges[lane * COLUMNS + k] = charge;
                    }
                }
            }
            workgroupBarrier();
            let weight = weights[relation(image, body, other.x)];
            if narrow(weight) != 0.0 {
                for (var j = 0u; j < other.z; j++) {
                    let entry = mul(weight, potential(at, place_at(j)));
                    for (var k = 0u; k < COLUMNS; k++) {
                        sums[k] = add(sums[k], mul(entry, charges[j * COLUMNS + k]));
                    }
                }
            }
        }
    }
    if row < sizes.points {
        for (var k = 0u; k < task.columns; k++) {
            out[(group.y * sizes.points + row) * task.columns + k] = sums[k];
        }
    }
}
