//! Someone else's renderer: a checkered floor and balls, rasterised into a texture with a z-buffer. It knows nothing of
//! media.

use airlight::glam::DVec3;
use airlight::scene::Camera;
use airlight::wgpu;

/// Metres to the near plane, where the z-buffer is 1; it is 0 at infinity.
pub(crate) const NEAR: f64 = 0.1;
/// The format of the colours: linear radiance.
pub(crate) const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// The format of the z-buffer.
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The device, the pipeline and the targets.
pub(crate) struct Raster {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) color: wgpu::Texture,
    pub(crate) depth: wgpu::Texture,
    pipeline: wgpu::RenderPipeline,
    uniforms: wgpu::Buffer,
}

/// What the shader reads: eye; forward, right and up over the squares of their lengths.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Uniforms {
    eye: [f32; 4],
    forward: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
}

const SHADER: &str = "
struct View { eye: vec4<f32>, forward: vec4<f32>, right: vec4<f32>, up: vec4<f32> }
@group(0) @binding(0) var<uniform> view: View;

const NEAR: f32 = 0.1;
const SLICES: u32 = 48u;
const STACKS: u32 = 24u;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) object: u32,
}

fn corner(place: vec3<f32>, normal: vec3<f32>, object: u32) -> Corner {
    let way = place - view.eye.xyz;
    let clip = vec4<f32>(dot(way, view.right.xyz), dot(way, view.up.xyz), NEAR, dot(way, view.forward.xyz));
    return Corner(clip, place, normal, object);
}

// Object 0 is the floor, the others are balls: a front, a middle and a back one.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) object: u32) -> Corner {
    let quad = array(vec2(0u, 0u), vec2(1u, 0u), vec2(0u, 1u), vec2(0u, 1u), vec2(1u, 0u), vec2(1u, 1u));
    let cell = index / 6u;
    let at = quad[index % 6u];
    if object == 0u {
        let inside = f32(cell == 0u);
        let xz = (vec2<f32>(at) * 2.0 - 1.0) * 40.0 * inside;
        return corner(vec3<f32>(xz.x, 0.0, xz.y), vec3<f32>(0.0, 1.0, 0.0), object);
    }
    let centers = array(vec3(-2.6, 1.2, 5.4), vec3(1.9, 2.3, 1.4), vec3(-3.0, 3.0, -3.6), vec3(5.6, 1.0, 1.0));
    let radii = array(1.2, 1.6, 2.2, 1.0);
    let phi = f32(cell % SLICES + at.x) / f32(SLICES) * 6.2831853;
    let theta = f32(cell / SLICES + at.y) / f32(STACKS) * 3.1415927;
    let normal = vec3<f32>(sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi));
    return corner(centers[object - 1u] + radii[object - 1u] * normal, normal, object);
}

@fragment
fn fragment(in: Corner) -> @location(0) vec4<f32> {
    let colors = array(vec3(0.0), vec3(0.8, 0.2, 0.15), vec3(0.15, 0.5, 0.8), vec3(0.9, 0.7, 0.1), vec3(0.3, 0.7, 0.3));
    var albedo = colors[in.object];
    if in.object == 0u {
        let tile = floor(in.place.x / 2.0) + floor(in.place.z / 2.0);
        albedo = select(vec3(0.25), vec3(0.55), tile - 2.0 * floor(tile / 2.0) == 0.0);
    }
    let normal = normalize(in.normal);
    let sun = max(dot(normal, normalize(vec3(0.5, 0.8, 0.35))), 0.0) * vec3(3.0, 2.7, 2.3) / 3.1415927;
    let sky = (0.6 + 0.4 * normal.y) * vec3(0.18, 0.24, 0.34);
    return vec4<f32>(albedo * (sun + sky), 1.0);
}
";

/// Triangles' corners of a ball; the floor takes the first six.
const CORNERS: u32 = 48 * 24 * 6;

impl Raster {
    /// A renderer of pictures of that size, on the first adapter whose limits do.
    ///
    /// # Errors
    /// Why there is none.
    pub(crate) fn new(width: u32, height: u32) -> Result<Self, Box<dyn std::error::Error>> {
        let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        let instance = wgpu::Instance::new(descriptor);
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("engine"),
            // Its own needs, and what airlight asks for.
            required_limits:
                wgpu::Limits::default().or_better_values_from(&airlight::engine::WgpuDevice::required_limits()),
            ..Default::default()
        }))?;
        let texture = |label, format| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let (color, depth) = (texture("colour", COLOR), texture("depth", DEPTH));
        let uniforms = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view"),
            size: size_of::<Uniforms>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("raster"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("raster"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &[Some(COLOR.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Ok(Self { device, queue, color, depth, pipeline, uniforms })
    }

    /// Draws the scene over a sky of that radiance, and submits it.
    pub(crate) fn draw(&self, camera: &Camera, sky: [f64; 3]) {
        let [forward, right, up] = camera.axes();
        let of = |v: DVec3| v.as_vec3().extend(0.0).to_array();
        let uniforms = Uniforms {
            eye: of(camera.origin),
            forward: of(forward),
            right: of(right / right.length_squared()),
            up: of(up / up.length_squared()),
        };
        self.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&uniforms));
        let bind = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: self.uniforms.as_entire_binding() }],
        });
        let [r, g, b] = sky;
        let (color, depth) = (self.color.create_view(&Default::default()), self.depth.create_view(&Default::default()));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("raster"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bind, &[]);
        pass.draw(0..CORNERS, 0..5);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }

    /// A texture for a film of that size, that airlight writes and the engine reads.
    pub(crate) fn target(&self, format: wgpu::TextureFormat) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("film"),
            size: self.color.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// The bytes of a texture of `texel` bytes a texel, row by row: what a picture on disk needs, and a frame does not.
    ///
    /// # Errors
    /// A device fault.
    pub(crate) fn read(&self, texture: &wgpu::Texture, texel: u32) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let (row, height) = (texture.width() * texel, texture.height());
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: u64::from(padded) * u64::from(height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
        self.queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let view = buffer.slice(..).get_mapped_range()?;
        Ok(view.chunks_exact(padded as usize).flat_map(|line| &line[..row as usize]).copied().collect())
    }
}
