// out = R⁻¹ x of every body, or R⁻ᵀ x: the right preconditioner. R⁻¹ lies there as a dense upper triangle, or as a square,
// for the bodies where it fits; the others have a diagonal, or what sparse.wgsl gives in its place. A workgroup makes 64 rows of one body from
// tiles of R⁻¹ in its own memory, for one share of the columns of R⁻¹; sum.wgsl adds the shares up. Twins: boundary BodyBoundary::{solve_factor,
// solve_factor_transpose}, PanelBoundary::solve.

//! uses: gate
//! constants: COLUMNS TRANSPOSE

struct Task { face_blocks: u32, sources: u32, shares: u32, pad: u32 }

@group(0) @binding(0) var<storage, read> blocks: array<vec4<u32>>;    // as in pairs.wgsl
@group(0) @binding(1) var<storage, read> factors: array<real>;        // [shape]: n × n, row-major
@group(0) @binding(2) var<storage, read> places: array<vec4<u32>>;    // [body]: start in `factors`, n, first source, kind
@group(0) @binding(3) var<storage, read> scaling: array<real>;        // [source]: 1/√diagonal
@group(0) @binding(4) var<storage, read> x: array<real>;              // [source][COLUMNS]
@group(0) @binding(5) var<storage, read_write> out: array<real>;      // [share][source][COLUMNS]
@group(0) @binding(6) var<uniform> task: Task;

const BLOCK: u32 = 64u;
const WIDTH: u32 = 16u;
const DIAGONAL: u32 = 0u;
const SQUARE: u32 = 2u;
const SPARSE: u32 = 3u;

var<workgroup> tile: array<real, 1040>;
var<workgroup> rows: array<real, WIDTH * COLUMNS>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if idle() {
        return;
    }
    let own = blocks[task.face_blocks + group.x];
    let place = places[own.x];
    let i = own.y + lane;
    let to = (group.y * task.sources + i) * COLUMNS;
    if place.w == DIAGONAL || place.w == SPARSE {
        if lane < own.z {
            for (var k = 0u; k < COLUMNS; k++) {
                out[to + k] = num(0.0);
                if place.w == DIAGONAL && group.y == 0u {
                    out[to + k] = mul(scaling[i], x[i * COLUMNS + k]);
                }
            }
        }
        return;
    }
    let n = place.y;
    let base_row = own.y - place.z;
    var sums: array<real, COLUMNS>;
    for (var k = 0u; k < COLUMNS; k++) {
        sums[k] = num(0.0);
    }
    // Below the diagonal a triangle is zero.
    var start = 0u;
    var end = n;
    if place.w != SQUARE {
        if TRANSPOSE {
            end = base_row + own.z;
        } else {
            start = base_row;
        }
    }
    let first = start + group.y * (end - start) / task.shares;
    let last = start + (group.y + 1u) * (end - start) / task.shares;
    for (var j = first; j < last; j += WIDTH) {
        let width = min(WIDTH, last - j);
        workgroupBarrier();
        for (var at = lane; at < BLOCK * WIDTH; at += BLOCK) {
            // The faster index runs along the rows of memory.
            var r = at / WIDTH;
            var c = at % WIDTH;
            if TRANSPOSE {
                r = at % BLOCK;
                c = at / BLOCK;
            }
            var value = num(0.0);
            if r < own.z && c < width {
                if TRANSPOSE {
                    value = factors[place.x + (j + c) * n + base_row + r];
                } else {
                    value = factors[place.x + (base_row + r) * n + j + c];
                }
            }
            tile[r * WIDTH + r / 4u + c] = value;
        }
        for (var at = lane; at < width * COLUMNS; at += BLOCK) {
            rows[at] = x[(place.z + j) * COLUMNS + at];
        }
        workgroupBarrier();
        for (var c = 0u; c < width; c++) {
            let value = tile[lane * WIDTH + lane / 4u + c];
            for (var k = 0u; k < COLUMNS; k++) {
                sums[k] = add(sums[k], mul(value, rows[c * COLUMNS + k]));
            }
        }
    }
    if lane < own.z {
        for (var k = 0u; k < COLUMNS; k++) {
            out[to + k] = sums[k];
        }
    }
}
