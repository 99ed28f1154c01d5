// Conjugate gradients in single precision on A = I − LᵀGL, all WIDE columns side by side, each with its own
// coefficients; they gain five digits of what the rounds around them (batch_solve) refine.
//
// In `rough`, [row][QUADS] each, four columns side by side and zeros beyond them: r, p, q, y; charges and potentials of the points.

@group(1) @binding(6) var<storage, read_write> rough: array<vec4<f32>>;

// Columns with those that are zero.
const PADDED: u32 = 4u * QUADS;

var<workgroup> rough_charges: array<vec4<f32>, TILE * QUADS>;
var<workgroup> rough_places: array<vec3<f32>, TILE>;
var<workgroup> sums_of_lanes: array<vec4<f32>, LANES>;
// Of each column: a sum over all rows, γ, α, β, whether it goes on, whether a direction had no positive curvature, its size in this round.
var<workgroup> totals: array<f32, PADDED>;
var<workgroup> gamma: array<f32, PADDED>;
var<workgroup> alpha: array<f32, PADDED>;
var<workgroup> beta: array<f32, PADDED>;
var<workgroup> goes: array<u32, PADDED>;
var<workgroup> bent: array<u32, PADDED>;
var<workgroup> size: array<f32, PADDED>;
// How many columns go on; iterations of all rounds.
var<workgroup> going: u32;
var<workgroup> taken: u32;

// In fours of numbers.
fn rough_size() -> u32 { return (4u * scene.modes + 2u * scene.points) * QUADS; }

// Lanes that take elements, each always of the same columns: those of its number modulo QUADS.
const STRIDE: u32 = (LANES / QUADS) * QUADS;

// The sums over all lanes of their columns, in `totals`.
fn sum_columns(lane: u32, own: vec4<f32>) {
    workgroupBarrier();
    sums_of_lanes[lane] = own;
    var n = LANES / QUADS;
    while n > 1u {
        workgroupBarrier();
        let half = (n + 1u) / 2u;
        if lane / QUADS + half < n {
            sums_of_lanes[lane] += sums_of_lanes[lane + half * QUADS];
        }
        n = half;
    }
    workgroupBarrier();
    if lane < PADDED {
        totals[lane] = sums_of_lanes[lane / 4u][lane % 4u];
    }
    workgroupBarrier();
}

// Charges = L x.
fn rough_expand(base: u32, x: u32, lane: u32) {
    let to = base + 4u * scene.modes * QUADS;
    for (var i = lane; i < scene.points; i += LANES) {
        let body = body_at(owner(i));
        let row = scene.across + body.table + i - body.point;
        var sums: array<vec4<f32>, QUADS>;
        for (var k = 0u; k < QUADS; k++) {
            sums[k] = vec4<f32>(0.0);
        }
        for (var m = 0u; m < body.modes; m++) {
            let entry = fixed_single[row + m * body.points];
            let begin = x + (body.mode + m) * QUADS;
            for (var k = 0u; k < QUADS; k++) {
                sums[k] += entry * rough[begin + k];
            }
        }
        for (var k = 0u; k < QUADS; k++) {
            rough[to + i * QUADS + k] = sums[k];
        }
    }
}

// Potentials = G charges.
fn rough_gather(base: u32, slot: u32, lane: u32) {
    let begin = base + 4u * scene.modes * QUADS;
    let to = begin + scene.points * QUADS;
    for (var start = 0u; start < scene.points; start += LANES) {
        let i = min(start + lane, scene.points - 1u);
        let body = owner(i);
        let own = point_at(slot, 0u, i);
        let at = vec3<f32>(narrow(own.x), narrow(own.y), narrow(own.z));
        var sums: array<vec4<f32>, QUADS>;
        for (var k = 0u; k < QUADS; k++) {
            sums[k] = vec4<f32>(0.0);
        }
        for (var b = 0u; b < scene.blocks; b++) {
            let other = block_at(b);
            for (var image = 0u; image < scene.images; image++) {
                workgroupBarrier();
                if lane < other.count {
                    let s = point_at(slot, image, other.first + lane);
                    rough_places[lane] = vec3<f32>(narrow(s.x), narrow(s.y), narrow(s.z));
                    let j = begin + (other.first + lane) * QUADS;
                    for (var k = 0u; k < QUADS; k++) {
                        rough_charges[lane * QUADS + k] = rough[j + k];
                    }
                }
                workgroupBarrier();
                let weight = fixed_single[weight_at(image, body, other.body)];
                if weight != 0.0 {
                    for (var j = 0u; j < other.count; j++) {
                        let r = at - rough_places[j];
                        let entry = weight * inverseSqrt(dot(r, r));
                        for (var k = 0u; k < QUADS; k++) {
                            sums[k] += entry * rough_charges[j * QUADS + k];
                        }
                    }
                }
            }
        }
        if start + lane < scene.points {
            for (var k = 0u; k < QUADS; k++) {
                rough[to + i * QUADS + k] = sums[k];
            }
        }
    }
}

// q = p − Lᵀ potentials.
fn rough_project(base: u32, p: u32, q: u32, lane: u32) {
    let begin = base + (4u * scene.modes + scene.points) * QUADS;
    for (var m = lane; m < scene.modes; m += LANES) {
        let body = body_at(mode_owner(m));
        let column = scene.table + body.table + m - body.mode;
        var sums: array<vec4<f32>, QUADS>;
        for (var k = 0u; k < QUADS; k++) {
            sums[k] = vec4<f32>(0.0);
        }
        for (var i = 0u; i < body.points; i++) {
            let entry = fixed_single[column + i * (body.modes + 6u)];
            let at = begin + (body.point + i) * QUADS;
            for (var k = 0u; k < QUADS; k++) {
                sums[k] += entry * rough[at + k];
            }
        }
        for (var k = 0u; k < QUADS; k++) {
            rough[q + m * QUADS + k] = rough[p + m * QUADS + k] - sums[k];
        }
    }
}

// y ≈ A⁻¹ r of the columns that go, whose r is of size one; those of the others must be zero. The coefficients of column
// `probe` go to `history`: how many steps, then α and β of each.
fn rough_solve(base: u32, slot: u32, lane: u32, probe: u32, history: u32) {
    let count = scene.modes * QUADS;
    let r = base;
    let p = base + count;
    let q = base + 2u * count;
    let y = base + 3u * count;
    let column = 4u * (lane % QUADS);
    for (var e = lane; e < count; e += LANES) {
        rough[p + e] = rough[r + e];
        rough[y + e] = vec4<f32>(0.0);
    }
    if lane < PADDED {
        gamma[lane] = 1.0;
    }
    for (var iteration = 0u; iteration < scene.steps; iteration++) {
        storageBarrier();
        rough_expand(base, p, lane);
        storageBarrier();
        rough_gather(base, slot, lane);
        storageBarrier();
        rough_project(base, p, q, lane);
        storageBarrier();
        var own = vec4<f32>(0.0);
        if lane < STRIDE {
            for (var e = lane; e < count; e += STRIDE) {
                own += rough[p + e] * rough[q + e];
            }
        }
        sum_columns(lane, own);
        if lane < PADDED {
            var scale = 0.0;
            if goes[lane] != 0u {
                // Not what isn't a number either.
                if totals[lane] > 0.0 {
                    scale = gamma[lane] / totals[lane];
                } else {
                    bent[lane] = 1u;
                    goes[lane] = 0u;
                }
            }
            alpha[lane] = scale;
        }
        workgroupBarrier();
        own = vec4<f32>(0.0);
        if lane < STRIDE {
            let scale = vec4<f32>(alpha[column], alpha[column + 1u], alpha[column + 2u], alpha[column + 3u]);
            for (var e = lane; e < count; e += STRIDE) {
                rough[y + e] += scale * rough[p + e];
                let left = rough[r + e] - scale * rough[q + e];
                rough[r + e] = left;
                own += left * left;
            }
        }
        sum_columns(lane, own);
        if lane < PADDED {
            let next = totals[lane];
            var scale = 0.0;
            if goes[lane] != 0u {
                scale = next / gamma[lane];
                gamma[lane] = next;
                if lane == probe {
                    answers[history] = num(f32(iteration + 1u));
                    answers[history + 2u * iteration + 1u] = num(alpha[lane]);
                    answers[history + 2u * iteration + 2u] = num(scale);
                }
                if next <= scene.rough_end {
                    goes[lane] = 0u;
                }
            }
            beta[lane] = scale;
        }
        workgroupBarrier();
        if lane == 0u {
            going = 0u;
            for (var k = 0u; k < WIDE; k++) {
                going += goes[k];
            }
            taken += 1u;
        }
        if lane < STRIDE {
            let scale = vec4<f32>(beta[column], beta[column + 1u], beta[column + 2u], beta[column + 3u]);
            for (var e = lane; e < count; e += STRIDE) {
                rough[p + e] = rough[r + e] + scale * rough[p + e];
            }
        }
        workgroupBarrier();
        if going == 0u {
            break;
        }
    }
    storageBarrier();
    workgroupBarrier();
}
