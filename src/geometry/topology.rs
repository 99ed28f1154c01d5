//! Which faces share which edges, and how they are oriented.

/// One passage of a face through an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeUse {
    /// The edge's vertices, smaller number first.
    pub vertices: [usize; 2],
    /// The face.
    pub face: usize,
    /// Whether the face runs from the smaller to the larger number.
    pub forward: bool,
}

impl EdgeUse {
    /// The edge's vertices in the order of the face.
    pub fn directed(&self) -> [usize; 2] {
        let [a, b] = self.vertices;
        if self.forward { [a, b] } else { [b, a] }
    }
}

/// The passages of the given (numbered) faces, sorted by edge and face.
pub(crate) struct Edges(Vec<EdgeUse>);

/// Gathers the edges of faces; corners of a face must differ.
pub(crate) fn edges(faces: impl Iterator<Item = (usize, [usize; 3])>) -> Edges {
    let mut uses: Vec<EdgeUse> = faces
        .flat_map(|(face, [a, b, c])| {
            [[a, b], [b, c], [c, a]].map(|[i, j]| EdgeUse {
                vertices: [i.min(j), i.max(j)],
                face,
                forward: i < j,
            })
        })
        .collect();
    uses.sort_unstable_by_key(|u| (u.vertices, u.face));
    Edges(uses)
}

impl Edges {
    /// Each edge's passages.
    pub fn groups(&self) -> impl Iterator<Item = &[EdgeUse]> {
        self.0.chunk_by(|a, b| a.vertices == b.vertices)
    }
}

/// A set of faces connected through edges.
#[derive(Debug)]
pub(crate) struct Component {
    /// Its faces, ascending.
    pub faces: Vec<usize>,
    /// The faces oriented against the majority, ascending. Not looked for where more than two
    /// faces share an edge: there, no orientation is right.
    pub flipped: Vec<usize>,
    /// No choice of orientations makes the faces agree.
    pub one_sided: bool,
    /// Every edge has exactly two faces.
    pub closed: bool,
}

/// Splits faces (numbers below `count`) into connected components and compares their orientations.
pub(crate) fn components(
    count: usize,
    present: impl Iterator<Item = usize>,
    edges: &Edges,
) -> Vec<Component> {
    // Neighbours across edges that have two faces, and whether both run the same way.
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); count];
    let mut open = vec![false; count];
    let mut crowded = vec![false; count];
    for uses in edges.groups() {
        if uses.len() != 2 {
            for u in uses {
                open[u.face] = true;
                crowded[u.face] |= uses.len() > 2;
            }
        }
        for pair in uses.windows(2) {
            let clash = uses.len() == 2 && pair[0].forward == pair[1].forward;
            neighbours[pair[0].face].push((pair[1].face, clash));
            neighbours[pair[1].face].push((pair[0].face, clash));
        }
    }

    let mut reversed: Vec<Option<bool>> = vec![None; count];
    let mut found = Vec::new();
    for seed in present {
        if reversed[seed].is_some() {
            continue;
        }
        reversed[seed] = Some(false);
        let (mut faces, mut one_sided) = (vec![seed], false);
        let mut next = 0;
        while next < faces.len() {
            let face = faces[next];
            next += 1;
            for &(other, clash) in &neighbours[face] {
                let expected = reversed[face].unwrap_or(false) ^ clash;
                match reversed[other] {
                    None => {
                        reversed[other] = Some(expected);
                        faces.push(other);
                    }
                    Some(is) => one_sided |= is != expected,
                }
            }
        }
        faces.sort_unstable();
        let against = faces.iter().filter(|&&f| reversed[f] == Some(true)).count();
        let minority = 2 * against <= faces.len();
        let manifold = faces.iter().all(|&f| !crowded[f]);
        let flipped = faces
            .iter()
            .copied()
            .filter(|&f| manifold && reversed[f] == Some(minority))
            .collect();
        found.push(Component {
            closed: faces.iter().all(|&f| !open[f]),
            faces,
            flipped,
            one_sided: one_sided && manifold,
        });
    }
    found
}
