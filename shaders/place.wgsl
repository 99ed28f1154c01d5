// Faces and sources of all bodies, and the images of the sources, at the bodies' poses: relative to the
// scene's middle, in units of its size, in the fine arithmetic and in single precision. Twin:
// coupling::pair::Pair::new.

//! uses: vector
//! constants: MOVED ROTATED SCALARS

// A face: points, then vectors, then numbers that don't change.
const FACE: u32 = 3u * (MOVED + ROTATED) + SCALARS;

struct Task { faces: u32, sources: u32, bodies: u32, images: u32 }

@group(0) @binding(0) var<storage, read> shape_faces: array<real>;        // [shape's face][FACE], body frame
@group(0) @binding(1) var<storage, read> shape_sources: array<real>;      // [shape's source][3]
@group(0) @binding(2) var<storage, read> poses: array<real>;              // [body][12], then [image][12]
@group(0) @binding(3) var<storage, read> face_map: array<vec2<u32>>;      // body, shape's face
@group(0) @binding(4) var<storage, read> source_map: array<vec2<u32>>;    // body, shape's source
@group(0) @binding(5) var<storage, read_write> faces: array<real>;
@group(0) @binding(6) var<storage, read_write> faces_single: array<f32>;
@group(0) @binding(7) var<storage, read_write> sources: array<real>;
@group(0) @binding(8) var<storage, read_write> sources_single: array<f32>;
@group(0) @binding(9) var<uniform> task: Task;

fn rotated(p: u32, v: V3) -> V3 {
    let k = 12u * p;
    return V3(
        v_dot(V3(poses[k], poses[k + 1u], poses[k + 2u]), v),
        v_dot(V3(poses[k + 3u], poses[k + 4u], poses[k + 5u]), v),
        v_dot(V3(poses[k + 6u], poses[k + 7u], poses[k + 8u]), v),
    );
}

fn moved(p: u32, v: V3) -> V3 {
    let k = 12u * p + 9u;
    return v_add(rotated(p, v), V3(poses[k], poses[k + 1u], poses[k + 2u]));
}

fn shape_vector(at: u32) -> V3 {
    return V3(shape_faces[at], shape_faces[at + 1u], shape_faces[at + 2u]);
}

fn put_face(at: u32, v: V3) {
    faces[at] = v.x;
    faces[at + 1u] = v.y;
    faces[at + 2u] = v.z;
    faces_single[at] = narrow(v.x);
    faces_single[at + 1u] = narrow(v.y);
    faces_single[at + 2u] = narrow(v.z);
}

@compute @workgroup_size(64)
fn place_faces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * 64u + id.x;
    if i >= task.faces {
        return;
    }
    let body = face_map[i].x;
    let begin_at = face_map[i].y * FACE;
    for (var c = 0u; c < MOVED; c++) {
        put_face(i * FACE + 3u * c, moved(body, shape_vector(begin_at + 3u * c)));
    }
    for (var c = 0u; c < ROTATED; c++) {
        let at = 3u * (MOVED + c);
        put_face(i * FACE + at, rotated(body, shape_vector(begin_at + at)));
    }
    for (var c = 0u; c < SCALARS; c++) {
        let at = 3u * (MOVED + ROTATED) + c;
        faces[i * FACE + at] = shape_faces[begin_at + at];
        faces_single[i * FACE + at] = narrow(shape_faces[begin_at + at]);
    }
}

@compute @workgroup_size(64)
fn place_sources(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let j = id.y * groups.x * 64u + id.x;
    if j >= task.sources {
        return;
    }
    let begin_at = source_map[j].y * 3u;
    let own = V3(shape_sources[begin_at], shape_sources[begin_at + 1u], shape_sources[begin_at + 2u]);
    let at = moved(source_map[j].x, own);
    for (var image = 0u; image < task.images; image++) {
        let v = moved(task.bodies + image, at);
        let to = 3u * (image * task.sources + j);
        sources[to] = v.x;
        sources[to + 1u] = v.y;
        sources[to + 2u] = v.z;
        sources_single[to] = narrow(v.x);
        sources_single[to + 1u] = narrow(v.y);
        sources_single[to + 2u] = narrow(v.z);
    }
}
