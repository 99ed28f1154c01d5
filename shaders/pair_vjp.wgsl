// The derivative of the energies of pairs of columns (x, y), as a wrench on the sources of a pair of bodies:
//
//   q_x(s) = Σ_i { β_ix ∇P_i − w_i μ_ix ∇K_i },   ρ_x(s) = Σ_i w_i r_ix ∇K_i     over the faces of one body
//   W(x, y) = Σ_s (f, s × f),   f = q_x a_y + ρ_x λ_y                          over a block of sources
//
// about the scene's middle. Left densities (μ, r, β) and right densities (a, λ) are contracted with the
// kernels' derivatives here; nothing of the size of a matrix is written. Twins: coupling::full's pair_tensor;
// adjoint kernel::{flux_vjp, normal_vjp, potential_vjp}.

//! uses: vector flux normal potential pairs faces tile faces_tile wrenches
//! constants: LEFT

@group(1) @binding(0) var<storage, read> left: array<real>;       // [face][3·columns]: μ, r, β
@group(1) @binding(1) var<storage, read> right: array<real>;      // [source][2·columns]: a, λ

var<workgroup> densities: array<real, BLOCK * 3u * LEFT>;

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
    let j = own.y + min(lane, own.z - 1u);
    let s = source_at(mine.y, j);
    let columns = task.columns;
    var charge: array<V3, LEFT>;
    var residual: array<V3, LEFT>;
    for (var x = 0u; x < LEFT; x++) {
        charge[x] = v_zero();
        residual[x] = v_zero();
    }
    for (var b = mine.z; b < mine.w; b++) {
        let other = blocks[b];
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            let weight = faces[i * FACE + 12u];
            for (var x = 0u; x < LEFT; x++) {
                let at = i * 3u * columns + min(task.first + x, columns - 1u);
                densities[(lane * 3u) * LEFT + x] = mul(weight, left[at]);
                densities[(lane * 3u + 1u) * LEFT + x] = mul(weight, left[at + columns]);
                densities[(lane * 3u + 2u) * LEFT + x] = left[at + 2u * columns];
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < other.z; i++) {
            let face = tile_face(i);
            let k = row_gradient(face, other.w, s);
            let p = potential_gradient(centre(face), s);
            for (var x = 0u; x < LEFT; x++) {
                let mu = densities[(i * 3u) * LEFT + x];
                let r = densities[(i * 3u + 1u) * LEFT + x];
                let beta = densities[(i * 3u + 2u) * LEFT + x];
                charge[x] = v_add(charge[x], v_sub(v_scale(beta, p), v_scale(mu, k)));
                residual[x] = v_fused(r, k, residual[x]);
            }
        }
    }
    for (var x = 0u; x < LEFT; x++) {
        workgroupBarrier();
        put(lane, 0u, charge[x]);
        put(lane, 3u, v_cross(s, charge[x]));
        put(lane, 6u, residual[x]);
        put(lane, 9u, v_cross(s, residual[x]));
        workgroupBarrier();
        for (var at = lane; at < 6u * columns; at += BLOCK) {
            let y = at / 6u;
            let c = at % 6u;
            var sum = num(0.0);
            for (var l = 0u; l < own.z; l++) {
                let row = (own.y + l) * 2u * columns;
                sum = add(sum, mul(tile[12u * l + c], right[row + y]));
                sum = add(sum, mul(tile[12u * l + 6u + c], right[row + columns + y]));
            }
            out[((number * LEFT + x) * columns + y) * 6u + c] = sum;
        }
    }
}
