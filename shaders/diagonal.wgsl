// scaling_j = 1/√(Σ_i K_ij² + D_j²): the Jacobi preconditioner, images counted with their source. Twin:
// the column norms of coupling::full's System.

//! uses: vector flux normal potential pairs faces tile faces_tile
//! constants:

@group(1) @binding(0) var<storage, read> damping: array<real>;           // [source]: D²
@group(1) @binding(1) var<storage, read_write> scaling: array<real>;     // [source]

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let own = blocks[sizes.face_blocks + group.x];
    let j = own.y + min(lane, own.z - 1u);
    var sum = damping[j];
    for (var b = 0u; b < sizes.face_blocks; b++) {
        let other = blocks[b];
        workgroupBarrier();
        if lane < other.z {
            load_tile(lane, other.y + lane);
        }
        workgroupBarrier();
        for (var i = 0u; i < other.z; i++) {
            let face = tile_face(i);
            var entry = num(0.0);
            for (var image = 0u; image < sizes.images; image++) {
                if seen_by_rows(other.x, own.x, image) {
                    entry = add(entry, row(face, other.w, source_at(image, j)));
                }
            }
            entry = mul(face.weight, entry);
            sum = add(sum, mul(entry, entry));
        }
    }
    if lane < own.z {
        scaling[j] = div(num(1.0), root(sum));
    }
}
