// The faces that a workgroup works on, in its own memory.

var<workgroup> tile: array<real, BLOCK * FACE>;

fn load_tile(lane: u32, i: u32) {
    for (var k = 0u; k < FACE; k++) {
        tile[lane * FACE + k] = faces[i * FACE + k];
    }
}
