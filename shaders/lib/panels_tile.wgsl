// A panel of the tile, as panels.wgsl has them.

fn tile_vector(k: u32) -> V3 {
    return V3(tile[k], tile[k + 1u], tile[k + 2u]);
}

fn tile_face(i: u32) -> Face {
    let k = i * FACE;
    return Face(
        tile_vector(k),
        tile_vector(k + 3u),
        tile_vector(k + 6u),
        tile_vector(k + 9u),
        tile_vector(k + 12u),
        tile_vector(k + 15u),
        tile_vector(k + 18u),
        tile[k + 21u],
        tile[k + 22u],
        tile[k + 23u],
        tile[k + 24u],
    );
}
