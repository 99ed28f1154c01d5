//! Shapes in a word, as the command line takes them, and their meshes.

use super::engine::{Answer, fuzz};
use hydrograd::shape;

fn built(input: &[u8]) -> Answer {
    let text = String::from_utf8_lossy(input);
    let made =
        shape::parse_shape(&text).and_then(|shape| shape::build(&shape, "".as_ref(), Some(60)));
    match made {
        Ok(mesh) => {
            let volume = mesh.mass_properties().volume;
            match volume.is_finite() && volume > 0.0 {
                true => Answer::Taken(mesh.name().to_string()),
                false => Answer::Wrong(format!("a volume of {volume}")),
            }
        }
        Err(error) => Answer::Refused(error.to_string()),
    }
}

#[test]
fn shapes_in_a_word_hold() {
    let corpus = [
        "sphere:0.05",
        "ellipsoid:0.1,0.2,0.3",
        "box:1,2,3",
        "cylinder:0.5,2",
        "capsule:0.5,2",
        "prism:1,0,0,1,0,0,1",
        "box:1e6,0.1,0.1",
        "cylinder:1,0.001",
        "capsule:0.1,1e6",
    ];
    let corpus = corpus.map(|text| text.as_bytes().to_vec()).to_vec();
    fuzz("shape", corpus, 2_500, built);
}
