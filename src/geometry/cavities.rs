//! Masses of closed surfaces around cavities, which no mesh of a body may have.

use super::mass::MassProperties;
use super::mesh::TriMesh;
use super::topology::{components, edges};
use super::tree::MeshTree;
use crate::Result;
use hydrograd_adjoint::lie::Vec3;

/// What a surface encloses, less the closed pieces within it whose normals point inward, as those of cavities do; none where nothing is
/// left. Turned inside out as a whole, it encloses what it would the right way round.
///
/// # Errors
/// That of [`TriMesh::new`] for the surface as it is.
pub(crate) fn with_cavities(
    name: &str,
    vertices: &[Vec3],
    faces: &[[usize; 3]],
) -> Result<Option<MassProperties>> {
    let whole = |faces: Vec<[usize; 3]>| TriMesh::new(name, vertices.to_vec(), faces);
    let error = match whole(faces.to_vec()) {
        Ok(mesh) => return Ok(Some(mesh.mass_properties())),
        Err(error) => error,
    };
    let turned = |faces: &[[usize; 3]]| faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    if let Ok(mesh) = whole(turned(faces)) {
        return Ok(Some(mesh.mass_properties()));
    }
    let known = |face: &[usize; 3]| face.iter().all(|v| *v < vertices.len());
    let distinct = |[a, b, c]: &[usize; 3]| a != b && b != c && c != a;
    if !faces.iter().all(|face| known(face) && distinct(face)) {
        return Err(error);
    }
    let pieces = components(
        faces.len(),
        0..faces.len(),
        &edges(faces.iter().copied().enumerate()),
    );
    let (mut solid, mut cavities) = (Vec::new(), Vec::new());
    for piece in pieces {
        let own: Vec<[usize; 3]> = piece.faces.iter().map(|f| faces[*f]).collect();
        match whole(turned(&own)) {
            Ok(cavity) if piece.closed => cavities.push(cavity),
            _ => solid.extend(own),
        }
    }
    if cavities.is_empty() {
        return Err(error);
    }
    let Ok(solid) = whole(solid) else {
        return Err(error);
    };
    let tree = MeshTree::new(&solid);
    let within = |x: &Vec3| tree.signed(x).is_some_and(|(distance, _)| distance < 0.0);
    if !cavities.iter().all(|c| c.vertices().iter().all(within)) {
        return Err(error);
    }
    let found = cavities
        .iter()
        .fold(solid.mass_properties(), |left, cavity| {
            left.less(&cavity.mass_properties())
        });
    Ok((found.volume > 0.0).then_some(found))
}

#[cfg(test)]
mod tests {
    use super::with_cavities;
    use crate::geometry::tests::cuboid;
    use hydrograd_adjoint::lie::Vec3;

    /// A cube of 0.2 m and one of 0.1 m about a place, whose normals point inward.
    fn around(at: Vec3) -> (Vec<Vec3>, Vec<[usize; 3]>) {
        let (outer, inner) = (cuboid([0.2; 3]), cuboid([0.1; 3]));
        let mut vertices = outer.vertices().to_vec();
        let first = vertices.len();
        vertices.extend(inner.vertices().iter().map(|x| x + at));
        let turned = inner.faces().iter().map(|[a, b, c]| [*a, *c, *b]);
        let mut faces = outer.faces().to_vec();
        faces.extend(turned.map(|face| face.map(|v| v + first)));
        (vertices, faces)
    }

    #[test]
    fn a_cavity_is_taken_off() {
        let at = Vec3::new(0.03, -0.02, 0.01);
        let (vertices, faces) = around(at);
        let found = with_cavities("hollow", &vertices, &faces).unwrap().unwrap();
        let [solid, hollow] = [0.2_f64.powi(3), 0.1_f64.powi(3)];
        let volume = solid - hollow;
        assert!((found.volume - volume).abs() < 1e-15, "{}", found.volume);
        let center = -at * (hollow / volume);
        assert!((found.centroid - center).norm() < 1e-15);
        let cube = |volume: f64, side: f64| volume * side * side / 6.0;
        let about = |volume: f64, x: Vec3| volume * (x.y * x.y + x.z * x.z);
        let inertia = cube(solid, 0.2) + about(solid, center)
            - cube(hollow, 0.1)
            - about(hollow, at - center);
        assert!((found.inertia[(0, 0)] - inertia).abs() < 1e-17);
        assert!((found.area - 6.0 * (0.04 + 0.01)).abs() < 1e-15);
    }

    #[test]
    fn a_turned_piece_outside_is_no_cavity() {
        for at in [Vec3::new(0.4, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0)] {
            let (vertices, faces) = around(at);
            with_cavities("beside", &vertices, &faces).unwrap_err();
        }
    }
}
