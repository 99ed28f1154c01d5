// The faces that a workgroup works on, in its own memory.

var<workgroup> tile: array<real, BLOCK * FACE>;

fn tile_face(i: u32) -> Face {
    let k = i * FACE;
    return Face(
        V3(tile[k], tile[k + 1u], tile[k + 2u]),
        V3(tile[k + 3u], tile[k + 4u], tile[k + 5u]),
        V3(tile[k + 6u], tile[k + 7u], tile[k + 8u]),
        V3(tile[k + 9u], tile[k + 10u], tile[k + 11u]),
        tile[k + 12u],
    );
}

fn load_tile(lane: u32, i: u32) {
    for (var k = 0u; k < FACE; k++) {
        tile[lane * FACE + k] = faces[i * FACE + k];
    }
}
