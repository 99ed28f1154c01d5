//! The bytes that a file's numbers are in.

use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Target, View};
use gltf::json::validation::Checked::Valid;
use gltf::json::validation::USize64;
use gltf::json::{Accessor, Index, Root, serialize};

/// Numbers of four bytes, one after the other, so that each array begins where it may.
#[derive(Default)]
pub(super) struct Buffer {
    bytes: Vec<u8>,
}

impl Buffer {
    /// Vertices, m.
    pub fn vertices(&mut self, root: &mut Root, values: &[[f32; 3]]) -> Index<Accessor> {
        self.floats(root, Type::Vec3, values, Some(Target::ArrayBuffer))
    }

    /// Numbers of vertices, the corners of triangles.
    pub fn corners(&mut self, root: &mut Root, values: Vec<u32>) -> Index<Accessor> {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes());
        let view = self.view(root, bytes, Some(Target::ElementArrayBuffer));
        root.push(accessor(
            view,
            Type::Scalar,
            ComponentType::U32,
            values.len(),
        ))
    }

    /// Numbers that something else is given at.
    pub fn numbers(&mut self, root: &mut Root, values: &[f32]) -> Index<Accessor> {
        let values: Vec<[f32; 1]> = values.iter().map(|x| [*x]).collect();
        self.floats(root, Type::Scalar, &values, None)
    }

    /// Vectors at times.
    pub fn vectors(&mut self, root: &mut Root, values: &[[f32; 3]]) -> Index<Accessor> {
        self.floats(root, Type::Vec3, values, None)
    }

    /// Rotations at times: x, y, z, w.
    pub fn quaternions(&mut self, root: &mut Root, values: &[[f32; 4]]) -> Index<Accessor> {
        self.floats(root, Type::Vec4, values, None)
    }

    fn floats<const N: usize>(
        &mut self,
        root: &mut Root,
        kind: Type,
        values: &[[f32; N]],
        target: Option<Target>,
    ) -> Index<Accessor> {
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes());
        let view = self.view(root, bytes, target);
        let end = |of: fn(f32, f32) -> f32| {
            let ends = values.iter().copied();
            let ends = ends.reduce(|a, b| std::array::from_fn(|i| of(a[i], b[i])));
            ends.map(|ends| serialize::to_value(ends.as_slice()))
                .and_then(Result::ok)
        };
        root.push(Accessor {
            min: end(f32::min),
            max: end(f32::max),
            ..accessor(view, kind, ComponentType::F32, values.len())
        })
    }

    fn view(
        &mut self,
        root: &mut Root,
        bytes: impl Iterator<Item = u8>,
        target: Option<Target>,
    ) -> Index<View> {
        let before = self.bytes.len();
        self.bytes.extend(bytes);
        root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(self.bytes.len() - before),
            byte_offset: Some(USize64::from(before)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: Default::default(),
        })
    }

    /// Declares the buffer, and gives its bytes.
    pub fn finish(self, root: &mut Root) -> Vec<u8> {
        root.push(gltf::json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        self.bytes
    }
}

fn accessor(view: Index<View>, kind: Type, component: ComponentType, count: usize) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Valid(GenericComponentType(component)),
        extensions: None,
        extras: Default::default(),
        type_: Valid(kind),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}
