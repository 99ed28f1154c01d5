// Many equal scenes of compressed bodies: what they share, and where each one's own numbers are. A workgroup works
// on one question about one scene, whatever the others are: an answer doesn't depend on who else is asked.
//
// Lengths are in units of the scenes' size, positions relative to each scene's middle. What a workgroup of its own
// work keeps between passes lies in `work`, [row][column] each; passes are parted by barriers.

struct Scene {
    points: u32,
    modes: u32,
    bodies: u32,
    images: u32,
    blocks: u32,
    // Columns of the basis.
    columns: u32,
    // Where in `fixed` begin: [L, Ū] of the shapes, point by point; the same, mode by mode; the weights; the probe.
    table: u32,
    across: u32,
    weights: u32,
    probe: u32,
    // Iterations of one round, and rounds.
    steps: u32,
    rounds: u32,
    // Residuals, squared, at which a round ends, and the rounds.
    rough_end: f32,
    end: f32,
    pad0: u32,
    pad1: u32,
}

// [point]: body, shape's point; [mode]: body; [body]: first point, points, first mode, modes, shape's block;
// [block of sources]: body, first point, count.
@group(0) @binding(0) var<storage, read> indices: array<u32>;
// [shape's point][3], and what `scene` says.
@group(0) @binding(1) var<storage, read> fixed: array<real>;
// The same in single precision.
@group(0) @binding(2) var<storage, read> fixed_single: array<f32>;
@group(0) @binding(3) var<uniform> scene: Scene;

// [question]: the slot of its scene's state.
@group(1) @binding(0) var<storage, read> slots: array<u32>;
// [question][…].
@group(1) @binding(1) var<storage, read> inputs: array<real>;
// [slot][image][point][3].
@group(1) @binding(2) var<storage, read_write> points: array<real>;
// [slot][point][column of the basis]: charges.
@group(1) @binding(3) var<storage, read_write> charges: array<real>;
@group(1) @binding(4) var<storage, read_write> work: array<real>;
// [question][…].
@group(1) @binding(5) var<storage, read_write> answers: array<real>;

const TILE: u32 = 64u;

var<workgroup> places: array<real, 192>;

struct Body { point: u32, points: u32, mode: u32, modes: u32, table: u32 }
struct Block { body: u32, first: u32, count: u32 }

fn owner(i: u32) -> u32 { return indices[2u * i]; }
fn mode_owner(m: u32) -> u32 { return indices[2u * scene.points + m]; }

fn body_at(b: u32) -> Body {
    let k = 2u * scene.points + scene.modes + 5u * b;
    return Body(indices[k], indices[k + 1u], indices[k + 2u], indices[k + 3u], indices[k + 4u]);
}

fn block_at(b: u32) -> Block {
    let k = 2u * scene.points + scene.modes + 5u * scene.bodies + 3u * b;
    return Block(indices[k], indices[k + 1u], indices[k + 2u]);
}

// Sign times weight of an image of a source body as a target body sees it; 0 for what isn't seen.
fn weight_at(image: u32, target_body: u32, source_body: u32) -> u32 {
    return scene.weights + (image * scene.bodies + target_body) * scene.bodies + source_body;
}

fn point_at(slot: u32, image: u32, j: u32) -> V3 {
    let k = 3u * ((slot * scene.images + image) * scene.points + j);
    return V3(points[k], points[k + 1u], points[k + 2u]);
}

fn put_place(j: u32, v: V3) {
    places[3u * j] = v.x;
    places[3u * j + 1u] = v.y;
    places[3u * j + 2u] = v.z;
}

fn place_at(j: u32) -> V3 {
    return V3(places[3u * j], places[3u * j + 1u], places[3u * j + 2u]);
}

// 1/|x − s|.
fn near(x: V3, s: V3) -> real {
    let r = v_sub(x, s);
    return inverse_root(v_dot(r, r));
}

// A question's part of `work`, with COLUMNS columns, and where in it begin: solutions, residuals; of the points their charges and
// potentials, what is kept of directions (DIRECTIONS numbers a point), pulls (PULLS numbers a point).
fn work_size() -> u32 {
    return 2u * scene.modes * COLUMNS + scene.points * (2u * COLUMNS + DIRECTIONS + PULLS);
}
fn residual_part() -> u32 { return scene.modes * COLUMNS; }
fn charge_part() -> u32 { return 2u * scene.modes * COLUMNS; }
fn potential_part() -> u32 { return charge_part() + scene.points * COLUMNS; }
fn direction_part() -> u32 { return potential_part() + scene.points * COLUMNS; }
fn pull_part() -> u32 { return direction_part() + scene.points * DIRECTIONS; }
