// Work that is skipped once every column of a solve is done.

// [column]: 1 while it goes on.
@group(2) @binding(0) var<storage, read> going: array<u32>;

fn idle() -> bool {
    for (var k = 0u; k < arrayLength(&going); k++) {
        if going[k] != 0u {
            return false;
        }
    }
    return true;
}
