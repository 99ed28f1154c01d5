// Body-frame impulses h_b = ½ {Σ_i (B̄_i φ_i + F̄_i μ_i) + Σ_j ρ_j a_j}, φ = P a, ρ = PᵀB̄ of the body itself.
// A workgroup sums one column of one body. Of panels B̄ are fluxes, F̄ normal velocities, μ stands for Sᵀμ and a for μ, and ρ is the
// body's own S F̄. Twins: coupling::full's and coupling::panel's impulse.

//! uses:
//! constants:

struct Task {
    columns: u32,
    phi_stride: u32,
    phi_offset: u32,
    mu_stride: u32,
    mu_offset: u32,
    a_stride: u32,
    a_offset: u32,
    pad: u32,
}

@group(0) @binding(0) var<storage, read> face_table: array<real>;      // [shape's face][12]: F̄, B̄
@group(0) @binding(1) var<storage, read> source_table: array<real>;    // [shape's source][6]: ρ
@group(0) @binding(2) var<storage, read> bodies: array<vec4<u32>>;     // first face, faces, first source, sources
@group(0) @binding(3) var<storage, read> shapes: array<vec2<u32>>;     // [body]: its shape's first face and source
@group(0) @binding(4) var<storage, read> phi: array<real>;             // [face][phi_stride]
@group(0) @binding(5) var<storage, read> mu: array<real>;              // [face][mu_stride]
@group(0) @binding(6) var<storage, read> a: array<real>;               // [source][a_stride]
@group(0) @binding(7) var<storage, read_write> out: array<real>;       // [body][6][columns]
@group(0) @binding(8) var<uniform> task: Task;

var<workgroup> parts: array<real, 384>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let body = bodies[group.x];
    let shape = shapes[group.x];
    let k = group.y;
    var h: array<real, 6>;
    for (var m = 0u; m < 6u; m++) {
        h[m] = num(0.0);
    }
    for (var i = lane; i < body.y; i += 64u) {
        let f = phi[(body.x + i) * task.phi_stride + task.phi_offset + k];
        let u = mu[(body.x + i) * task.mu_stride + task.mu_offset + k];
        let row = (shape.x + i) * 12u;
        for (var m = 0u; m < 6u; m++) {
            h[m] = add(h[m], add(mul(face_table[row + m], u), mul(face_table[row + 6u + m], f)));
        }
    }
    for (var j = lane; j < body.w; j += 64u) {
        let strength = a[(body.z + j) * task.a_stride + task.a_offset + k];
        let row = (shape.y + j) * 6u;
        for (var m = 0u; m < 6u; m++) {
            h[m] = add(h[m], mul(source_table[row + m], strength));
        }
    }
    for (var m = 0u; m < 6u; m++) {
        parts[6u * lane + m] = h[m];
    }
    workgroupBarrier();
    if lane < 6u {
        var sum = num(0.0);
        for (var l = 0u; l < 64u; l++) {
            sum = add(sum, parts[6u * l + lane]);
        }
        out[(group.x * 6u + lane) * task.columns + k] = mul(num(0.5), sum);
    }
}
