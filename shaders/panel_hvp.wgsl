// The tangent of panel_vjp.wgsl as the bodies are displaced, with the tangents of the densities:
//
//   δF_x = Σ_i { q_ix ∇∇S_i d − φ_ix ∇∇D_i d − δφ_ix ∇D_i }
//   f = F_x μ_y,   δf = δF_x μ_y + F_x δμ_y
//   W = Σ_s (f, s × f),   δW = Σ_s (δf, d × f + s × δf)
//
// Twins: coupling::panel's pair_tangent; adjoint kernel::{single_hvp, double_hvp}.

//! uses: vector flux layers pairs panels tile panels_tile motion wrenches
//! constants: LEFT

@group(1) @binding(0) var<storage, read> left: array<real>;       // [panel][3·LEFT]: φ, q, δφ
@group(1) @binding(1) var<storage, read> right: array<real>;      // [centroid][2·LEFT]: μ, δμ

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
    let d = displacement(relative_motion(blocks[mine.z].x, own.x, mine.y), s);
    var fields: array<V3, LEFT>;
    var dfields: array<V3, LEFT>;
    for (var x = 0u; x < LEFT; x++) {
        fields[x] = v_zero();
        dfields[x] = v_zero();
    }
    for (var b = mine.z; b < mine.w; b++) {
        let other = blocks[b];
        let seen_by = way(other.x, own.x, mine.y, other.w);
        workgroupBarrier();
        if lane < other.z {
            let i = other.y + lane;
            load_tile(lane, i);
            for (var k = 0u; k < 3u * LEFT; k++) {
                var density = left[i * 3u * LEFT + k];
                if seen_by == NEGATIVE {
                    density = neg(density);
                }
                densities[lane * 3u * LEFT + k] = density;
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < other.z; i++) {
            let layers = layers_hessian_product(tile_face(i), s, d);
            let p = layers.single;
            let k = layers.double;
            for (var x = 0u; x < LEFT; x++) {
                let at = i * 3u * LEFT + x;
                let phi = densities[at];
                let q = densities[at + LEFT];
                let dphi = densities[at + 2u * LEFT];
                fields[x] = v_add(fields[x], v_sub(v_scale(q, p.gradient), v_scale(phi, k.gradient)));
                let bent = v_sub(v_scale(q, p.product), v_scale(phi, k.product));
                dfields[x] = v_add(dfields[x], v_sub(bent, v_scale(dphi, k.gradient)));
            }
        }
    }
    for (var x = 0u; x < LEFT; x++) {
        for (var y = 0u; y < LEFT; y++) {
            let mu = right[j * 2u * LEFT + y];
            let dmu = right[j * 2u * LEFT + LEFT + y];
            let f = v_scale(mu, fields[x]);
            let df = v_fused(mu, dfields[x], v_scale(dmu, fields[x]));
            leave(lane, own.z, ((number * LEFT + x) * LEFT + y) * 12u, s, d, f, df);
        }
    }
}
