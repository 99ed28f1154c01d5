// A face of the tile, as faces.wgsl has them.

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
