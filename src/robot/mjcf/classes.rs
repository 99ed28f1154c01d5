//! Classes of defaults: what elements have that they don't say themselves.

use super::element::Element;
use crate::Result;

/// The elements that have defaults, beside those of `<actuator>`.
pub(super) const KINDS: [&str; 5] = ["geom", "joint", "site", "mesh", "equality"];
/// What may have fewer numbers than there are: the others stay those of the class.
const PADDED: &str = "size";
/// The class that the others hang on.
const ROOT: &str = "main";

struct Class<'e> {
    name: &'e str,
    parent: Option<usize>,
    /// Its `<default>` elements: the outermost ones are all of one class.
    from: Vec<&'e Element>,
}

/// All classes of a file; number 0 is the outermost one.
pub(super) struct Classes<'e> {
    all: Vec<Class<'e>>,
}

impl<'e> Classes<'e> {
    /// Those of a whole file.
    ///
    /// # Errors
    /// A class that is there twice, and one without a name.
    pub fn of(file: &'e Element) -> Result<Self> {
        let mut made = Self {
            all: vec![Class {
                name: ROOT,
                parent: None,
                from: Vec::new(),
            }],
        };
        for section in file.all("default") {
            made.all[0].from.push(section);
            made.all[0].name = section.get("class").unwrap_or(made.all[0].name);
        }
        for section in file.all("default") {
            made.within(section, 0)?;
        }
        Ok(made)
    }

    fn within(&mut self, section: &'e Element, parent: usize) -> Result<()> {
        for inner in section.all("default") {
            let Some(name) = inner.get("class").filter(|name| !name.is_empty()) else {
                return Err(inner.wrong("a class within another needs a name: class=\"arm\""));
            };
            let known = self.all.iter().find(|c| c.name == name || name == ROOT);
            if let Some(known) = known {
                let first = known.from.first();
                let first = first.map_or(String::new(), |first| {
                    format!(", first in {}, line {}", first.file.display(), first.line)
                });
                let what = format!("class {name:?} is there twice{first}; give each its own name");
                return Err(inner.wrong(what));
            }
            self.all.push(Class {
                name,
                parent: Some(parent),
                from: vec![inner],
            });
            self.within(inner, self.all.len() - 1)?;
        }
        Ok(())
    }

    /// The class that an attribute (`class` or `childclass`) of an element names; none where it has none.
    ///
    /// # Errors
    /// A class that isn't there.
    pub fn named(&self, element: &Element, attribute: &str) -> Result<Option<usize>> {
        let Some(name) = element.get(attribute) else {
            return Ok(None);
        };
        let found = self.all.iter().position(|class| class.name == name);
        if found.is_some() || name == ROOT {
            return Ok(Some(found.unwrap_or(0)));
        }
        let names: Vec<&str> = self.all.iter().map(|class| class.name).collect();
        let what = format!("{attribute} = {name:?}: there is no such class; there are {names:?}");
        Err(element.wrong(what))
    }

    /// All elements that give defaults to one, by its class, or else by `around`: those of the outermost class first.
    ///
    /// # Errors
    /// A class that isn't there.
    pub fn given(&self, element: &Element, around: Option<usize>) -> Result<Vec<&'e Element>> {
        let first = self.named(element, "class")?.or(around).unwrap_or(0);
        let up = std::iter::successors(Some(first), |class| self.all[*class].parent);
        let mut chain: Vec<usize> = up.collect();
        chain.reverse();
        let from = chain.into_iter().flat_map(|class| &self.all[class].from);
        Ok(from.flat_map(|section| &section.children).collect())
    }

    /// An element of this kind with all that it has by its class, or else by `around`, that of the bodies and frames around it: what is its own stands for what its
    /// class gives, and that for what the class has of those that it hangs on. Of sizes each number stands for itself.
    ///
    /// # Errors
    /// A class that isn't there.
    pub fn resolved(
        &self,
        element: &Element,
        kind: &str,
        around: Option<usize>,
    ) -> Result<Element> {
        let mut made = Element::at(&element.tag, element);
        let given = self.given(element, around)?.into_iter();
        let given = given.filter(|e| e.tag == kind);
        // Names are each element's own.
        let given = given.flat_map(|e| e.attributes.iter().filter(|(name, _)| name != "name"));
        for (name, value) in given.chain(&element.attributes) {
            if name != "class" {
                let below = made.get(name).filter(|_| name == PADDED);
                let value = padded(value, below.unwrap_or_default());
                made.set(name, &value);
            }
        }
        Ok(made)
    }
}

/// Numbers, and those past them that stand below.
fn padded(value: &str, below: &str) -> String {
    let own = value.split_ascii_whitespace();
    let rest = below.split_ascii_whitespace().skip(own.clone().count());
    match below.is_empty() {
        true => value.into(),
        false => own.chain(rest).collect::<Vec<_>>().join(" "),
    }
}
