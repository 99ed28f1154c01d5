//! Every face of a surface as four.

use super::bisection::key;
use crate::geometry::mesh::TriMesh;
use std::collections::HashMap;

/// The same surface with all edges halved so many times. Its own vertices come first, as they were.
pub(crate) fn halved(mesh: &TriMesh, times: usize) -> TriMesh {
    let (mut vertices, mut faces) = (mesh.vertices().to_vec(), mesh.faces().to_vec());
    for _ in 0..times {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry(key(a, b)).or_insert_with(|| {
                // Each half first: the sum of two large numbers may be none.
                vertices.push(0.5 * vertices[a] + 0.5 * vertices[b]);
                vertices.len() - 1
            })
        };
        let four = |[a, b, c]: [usize; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(four).collect();
    }
    // Points between two others cross nothing that these didn't.
    TriMesh::with_parts(mesh.name(), vertices, faces)
}

#[cfg(test)]
mod tests {
    use super::halved;
    use crate::geometry::TriMesh;
    use crate::geometry::tests::cuboid;

    #[test]
    fn the_surface_stays_and_its_edges_are_halves() {
        let mesh = cuboid([0.1, 0.2, 0.4]);
        let finer = halved(&mesh, 2);
        assert_eq!(finer.faces().len(), 16 * mesh.faces().len());
        assert_eq!(&finer.vertices()[..mesh.vertices().len()], mesh.vertices());
        assert!((finer.longest_edge() - 0.25 * mesh.longest_edge()).abs() < 1e-15);
        let (a, b) = (finer.mass_properties(), mesh.mass_properties());
        assert!((a.volume - b.volume).abs() < 1e-15 * b.volume.max(1.0));
        assert!((a.area - b.area).abs() < 1e-15);
        // Nothing is wrong with it.
        TriMesh::new("finer", finer.vertices().to_vec(), finer.faces().to_vec()).unwrap();
    }
}
