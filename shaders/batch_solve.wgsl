// Many scenes: each one's bodies solved for COLUMNS columns of twists. With PLACE the points are placed first, and what
// derivatives ask for stays in the scene's slot: the points, and the charges of the columns; a probe beside the columns
// tells of the condition number. Otherwise the slot's points are taken as they are.
//
// Twin: coupling::reduced's ReducedLinearised::new.

//! uses: vector batch batch_rough batch_refine
//! constants: LANES COLUMNS WIDE QUADS PLACE

const TANGENT: bool = false;
const DIRECTIONS: u32 = 1u;
const PULLS: u32 = 3u * (COLUMNS + 1u);

fn rotated(k: u32, v: V3) -> V3 {
    return V3(
        v_dot(V3(inputs[k], inputs[k + 1u], inputs[k + 2u]), v),
        v_dot(V3(inputs[k + 3u], inputs[k + 4u], inputs[k + 5u]), v),
        v_dot(V3(inputs[k + 6u], inputs[k + 7u], inputs[k + 8u]), v),
    );
}

fn moved(k: u32, v: V3) -> V3 {
    return v_add(rotated(k, v), V3(inputs[k + 9u], inputs[k + 10u], inputs[k + 11u]));
}

// [question]: poses of the bodies [12], of the images [12], twists [body][6][COLUMNS]; the last alone without PLACE.
// Answers: momenta [body][6][COLUMNS], the status [4]; with PLACE the probe's history [1 + 2 steps].
@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let question = group.x;
    let slot = slots[question];
    let count = 6u * scene.bodies * COLUMNS;
    var twists = question * count;
    var to = question * (count + 4u);
    if PLACE {
        let poses = question * (12u * (scene.bodies + scene.images) + count);
        twists = poses + 12u * (scene.bodies + scene.images);
        to = question * (count + 5u + 2u * scene.steps);
        for (var i = lane; i < scene.points; i += LANES) {
            let shape = 3u * indices[2u * i + 1u];
            let at = moved(poses + 12u * owner(i), V3(fixed[shape], fixed[shape + 1u], fixed[shape + 2u]));
            for (var image = 0u; image < scene.images; image++) {
                let v = moved(poses + 12u * (scene.bodies + image), at);
                let k = 3u * ((slot * scene.images + image) * scene.points + i);
                points[k] = v.x;
                points[k + 1u] = v.y;
                points[k + 2u] = v.z;
            }
        }
    }
    storageBarrier();
    refine(question, slot, twists, 0u, to + count, lane);
    let base = question * work_size();
    if PLACE {
        for (var e = lane; e < scene.points * COLUMNS; e += LANES) {
            charges[slot * scene.points * COLUMNS + e] = work[base + charge_part() + e];
        }
    }
    read_out(base, to, lane);
}
