// Many scenes: the tangent of one or two combinations of the slot's columns as the bodies are displaced. With δG α the solution
// changes by (I − LᵀGL) δa = Lᵀ δG α, δα = L δa; momenta Ūᵀ(δG α + G δα); the first combination's energy with the last has a
// wrench on every body, and that has a tangent:
//
//   F = −Σ w ∇P α_j,    δF = −Σ w (∇∇P d α_j + ∇P δα_j),    d the displacement of the source less that of the point
//   f = α_x F_y + α_y F_x,    W = Σ (f, x × f),    δW = Σ (δf, δx × f + x × δf)
//
// Twin: coupling::reduced's second.

//! uses: vector batch batch_rough batch_refine
//! constants: LANES COLUMNS WIDE QUADS

const TANGENT: bool = true;
// Charges of the combinations, and δG α.
const DIRECTIONS: u32 = 2u * COLUMNS;
const PULLS: u32 = 12u;

var<workgroup> shifts: array<real, 192>;
var<workgroup> tile_changes: array<real, TILE * COLUMNS>;

// u + w × s.
fn displaced(motions: u32, image: u32, body: u32, s: V3) -> V3 {
    let k = motions + 6u * (image * scene.bodies + body);
    let u = V3(inputs[k], inputs[k + 1u], inputs[k + 2u]);
    let w = V3(inputs[k + 3u], inputs[k + 4u], inputs[k + 5u]);
    return v_add(u, v_cross(w, s));
}

fn put_shift(j: u32, v: V3) {
    shifts[3u * j] = v.x;
    shifts[3u * j + 1u] = v.y;
    shifts[3u * j + 2u] = v.z;
}

fn shift_at(j: u32) -> V3 {
    return V3(shifts[3u * j], shifts[3u * j + 1u], shifts[3u * j + 2u]);
}

fn put(at: u32, v: V3) {
    work[at] = v.x;
    work[at + 1u] = v.y;
    work[at + 2u] = v.z;
}

// A block of sources with its displacements and charges.
fn load(slot: u32, motions: u32, image: u32, other: Block, own: u32, change: u32, lane: u32) {
    workgroupBarrier();
    if lane < other.count {
        let s = point_at(slot, image, other.first + lane);
        put_place(lane, s);
        put_shift(lane, displaced(motions, image, other.body, s));
        let j = (other.first + lane) * COLUMNS;
        for (var k = 0u; k < COLUMNS; k++) {
            tile_charges[lane * COLUMNS + k] = work[own + j + k];
            tile_changes[lane * COLUMNS + k] = work[change + j + k];
        }
    }
    workgroupBarrier();
}

// [question]: coefficients on the basis [column of the basis][COLUMNS], spatial twists of the displacement [image][body][6].
// Answers: momenta [body][6][COLUMNS], [body][W, δW: 12], the status [4].
@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let question = group.x;
    let slot = slots[question];
    let base = question * work_size();
    let coefficients = question * (scene.columns * COLUMNS + 6u * scene.images * scene.bodies);
    let motions = coefficients + scene.columns * COLUMNS;
    let count = 6u * scene.bodies * COLUMNS;
    let to = question * (count + 12u * scene.bodies + 4u);
    let own = base + direction_part();
    let given = own + scene.points * COLUMNS;
    for (var e = lane; e < scene.points * COLUMNS; e += LANES) {
        var sum = num(0.0);
        for (var k = 0u; k < scene.columns; k++) {
            let charge = charges[(slot * scene.points + e / COLUMNS) * scene.columns + k];
            sum = add(sum, mul(charge, inputs[coefficients + k * COLUMNS + e % COLUMNS]));
        }
        work[own + e] = sum;
    }
    storageBarrier();
    for (var start = 0u; start < scene.points; start += LANES) {
        let i = min(start + lane, scene.points - 1u);
        let body = owner(i);
        let at = point_at(slot, 0u, i);
        let moved = displaced(motions, 0u, body, at);
        var sums: array<real, COLUMNS>;
        for (var k = 0u; k < COLUMNS; k++) {
            sums[k] = num(0.0);
        }
        for (var b = 0u; b < scene.blocks; b++) {
            let other = block_at(b);
            for (var image = 0u; image < scene.images; image++) {
                load(slot, motions, image, other, own, own, lane);
                let weight = fixed[weight_at(image, body, other.body)];
                if narrow(weight) != 0.0 {
                    for (var j = 0u; j < other.count; j++) {
                        let r = v_sub(at, place_at(j));
                        let inverse = inverse_root(v_dot(r, r));
                        let cube = mul(inverse, mul(inverse, inverse));
                        let entry = mul(mul(weight, cube), v_dot(r, v_sub(shift_at(j), moved)));
                        for (var k = 0u; k < COLUMNS; k++) {
                            sums[k] = add(sums[k], mul(entry, tile_charges[j * COLUMNS + k]));
                        }
                    }
                }
            }
        }
        if start + lane < scene.points {
            for (var k = 0u; k < COLUMNS; k++) {
                work[given + i * COLUMNS + k] = sums[k];
            }
        }
    }
    storageBarrier();
    refine(question, slot, 0u, given, to + count + 12u * scene.bodies, lane);
    read_out(base, to, lane);
    for (var start = 0u; start < scene.points; start += LANES) {
        let i = min(start + lane, scene.points - 1u);
        let body = owner(i);
        let at = point_at(slot, 0u, i);
        let moved = displaced(motions, 0u, body, at);
        var pulls: array<V3, COLUMNS>;
        var dpulls: array<V3, COLUMNS>;
        for (var k = 0u; k < COLUMNS; k++) {
            pulls[k] = v_zero();
            dpulls[k] = v_zero();
        }
        for (var b = 0u; b < scene.blocks; b++) {
            let other = block_at(b);
            for (var image = 0u; image < scene.images; image++) {
                load(slot, motions, image, other, own, base + charge_part(), lane);
                let weight = neg(fixed[weight_at(image, body, other.body)]);
                if narrow(weight) != 0.0 {
                    for (var j = 0u; j < other.count; j++) {
                        let r = v_sub(at, place_at(j));
                        let d = v_sub(shift_at(j), moved);
                        let inverse = inverse_root(v_dot(r, r));
                        let square = mul(inverse, inverse);
                        let cube = mul(weight, mul(inverse, square));
                        let pull = v_scale(cube, r);
                        // {−d + 3 (r·d) r/r²}/r³.
                        let along = mul(mul(num(3.0), v_dot(r, d)), square);
                        let dpull = v_scale(cube, v_sub(v_scale(along, r), d));
                        for (var k = 0u; k < COLUMNS; k++) {
                            let charge = tile_charges[j * COLUMNS + k];
                            pulls[k] = v_fused(charge, pull, pulls[k]);
                            dpulls[k] = v_fused(charge, dpull, v_fused(tile_changes[j * COLUMNS + k], pull, dpulls[k]));
                        }
                    }
                }
            }
        }
        if start + lane < scene.points {
            let last = COLUMNS - 1u;
            let ax = work[own + i * COLUMNS];
            let ay = work[own + i * COLUMNS + last];
            let dax = work[base + charge_part() + i * COLUMNS];
            let day = work[base + charge_part() + i * COLUMNS + last];
            let f = v_fused(ax, pulls[last], v_scale(ay, pulls[0]));
            var df = v_fused(dax, pulls[last], v_scale(day, pulls[0]));
            df = v_fused(ax, dpulls[last], v_fused(ay, dpulls[0], df));
            let part = base + pull_part() + 12u * i;
            put(part, f);
            put(part + 3u, v_cross(at, f));
            put(part + 6u, df);
            put(part + 9u, v_add(v_cross(moved, f), v_cross(at, df)));
        }
    }
    storageBarrier();
    for (var e = lane; e < 12u * scene.bodies; e += LANES) {
        let body = body_at(e / 12u);
        var sum = num(0.0);
        for (var i = body.point; i < body.point + body.points; i++) {
            sum = add(sum, work[base + pull_part() + 12u * i + e % 12u]);
        }
        answers[to + count + e] = sum;
    }
}
