//! A tree of elements as XML text.

use super::super::file::parse_error;
use super::element::Element;
use crate::Result;
use quick_xml::Writer;

/// The text.
///
/// # Errors
/// What the writer can't write.
pub(super) fn written(element: &Element) -> Result<String> {
    let mut writer = Writer::new(Vec::new());
    let failed = |why: String| parse_error(&element.file, format!("can't be written anew: {why}"));
    write(&mut writer, element).map_err(|e| failed(e.to_string()))?;
    String::from_utf8(writer.into_inner()).map_err(|e| failed(e.to_string()))
}

fn write(
    writer: &mut Writer<Vec<u8>>,
    element: &Element,
) -> std::result::Result<(), quick_xml::Error> {
    let attributes = element.attributes.iter();
    let attributes = attributes.map(|(name, value)| (&name[..], &value[..]));
    let start = (writer.create_element(&element.tag[..])).with_attributes(attributes);
    if element.children.is_empty() {
        start.write_empty()?;
        return Ok(());
    }
    start.write_inner_content(|writer| {
        (element.children.iter()).try_for_each(|child| write(writer, child))
    })?;
    Ok(())
}
