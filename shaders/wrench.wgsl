// The wrench on every body of the forces between two columns' charges, about the scene's middle:
//
//   f = α_x F_y + α_y F_x at each point,    g = α_x D_y + α_y D_x at the body's centre c
//   W = Σ (f, x × f) + (g, c × g)
//   δW = Σ (δf, δx × f + x × δf) + (δg, δc × g + c × δg)
//
// with the pulls F, D of coulomb_vjp.wgsl, or those and their tangents of coulomb_hvp.wgsl. A workgroup makes
// one pair of columns on one body. Twin: coupling::pair's wrench.

//! uses: vector displaced
//! constants: FADING TANGENT

struct Sizes { points: u32, bodies: u32, images: u32, blocks: u32 }
struct Task { left: u32, right: u32, pad0: u32, pad1: u32 }

@group(0) @binding(0) var<storage, read> points: array<real>;          // [image][point][3]
@group(0) @binding(1) var<storage, read> bodies: array<vec4<u32>>;     // first point, points, first mode, modes
@group(0) @binding(2) var<storage, read> centres: array<real>;         // [body][3]
@group(0) @binding(3) var<uniform> sizes: Sizes;
@group(1) @binding(0) var<storage, read> alpha_left: array<real>;      // [point][left]
@group(1) @binding(1) var<storage, read> pull_left: array<real>;       // [point][width][left]
@group(1) @binding(2) var<storage, read> alpha_right: array<real>;     // [point][right]
@group(1) @binding(3) var<storage, read> pull_right: array<real>;      // [point][width][right]
@group(1) @binding(4) var<storage, read> change_left: array<real>;     // [point][left]: δα
@group(1) @binding(5) var<storage, read> change_right: array<real>;    // [point][right]
@group(1) @binding(6) var<storage, read_write> out: array<real>;       // [body][left][right][6 or 12]
@group(1) @binding(7) var<uniform> task: Task;

var<workgroup> parts: array<real, 768>;

// Vector `v` of a point's pulls.
fn left_at(i: u32, width: u32, v: u32, k: u32) -> V3 {
    let at = (i * width + 3u * v) * task.left + k;
    return V3(pull_left[at], pull_left[at + task.left], pull_left[at + 2u * task.left]);
}

fn right_at(i: u32, width: u32, v: u32, k: u32) -> V3 {
    let at = (i * width + 3u * v) * task.right + k;
    return V3(pull_right[at], pull_right[at + task.right], pull_right[at + 2u * task.right]);
}

fn put(lane: u32, at: u32, v: V3) {
    parts[12u * lane + at] = v.x;
    parts[12u * lane + at + 1u] = v.y;
    parts[12u * lane + at + 2u] = v.z;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let body = bodies[group.x];
    let x = group.y;
    let y = group.z;
    // Vectors of a point's pulls: F, D, δF, δD as far as they are there.
    var vectors = 1u;
    if FADING {
        vectors = 2u;
    }
    var width = 3u * vectors;
    if TANGENT {
        width = 2u * width;
    }
    var force = v_zero();
    var moment = v_zero();
    var dforce = v_zero();
    var dmoment = v_zero();
    for (var l = lane; l < body.y; l += 64u) {
        let i = body.x + l;
        let ax = alpha_left[i * task.left + x];
        let ay = alpha_right[i * task.right + y];
        for (var v = 0u; v < vectors; v++) {
            var at = V3(points[3u * i], points[3u * i + 1u], points[3u * i + 2u]);
            if v == 1u {
                at = V3(centres[3u * group.x], centres[3u * group.x + 1u], centres[3u * group.x + 2u]);
            }
            let px = left_at(i, width, v, x);
            let py = right_at(i, width, v, y);
            let f = v_fused(ax, py, v_scale(ay, px));
            force = v_add(force, f);
            moment = v_add(moment, v_cross(at, f));
            if TANGENT {
                let dax = change_left[i * task.left + x];
                let day = change_right[i * task.right + y];
                let dpx = left_at(i, width, vectors + v, x);
                let dpy = right_at(i, width, vectors + v, y);
                var df = v_fused(dax, py, v_scale(day, px));
                df = v_fused(ax, dpy, v_fused(ay, dpx, df));
                let d = displaced(0u, group.x, at);
                dforce = v_add(dforce, df);
                dmoment = v_add(dmoment, v_add(v_cross(d, f), v_cross(at, df)));
            }
        }
    }
    put(lane, 0u, force);
    put(lane, 3u, moment);
    put(lane, 6u, dforce);
    put(lane, 9u, dmoment);
    workgroupBarrier();
    var count = 6u;
    if TANGENT {
        count = 12u;
    }
    if lane < count {
        var sum = num(0.0);
        for (var l = 0u; l < 64u; l++) {
            sum = add(sum, parts[12u * l + lane]);
        }
        out[((group.x * task.left + x) * task.right + y) * count + lane] = sum;
    }
}
