// Which columns of a solve go on, to be read and written.

// [column]: 1 while it goes on.
@group(2) @binding(0) var<storage, read_write> going: array<u32>;
