//! The geometries of a COLLADA file: positions, and polygons between them.

use hydrograd_adjoint::lie::Vec3;
use roxmltree::Node;

/// A geometry in the numbers of its file.
#[derive(Default)]
pub(super) struct Geometry {
    pub vertices: Vec<Vec3>,
    /// Corners of all polygons, one after another.
    corners: Vec<usize>,
    /// How many each polygon has.
    sizes: Vec<usize>,
}

impl Geometry {
    /// The corners of each polygon, at least three.
    pub fn polygons(&self) -> impl Iterator<Item = &[usize]> {
        let mut rest = self.corners.as_slice();
        self.sizes.iter().map(move |&size| {
            let (polygon, tail) = rest.split_at(size);
            rest = tail;
            polygon
        })
    }

    /// The triangles that the polygons are cut into.
    pub fn triangles(&self) -> usize {
        self.corners.len() - 2 * self.sizes.len()
    }

    /// Adds a polygon; points and lines bound nothing.
    fn push(&mut self, polygon: &[usize]) {
        if polygon.len() >= 3 {
            self.corners.extend(polygon);
            self.sizes.push(polygon.len());
        }
    }

    /// Adds what an element such as `<polylist>` holds.
    fn add(&mut self, kind: &str, element: &Node) -> Result<(), String> {
        if child(element, "ph").is_some() {
            return Err("a <ph>, a polygon with holes, isn't read; export triangles".into());
        }
        let corners = self.corners_of(kind, element)?;
        match kind {
            "triangles" => {
                for list in &corners {
                    let triangles = list.chunks_exact(3);
                    if !triangles.remainder().is_empty() {
                        return Err(format!(
                            "<triangles> of {} corners; export it again",
                            list.len()
                        ));
                    }
                    triangles.for_each(|t| self.push(t));
                }
            }
            "polylist" => {
                let sizes = match child(element, "vcount") {
                    Some(list) => whole_numbers(&list)?,
                    None => Vec::new(),
                };
                let all = corners.concat();
                let told: usize = sizes.iter().sum();
                if told != all.len() {
                    return Err(format!(
                        "<polylist> whose <vcount> tells of {told} corners has {}; export it again",
                        all.len()
                    ));
                }
                let mut rest = all.as_slice();
                for size in sizes {
                    let (polygon, tail) = rest.split_at(size);
                    self.push(polygon);
                    rest = tail;
                }
            }
            "polygons" => corners.iter().for_each(|polygon| self.push(polygon)),
            "trifans" => {
                for fan in &corners {
                    for pair in fan.get(1..).unwrap_or_default().windows(2) {
                        self.push(&[fan[0], pair[0], pair[1]]);
                    }
                }
            }
            // Strips: every other triangle turns the other way.
            _ => {
                for strip in &corners {
                    for (k, t) in strip.windows(3).enumerate() {
                        let t = match k % 2 {
                            0 => [t[0], t[1], t[2]],
                            _ => [t[1], t[0], t[2]],
                        };
                        // Such ones join strips.
                        if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                            self.push(&t);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The vertices that each `<p>` of an element names.
    fn corners_of(&self, kind: &str, element: &Node) -> Result<Vec<Vec<usize>>, String> {
        // A corner has a number for each of its inputs, of which those with the same offset share one.
        let (mut stride, mut vertex) = (0_usize, None);
        for input in children(element, "input") {
            let offset = number(&input, "offset", None)?;
            stride = stride.max(offset + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                vertex = vertex.or(Some(offset));
            }
        }
        let lists = children(element, "p").map(|list| -> Result<Vec<usize>, String> {
            let numbers = whole_numbers(&list)?;
            if numbers.is_empty() {
                return Ok(numbers);
            }
            let vertex =
                vertex.ok_or_else(|| format!("<{kind}> has no input VERTEX; export it again"))?;
            let corners = numbers.chunks_exact(stride);
            if !corners.remainder().is_empty() {
                return Err(format!(
                    "<{kind}> with {} numbers, {stride} a corner; export it again",
                    numbers.len()
                ));
            }
            let corners: Vec<usize> = corners.map(|c| c[vertex]).collect();
            let count = self.vertices.len();
            match corners.iter().find(|v| **v >= count) {
                None => Ok(corners),
                Some(v) => Err(format!(
                    "<{kind}> names vertex {v}, counted from 0, of {count}; export it again"
                )),
            }
        });
        lists.collect()
    }
}

/// Reads a `<geometry>`.
pub(super) fn read(root: &Node, geometry: &Node) -> Result<Geometry, String> {
    let Some(mesh) = child(geometry, "mesh") else {
        return Err("it has no <mesh>; export it as triangles".into());
    };
    let mut out = Geometry {
        vertices: positions(root, &mesh)?,
        ..Geometry::default()
    };
    for part in mesh.children().filter(Node::is_element) {
        let kind = part.tag_name().name();
        if matches!(
            kind,
            "triangles" | "polylist" | "polygons" | "tristrips" | "trifans"
        ) {
            out.add(kind, &part)?;
        }
    }
    Ok(out)
}

/// The positions that the vertices of a mesh have.
fn positions(root: &Node, mesh: &Node) -> Result<Vec<Vec3>, String> {
    let vertices = child(mesh, "vertices").ok_or("it has no <vertices>; export it again")?;
    let position = children(&vertices, "input")
        .find(|input| input.attribute("semantic") == Some("POSITION"))
        .ok_or("its <vertices> have no input POSITION; export it again")?;
    let source = linked([mesh, root], "source", &position)?;
    let accessor = child(&source, "technique_common")
        .and_then(|common| child(&common, "accessor"))
        .ok_or("its positions have no <accessor>; export it again")?;
    let array = linked([&source, root], "float_array", &accessor)?;
    let data: Result<Vec<f64>, String> = words(&array).map(real).collect();
    let data = data?;

    // What has no name is passed over.
    let params = children(&accessor, "param").enumerate();
    let params = params.filter(|(_, param)| param.attribute("name").is_some());
    let places: Vec<usize> = params.map(|(i, _)| i).take(3).collect();
    let places = <[usize; 3]>::try_from(places).unwrap_or([0, 1, 2]);
    let count = number(&accessor, "count", None)?;
    let offset = number(&accessor, "offset", Some(0))?;
    let stride = number(&accessor, "stride", Some(1))?;
    if stride <= places[2] {
        return Err(format!(
            "positions with a stride of {stride}; export it again with x, y and z"
        ));
    }
    let position = |i: usize| {
        let at = places.map(|k| data.get(offset + i * stride + k).copied());
        let [Some(x), Some(y), Some(z)] = at else {
            return Err(format!(
                "{count} positions declared, of which number {i}, counted from 0, isn't there; export it again"
            ));
        };
        Ok(Vec3::new(x, y, z))
    };
    (0..count).map(position).collect()
}

/// The first element of this name within another.
pub(super) fn child<'a, 'd>(node: &Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    children(node, name).next()
}

/// The elements of this name within another.
fn children<'a, 'd>(node: &Node<'a, 'd>, name: &str) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children()
        .filter(move |c| c.is_element() && c.tag_name().name() == name)
}

/// The element with this id that a link `#id` names.
pub(super) fn named<'a, 'd>(root: &Node<'a, 'd>, kind: &str, link: &str) -> Option<Node<'a, 'd>> {
    let id = link.strip_prefix('#')?;
    let mut all = root.descendants();
    all.find(|n| n.is_element() && n.tag_name().name() == kind && n.attribute("id") == Some(id))
}

/// What the attribute `source` of an element leads to, looked for in these places.
fn linked<'a, 'd>(
    places: [&Node<'a, 'd>; 2],
    kind: &str,
    from: &Node,
) -> Result<Node<'a, 'd>, String> {
    let link = from.attribute("source").unwrap_or_default();
    let found = places.iter().find_map(|place| named(place, kind, link));
    found.ok_or_else(|| {
        let name = from.tag_name().name();
        format!("<{name} source={link:?}> leads to no <{kind}>; export it again")
    })
}

/// The words within an element.
fn words<'a>(element: &Node<'a, '_>) -> impl Iterator<Item = &'a str> {
    // Comments part its text.
    let texts = element.children().filter(Node::is_text);
    texts
        .filter_map(|text| text.text())
        .flat_map(str::split_whitespace)
}

/// A coordinate; some exporters write commas for points.
fn real(word: &str) -> Result<f64, String> {
    let read = match word.contains(',') {
        true => word.replace(',', ".").parse(),
        false => word.parse(),
    };
    read.map_err(|_| format!("{word:?} among the positions isn't a number; export it again"))
}

/// The whole numbers within an element.
fn whole_numbers(element: &Node) -> Result<Vec<usize>, String> {
    let read = |word: &str| {
        let number = word.parse::<u32>().map(|n| n as usize);
        number.map_err(|_| {
            let name = element.tag_name().name();
            format!("<{name}> holds {word:?}, which is no whole number; export it again")
        })
    };
    words(element).map(read).collect()
}

/// An attribute that is a whole number.
fn number(element: &Node, name: &str, default: Option<usize>) -> Result<usize, String> {
    let Some(given) = element.attribute(name) else {
        let tag = element.tag_name().name();
        return default.ok_or_else(|| format!("<{tag}> has no {name}; export it again"));
    };
    let read = given.trim().parse::<u32>().map(|n| n as usize);
    read.map_err(|_| {
        let tag = element.tag_name().name();
        format!("<{tag}> has {name}={given:?}, which is no whole number; export it again")
    })
}
