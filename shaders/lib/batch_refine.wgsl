// (I − LᵀGL) a = b in the fine arithmetic, round by round: with the charges α = Ū x + L a and their potentials ψ = G α the
// residual is Lᵀψ − a. In a tangent the charges are L a alone, and ψ = G α + given.
//
// What it leaves: a, α and ψ in `work`.

var<workgroup> tile_charges: array<real, TILE * COLUMNS>;
var<workgroup> largest: array<f32, PADDED>;
var<workgroup> worst: f32;

fn expand(base: u32, twists: u32, solved: bool, lane: u32) {
    for (var i = lane; i < scene.points; i += LANES) {
        let b = owner(i);
        let body = body_at(b);
        let row = scene.across + body.table + i - body.point;
        var sums: array<real, COLUMNS>;
        for (var k = 0u; k < COLUMNS; k++) {
            sums[k] = num(0.0);
        }
        if solved {
            for (var m = 0u; m < body.modes; m++) {
                let entry = fixed[row + m * body.points];
                let begin = base + (body.mode + m) * COLUMNS;
                for (var k = 0u; k < COLUMNS; k++) {
                    sums[k] = add(sums[k], mul(entry, work[begin + k]));
                }
            }
        }
        if !TANGENT {
            for (var c = 0u; c < 6u; c++) {
                let entry = fixed[row + (body.modes + c) * body.points];
                let begin = twists + (6u * b + c) * COLUMNS;
                for (var k = 0u; k < COLUMNS; k++) {
                    sums[k] = add(sums[k], mul(entry, inputs[begin + k]));
                }
            }
        }
        for (var k = 0u; k < COLUMNS; k++) {
            work[base + charge_part() + i * COLUMNS + k] = sums[k];
        }
    }
}

fn gather(base: u32, slot: u32, given: u32, lane: u32) {
    for (var start = 0u; start < scene.points; start += LANES) {
        let i = min(start + lane, scene.points - 1u);
        let body = owner(i);
        let at = point_at(slot, 0u, i);
        var sums: array<real, COLUMNS>;
        for (var k = 0u; k < COLUMNS; k++) {
            sums[k] = num(0.0);
            if TANGENT {
                sums[k] = work[given + i * COLUMNS + k];
            }
        }
        for (var b = 0u; b < scene.blocks; b++) {
            let other = block_at(b);
            for (var image = 0u; image < scene.images; image++) {
                workgroupBarrier();
                if lane < other.count {
                    put_place(lane, point_at(slot, image, other.first + lane));
                    let j = base + charge_part() + (other.first + lane) * COLUMNS;
                    for (var k = 0u; k < COLUMNS; k++) {
                        tile_charges[lane * COLUMNS + k] = work[j + k];
                    }
                }
                workgroupBarrier();
                let weight = fixed[weight_at(image, body, other.body)];
                if narrow(weight) != 0.0 {
                    for (var j = 0u; j < other.count; j++) {
                        let entry = mul(weight, near(at, place_at(j)));
                        for (var k = 0u; k < COLUMNS; k++) {
                            sums[k] = add(sums[k], mul(entry, tile_charges[j * COLUMNS + k]));
                        }
                    }
                }
            }
        }
        if start + lane < scene.points {
            for (var k = 0u; k < COLUMNS; k++) {
                work[base + potential_part() + i * COLUMNS + k] = sums[k];
            }
        }
    }
}

// The residual, which conjugate gradients take in single precision; in the first round the probe beside it.
fn project(base: u32, rough_base: u32, first: bool, lane: u32) {
    for (var m = lane; m < scene.modes; m += LANES) {
        let body = body_at(mode_owner(m));
        let column = scene.table + body.table + m - body.mode;
        var sums: array<real, COLUMNS>;
        for (var k = 0u; k < COLUMNS; k++) {
            sums[k] = num(0.0);
        }
        for (var i = 0u; i < body.points; i++) {
            let entry = fixed[column + i * (body.modes + 6u)];
            let begin = base + potential_part() + (body.point + i) * COLUMNS;
            for (var k = 0u; k < COLUMNS; k++) {
                sums[k] = add(sums[k], mul(entry, work[begin + k]));
            }
        }
        var left: array<vec4<f32>, QUADS>;
        for (var k = 0u; k < QUADS; k++) {
            left[k] = vec4<f32>(0.0);
        }
        for (var k = 0u; k < COLUMNS; k++) {
            left[k / 4u][k % 4u] = narrow(sub(sums[k], work[base + m * COLUMNS + k]));
        }
        if WIDE > COLUMNS && first {
            left[(WIDE - 1u) / 4u][(WIDE - 1u) % 4u] = fixed_single[scene.probe + m];
        }
        for (var k = 0u; k < QUADS; k++) {
            rough[rough_base + m * QUADS + k] = left[k];
        }
    }
}

// Momenta Ūᵀψ, [body][6][column].
fn read_out(base: u32, to: u32, lane: u32) {
    for (var e = lane; e < 6u * scene.bodies * COLUMNS; e += LANES) {
        let row = e / COLUMNS;
        let k = e % COLUMNS;
        let body = body_at(row / 6u);
        let column = scene.across + body.table + (body.modes + row % 6u) * body.points;
        let begin = base + potential_part() + body.point * COLUMNS + k;
        var sum = num(0.0);
        for (var i = 0u; i < body.points; i++) {
            sum = add(sum, mul(fixed[column + i], work[begin + i * COLUMNS]));
        }
        answers[to + e] = sum;
    }
}

// `status`: columns that aren't solved, columns with a direction of no positive curvature, iterations, the largest residual; then the
// probe's history.
fn refine(question: u32, slot: u32, twists: u32, given: u32, status: u32, lane: u32) {
    let base = question * work_size();
    let rough_base = question * rough_size();
    let probe = select(WIDE, COLUMNS, WIDE > COLUMNS);
    for (var e = lane; e < scene.modes * COLUMNS; e += LANES) {
        work[base + e] = num(0.0);
    }
    if lane < PADDED {
        bent[lane] = 0u;
        largest[lane] = 0.0;
    }
    if lane == 0u {
        taken = 0u;
        if WIDE > COLUMNS {
            answers[status + 4u] = num(0.0);
        }
    }
    for (var turn = 0u; turn < scene.rounds; turn++) {
        storageBarrier();
        expand(base, twists, turn > 0u, lane);
        storageBarrier();
        gather(base, slot, given, lane);
        storageBarrier();
        project(base, rough_base, turn == 0u, lane);
        storageBarrier();
        let count = scene.modes * QUADS;
        var own = vec4<f32>(0.0);
        if lane < STRIDE {
            for (var e = lane; e < count; e += STRIDE) {
                own += rough[rough_base + e] * rough[rough_base + e];
            }
        }
        sum_columns(lane, own);
        if lane < PADDED {
            let square = totals[lane];
            if turn == 0u {
                largest[lane] = square;
            }
            var go = 0u;
            if lane < COLUMNS {
                // Also what isn't a number.
                if !(square <= scene.end * largest[lane]) {
                    go = 1u;
                }
            } else if turn == 0u && lane < WIDE {
                go = 1u;
            }
            goes[lane] = go;
            size[lane] = sqrt(square);
            // What a round multiplies by.
            alpha[lane] = 0.0;
            if go != 0u {
                alpha[lane] = 1.0 / sqrt(square);
            }
        }
        workgroupBarrier();
        if lane == 0u {
            going = 0u;
            worst = 0.0;
            for (var k = 0u; k < WIDE; k++) {
                going += goes[k];
                if k < COLUMNS && largest[k] > 0.0 {
                    worst = max(worst, totals[k] / largest[k]);
                }
            }
        }
        workgroupBarrier();
        if going == 0u || turn + 1u == scene.rounds {
            break;
        }
        for (var e = lane; e < count; e += LANES) {
            let k = 4u * (e % QUADS);
            rough[rough_base + e] *= vec4<f32>(alpha[k], alpha[k + 1u], alpha[k + 2u], alpha[k + 3u]);
        }
        storageBarrier();
        workgroupBarrier();
        rough_solve(rough_base, slot, lane, probe, status + 4u);
        for (var e = lane; e < scene.modes * COLUMNS; e += LANES) {
            let k = e % COLUMNS;
            let y = rough[rough_base + 3u * count + (e / COLUMNS) * QUADS + k / 4u][k % 4u];
            work[base + e] = add(work[base + e], mul(num(size[k]), num(y)));
        }
    }
    storageBarrier();
    if lane == 0u {
        var straight = 0u;
        for (var k = 0u; k < WIDE; k++) {
            straight += bent[k];
        }
        answers[status] = num(f32(going));
        answers[status + 1u] = num(f32(straight));
        answers[status + 2u] = num(f32(taken));
        answers[status + 3u] = num(sqrt(worst));
    }
}
