// The tangent of pair_vjp.wgsl as the bodies are displaced, with the tangents of the densities:
//
//   δq_x = Σ_i { β_ix ∇∇P_i d − w_i (μ_ix ∇∇K_i d + δμ_ix ∇K_i) },   δρ_x = Σ_i w_i (r_ix ∇∇K_i d + δr_ix ∇K_i)
//   f = q_x a_y + ρ_x λ_y,   δf = δq_x a_y + q_x δa_y + δρ_x λ_y + ρ_x δλ_y
//   W = Σ_s (f, s × f),   δW = Σ_s (δf, d × f + s × δf)
//
// Twins: coupling::full's pair_tangent; adjoint kernel::{flux_hvp, normal_hvp, potential_hvp}.

//! uses: vector flux normal potential pairs faces tile faces_tile motion wrenches
//! constants: LEFT

@group(1) @binding(0) var<storage, read> left: array<real>;       // [face][5·LEFT]: μ, r, β, δμ, δr
@group(1) @binding(1) var<storage, read> right: array<real>;      // [source][4·LEFT]: a, λ, δa, δλ

var<workgroup> densities: array<real, BLOCK * 5u * LEFT>;

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
    let d = displacement(relative_motion(blocks[mine.z].x, own.x, mine.y), s);
    var charge: array<V3, LEFT>;
    var residual: array<V3, LEFT>;
    var dcharge: array<V3, LEFT>;
    var dresidual: array<V3, LEFT>;
    for (var x = 0u; x < LEFT; x++) {
        charge[x] = v_zero();
        residual[x] = v_zero();
        dcharge[x] = v_zero();
        dresidual[x] = v_zero();
    }
    for (var b = mine.z; b < mine.w; b++) {
        let other = blocks[b];
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            let weight = faces[i * FACE + 12u];
            for (var k = 0u; k < 5u * LEFT; k++) {
                var density = left[i * 5u * LEFT + k];
                // The potential's rows carry no weight.
                if k / LEFT != 2u {
                    density = mul(weight, density);
                }
                densities[lane * 5u * LEFT + k] = density;
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < other.z; i++) {
            let face = tile_face(i);
            let k = row_hessian_product(face, other.w, s, d);
            let p = potential_hessian_product(centre(face), s, d);
            for (var x = 0u; x < LEFT; x++) {
                let at = i * 5u * LEFT + x;
                let mu = densities[at];
                let r = densities[at + LEFT];
                let beta = densities[at + 2u * LEFT];
                let dmu = densities[at + 3u * LEFT];
                let dr = densities[at + 4u * LEFT];
                charge[x] = v_add(charge[x], v_sub(v_scale(beta, p.gradient), v_scale(mu, k.gradient)));
                residual[x] = v_fused(r, k.gradient, residual[x]);
                let bent = v_sub(v_scale(beta, p.product), v_scale(mu, k.product));
                dcharge[x] = v_add(dcharge[x], v_sub(bent, v_scale(dmu, k.gradient)));
                dresidual[x] = v_add(
                    dresidual[x],
                    v_add(v_scale(r, k.product), v_scale(dr, k.gradient)),
                );
            }
        }
    }
    for (var x = 0u; x < LEFT; x++) {
        for (var y = 0u; y < LEFT; y++) {
            let at = j * 4u * LEFT + y;
            let a = right[at];
            let lambda = right[at + LEFT];
            let da = right[at + 2u * LEFT];
            let dlambda = right[at + 3u * LEFT];
            let f = v_add(v_scale(a, charge[x]), v_scale(lambda, residual[x]));
            let df = v_add(
                v_add(v_scale(a, dcharge[x]), v_scale(lambda, dresidual[x])),
                v_add(v_scale(da, charge[x]), v_scale(dlambda, residual[x])),
            );
            leave(lane, own.z, ((number * LEFT + x) * LEFT + y) * 12u, s, d, f, df);
        }
    }
}
