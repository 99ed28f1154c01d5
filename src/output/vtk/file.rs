//! Files of VTK, and series of them.

use crate::simulate::{Recording, replace};
use crate::{Error, Result};
use quick_xml::se;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use vtkio::model::{
    Attribute, ByteOrder, DataArray, DataSet, Extent, IOBuffer, Piece, Version, Vtk,
};
use vtkio::xml::Compressor;

/// Bytes of a block that the crate compresses at once.
const BLOCK: usize = 32768;

/// A named array, so many numbers for each point or face.
pub(super) fn array(name: &str, components: u32, values: impl Into<IOBuffer>) -> Attribute {
    let array = match components {
        3 => DataArray::vectors(name),
        _ => DataArray::scalars(name, components),
    };
    Attribute::DataArray(array.with_data(values))
}

/// Writes a file, whole or not at all.
pub(super) fn write(path: &Path, data: DataSet) -> Result<()> {
    // After arrays that fill their blocks the crate counts one more, which no reader finds.
    let level = match fills_blocks(&data) {
        true => 0,
        false => 1,
    };
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        byte_order: ByteOrder::LittleEndian,
        title: String::new(),
        file_path: None,
        data,
    };
    let made = vtk.try_into_xml_format(Compressor::ZLib, level);
    let file = made.map_err(|e| Error::File {
        path: path.to_owned(),
        action: "write",
        source: io::Error::other(e),
    })?;
    replace(path, |out| file.write(&mut *out).map_err(io::Error::other))
}

/// Whether an array's bytes are a whole number of blocks.
fn fills_blocks(data: &DataSet) -> bool {
    let (sizes, attributes) = match data {
        DataSet::PolyData { pieces, .. } => match pieces.as_slice() {
            [Piece::Inline(piece)] => {
                let faces = [&piece.verts, &piece.lines, &piece.polys]
                    .into_iter()
                    .flatten();
                // Corners and ends of faces are numbers of eight bytes.
                let numbers = faces.flat_map(|f| [f.num_verts(), f.num_cells()]);
                let mut sizes: Vec<usize> = numbers.map(|n| 8 * n).collect();
                sizes.push(piece.points.num_bytes());
                (sizes, &piece.data)
            }
            _ => return true,
        },
        DataSet::ImageData { pieces, .. } => match pieces.as_slice() {
            [Piece::Inline(piece)] => (Vec::new(), &piece.data),
            _ => return true,
        },
        _ => return true,
    };
    let arrays = attributes.point.iter().chain(&attributes.cell);
    let of = |a: &Attribute| match a {
        Attribute::DataArray(array) => array.data.num_bytes(),
        Attribute::Field { .. } => 0,
    };
    let mut sizes = sizes.into_iter().chain(arrays.map(of));
    sizes.any(|bytes| bytes % BLOCK == 0)
}

/// Points of a grid along each axis, as the format counts them.
pub(super) fn extent(counts: [usize; 3]) -> Extent {
    Extent::Ranges(counts.map(|n| 0..=n as i32 - 1))
}

/// `NAME.pvd` and the files that it names, in a folder beside it.
pub(super) struct Series<'a> {
    folder: &'a Path,
    name: &'static str,
    ending: &'static str,
    times: &'a [f64],
}

impl<'a> Series<'a> {
    /// Makes its folder.
    pub fn new(
        folder: &'a Path,
        name: &'static str,
        ending: &'static str,
        times: &'a [f64],
    ) -> Result<Self> {
        Recording::prepare(&folder.join(name))?;
        Ok(Self {
            folder,
            name,
            ending,
            times,
        })
    }

    /// Where a frame is, from the folder.
    fn place(&self, frame: usize) -> String {
        format!("{0}/{0}_{frame:05}.{1}", self.name, self.ending)
    }

    /// Writes a frame.
    pub fn write(&self, frame: usize, data: DataSet) -> Result<()> {
        write(&self.folder.join(self.place(frame)), data)
    }

    /// Writes the file that names all frames with their times, and gives its path.
    pub fn finish(&self) -> Result<PathBuf> {
        let times = self.times.iter().enumerate();
        let frames = times.map(|(k, time)| Frame {
            timestep: *time,
            part: 0,
            file: self.place(k),
        });
        let collection = Collection {
            kind: "Collection",
            version: "0.1",
            byte_order: "LittleEndian",
            frames: Named {
                frames: frames.collect(),
            },
        };
        let path = self.folder.join(format!("{}.pvd", self.name));
        replace(&path, |out| {
            let text = se::to_string(&collection).map_err(io::Error::other)?;
            writeln!(out, "<?xml version=\"1.0\"?>\n{text}")
        })?;
        Ok(path)
    }
}

#[derive(Serialize)]
#[serde(rename = "VTKFile")]
struct Collection {
    #[serde(rename = "@type")]
    kind: &'static str,
    #[serde(rename = "@version")]
    version: &'static str,
    #[serde(rename = "@byte_order")]
    byte_order: &'static str,
    #[serde(rename = "Collection")]
    frames: Named,
}

#[derive(Serialize)]
struct Named {
    #[serde(rename = "DataSet")]
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    #[serde(rename = "@timestep")]
    timestep: f64,
    #[serde(rename = "@part")]
    part: u32,
    #[serde(rename = "@file")]
    file: String,
}
