// Many scenes: what the charges that batch_solve.wgsl left pull with at each point, F = −Σ w ∇P α, and the wrenches of pairs of
// columns on every body, Σ (f, x × f) with f = α_x F_y + α_y F_x: of all pairs x ≥ y; or, where WIDE is one more than
// COLUMNS, of each with a combination of the slot's own columns. Twins: coupling::reduced's pull_back_columns, pull_back_pairs.

//! uses: vector batch
//! constants: LANES COLUMNS WIDE

const DIRECTIONS: u32 = 1u;
const PULLS: u32 = 3u * (COLUMNS + 1u);

var<workgroup> tile_charges: array<real, TILE * WIDE>;

fn charge(base: u32, i: u32, k: u32) -> real {
    if k < COLUMNS {
        return work[base + charge_part() + i * COLUMNS + k];
    }
    return work[base + direction_part() + i];
}

fn pull_at(base: u32, i: u32, k: u32) -> V3 {
    let at = base + pull_part() + 3u * i * WIDE + k;
    return V3(work[at], work[at + WIDE], work[at + 2u * WIDE]);
}

// [question]: coefficients of the combination on the basis. Answers: [body][pair][6], over 4π, about the scene's middle.
@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let question = group.x;
    let slot = slots[question];
    let base = question * work_size();
    if WIDE > COLUMNS {
        for (var i = lane; i < scene.points; i += LANES) {
            var sum = num(0.0);
            for (var k = 0u; k < scene.columns; k++) {
                let own = charges[(slot * scene.points + i) * scene.columns + k];
                sum = add(sum, mul(own, inputs[question * scene.columns + k]));
            }
            work[base + direction_part() + i] = sum;
        }
    }
    storageBarrier();
    for (var start = 0u; start < scene.points; start += LANES) {
        let i = min(start + lane, scene.points - 1u);
        let body = owner(i);
        let at = point_at(slot, 0u, i);
        var pulls: array<V3, WIDE>;
        for (var k = 0u; k < WIDE; k++) {
            pulls[k] = v_zero();
        }
        for (var b = 0u; b < scene.blocks; b++) {
            let other = block_at(b);
            for (var image = 0u; image < scene.images; image++) {
                workgroupBarrier();
                if lane < other.count {
                    put_place(lane, point_at(slot, image, other.first + lane));
                    for (var k = 0u; k < WIDE; k++) {
                        tile_charges[lane * WIDE + k] = charge(base, other.first + lane, k);
                    }
                }
                workgroupBarrier();
                let weight = neg(fixed[weight_at(image, body, other.body)]);
                if narrow(weight) != 0.0 {
                    for (var j = 0u; j < other.count; j++) {
                        let r = v_sub(at, place_at(j));
                        let inverse = inverse_root(v_dot(r, r));
                        let pull = v_scale(mul(weight, mul(inverse, mul(inverse, inverse))), r);
                        for (var k = 0u; k < WIDE; k++) {
                            pulls[k] = v_fused(tile_charges[j * WIDE + k], pull, pulls[k]);
                        }
                    }
                }
            }
        }
        if start + lane < scene.points {
            let to = base + pull_part() + 3u * i * WIDE;
            for (var k = 0u; k < WIDE; k++) {
                work[to + k] = pulls[k].x;
                work[to + WIDE + k] = pulls[k].y;
                work[to + 2u * WIDE + k] = pulls[k].z;
            }
        }
    }
    storageBarrier();
    var pairs = COLUMNS * (COLUMNS + 1u) / 2u;
    if WIDE > COLUMNS {
        pairs = COLUMNS;
    }
    for (var e = lane; e < scene.bodies * pairs; e += LANES) {
        let body = body_at(e / pairs);
        let pair = e % pairs;
        var x = pair;
        var y = COLUMNS;
        if WIDE == COLUMNS {
            x = 0u;
            while (x + 1u) * (x + 2u) / 2u <= pair {
                x += 1u;
            }
            y = pair - x * (x + 1u) / 2u;
        }
        var force = v_zero();
        var moment = v_zero();
        for (var i = body.point; i < body.point + body.points; i++) {
            let f = v_fused(charge(base, i, x), pull_at(base, i, y), v_scale(charge(base, i, y), pull_at(base, i, x)));
            force = v_add(force, f);
            moment = v_add(moment, v_cross(point_at(slot, 0u, i), f));
        }
        let to = 6u * (question * scene.bodies * pairs + e);
        answers[to] = force.x;
        answers[to + 1u] = force.y;
        answers[to + 2u] = force.z;
        answers[to + 3u] = moment.x;
        answers[to + 4u] = moment.y;
        answers[to + 5u] = moment.z;
    }
}
