//! Compiled shaders.

use super::source::{Arithmetic, Constant, Shader};
use crate::{Error, Result};
use wgpu::naga;

/// A variable that a shader's entry uses.
pub(super) struct Binding {
    pub name: String,
    pub group: u32,
    pub binding: u32,
}

/// One entry of a shader, compiled.
pub(super) struct Kernel {
    pub name: String,
    pub pipeline: wgpu::ComputePipeline,
    pub layouts: Vec<wgpu::BindGroupLayout>,
    pub bindings: Vec<Binding>,
}

/// Whether a shader writes to a variable, and whether it is one of the uniforms.
fn kind(space: naga::AddressSpace) -> Option<wgpu::BufferBindingType> {
    match space {
        naga::AddressSpace::Uniform => Some(wgpu::BufferBindingType::Uniform),
        naga::AddressSpace::Storage { access } => Some(wgpu::BufferBindingType::Storage {
            read_only: !access.contains(naga::StorageAccess::STORE),
        }),
        _ => None,
    }
}

impl Kernel {
    /// Compiles it on `device`; `failure` makes the device's error of what went wrong.
    pub fn new(
        device: &wgpu::Device,
        failure: impl Fn(String) -> Error,
        shader: &'static str,
        entry: &str,
        arithmetic: Arithmetic,
        constants: &[(&'static str, Constant)],
    ) -> Result<Self> {
        let name = format!("{shader}::{entry} ({})", arithmetic.name());
        let wrong = |what: String| failure(format!("shader {name}: {what}"));
        let text = Shader::named(shader)
            .and_then(|s| s.assemble(arithmetic, constants))
            .ok_or_else(|| wrong("a piece or a constant is missing".into()))?;
        let module =
            naga::front::wgsl::parse_str(&text).map_err(|e| wrong(e.emit_to_string(&text)))?;
        let mut capabilities = naga::valid::Capabilities::empty();
        capabilities.set(
            naga::valid::Capabilities::FLOAT64,
            arithmetic == Arithmetic::Double,
        );
        let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
            .validate(&module)
            .map_err(|e| wrong(e.emit_to_string(&text)))?;
        let at = module.entry_points.iter().position(|e| e.name == entry);
        let at = at.ok_or_else(|| wrong("there is no such entry".into()))?;
        let used = info.get_entry_point(at);
        let mut bindings = Vec::new();
        let mut entries: Vec<Vec<wgpu::BindGroupLayoutEntry>> = Vec::new();
        for (handle, variable) in module.global_variables.iter() {
            let (Some(place), Some(ty)) = (&variable.binding, kind(variable.space)) else {
                continue;
            };
            entries.resize_with(entries.len().max(place.group as usize + 1), Vec::new);
            if used[handle].is_empty() {
                continue;
            }
            entries[place.group as usize].push(wgpu::BindGroupLayoutEntry {
                binding: place.binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            });
            bindings.push(Binding {
                name: variable.name.clone().unwrap_or_default(),
                group: place.group,
                binding: place.binding,
            });
        }
        let layouts: Vec<wgpu::BindGroupLayout> = entries
            .iter()
            .map(|entries| {
                device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: Some(&name),
                    entries,
                })
            })
            .collect();
        let of: Vec<Option<&wgpu::BindGroupLayout>> = layouts.iter().map(Some).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&name),
            bind_group_layouts: &of,
            immediate_size: 0,
        });
        let guard = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&name),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&name),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        if let Some(e) = pollster::block_on(guard.pop()) {
            return Err(wrong(e.to_string()));
        }
        Ok(Self {
            name,
            pipeline,
            layouts,
            bindings,
        })
    }
}
