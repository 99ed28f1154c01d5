// The derivative of the energies of pairs of columns (x, y) of coupled panels, as a wrench on the centroids of a pair of bodies:
//
//   F_x(s) = Σ_i { q_ix ∇S_i − φ_ix ∇D_i }             over the panels of one body
//   W(x, y) = Σ_s (f, s × f),   f = F_x μ_y           over a block of centroids
//
// about the scene's middle. Twins: coupling::panel's pair_tensor; adjoint kernel::{single_vjp, double_vjp}.

//! uses: vector flux layers pairs panels tile panels_tile wrenches
//! constants: LEFT

@group(1) @binding(0) var<storage, read> left: array<real>;       // [panel][2·columns]: φ, q
@group(1) @binding(1) var<storage, read> right: array<real>;      // [centroid][columns]: μ

var<workgroup> densities: array<real, BLOCK * 2u * LEFT>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = group.y * groups.x + group.x;
    if number >= task.tasks {
        return;
    }
    let mine = tasks[task.first_task + number];
    let own = blocks[sizes.face_blocks + mine.x];
    let s = source_at(mine.y, own.y + min(lane, own.z - 1u));
    let columns = task.columns;
    var fields: array<V3, LEFT>;
    for (var x = 0u; x < LEFT; x++) {
        fields[x] = v_zero();
    }
    for (var b = mine.z; b < mine.w; b++) {
        let other = blocks[b];
        let seen_by = way(other.x, own.x, mine.y, other.w);
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            for (var x = 0u; x < LEFT; x++) {
                let at = i * 2u * columns + min(task.first + x, columns - 1u);
                densities[(lane * 2u) * LEFT + x] = left[at];
                densities[(lane * 2u + 1u) * LEFT + x] = left[at + columns];
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < other.z; i++) {
            let panel = tile_face(i);
            let slopes = layers_gradient(panel, s);
            let k = signed_vector(seen_by, slopes.double);
            let p = signed_vector(seen_by, slopes.single);
            for (var x = 0u; x < LEFT; x++) {
                let phi = densities[(i * 2u) * LEFT + x];
                let q = densities[(i * 2u + 1u) * LEFT + x];
                fields[x] = v_add(fields[x], v_sub(v_scale(q, p), v_scale(phi, k)));
            }
        }
    }
    for (var x = 0u; x < LEFT; x++) {
        workgroupBarrier();
        put(lane, 0u, fields[x]);
        put(lane, 3u, v_cross(s, fields[x]));
        workgroupBarrier();
        for (var at = lane; at < 6u * columns; at += BLOCK) {
            let y = at / 6u;
            let c = at % 6u;
            var sum = num(0.0);
            for (var l = 0u; l < own.z; l++) {
                sum = add(sum, mul(tile[12u * l + c], right[(own.y + l) * columns + y]));
            }
            out[((number * LEFT + x) * columns + y) * 6u + c] = sum;
        }
    }
}
