//! A host in wgpu, under validation: it draws spheres with their depth, cao draws a volume of even matter into the same textures, in front of
//! them, round them and hidden by them, the host goes on drawing with the depth that comes back. Every pixel is known.

use cao::glam::{Vec2, Vec3};
use cao::gpu::{Format, Gpu};
use cao::model::look::Shading;
use cao::model::values::Values;
use cao::renderer::{Over, Target, Targets};
use cao::{Clip, Look, Renderer, Setup, Shape, StereoRig, TransferFunction, View, Volume};
use cao_wgpu::{Texture, adopt, adopt_texture, record, request_device};
use std::sync::Mutex;
use wgpu::util::DeviceExt;

const SIZE: [u32; 2] = [64, 48];
const PIXELS: usize = (SIZE[0] * SIZE[1]) as usize;
/// Opacity of a mm.
const OPACITY: f64 = 0.06;
const BACKGROUND: wgpu::Color = wgpu::Color { r: 0.1, g: 0.2, b: 0.5, a: 1.0 };
const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const MASK: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// What the validation layer said to wgpu.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Messages of older layers that are not kept: id, text, reason.
const MUTED: [(&str, &str, &str); 2] = [
    (
        "DrawState-InvalidImageLayout",
        "For optimal performance",
        "images of cao's own stay in GENERAL by design",
    ),
    (
        "Shader-InconsistentSpirv",
        "Invalid source language operand: 10",
        "wgpu's shaders are of WGSL, which they do not know",
    ),
];

struct Listener;

impl log::Log for Listener {
    fn enabled(&self, metadata: &log::Metadata) -> bool {
        metadata.target().starts_with("wgpu_hal::vulkan::instance")
    }

    fn log(&self, record: &log::Record) {
        let text = record.args().to_string();
        let muted = MUTED.iter().any(|(id, part, _)| text.contains(id) && text.contains(part));
        // Lines that begin with a tab go on about the objects of the message before.
        if self.enabled(record.metadata()) && !muted && !text.starts_with('\t') {
            MESSAGES.lock().unwrap().push(text);
        }
    }

    fn flush(&self) {}
}

/// What an engine has anyway.
struct Host {
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Host {
    fn new() -> Self {
        static LISTENER: Listener = Listener;
        if log::set_logger(&LISTENER).is_ok() {
            log::set_max_level(log::LevelFilter::Warn);
        }
        let validated = std::env::var_os("CAO_VALIDATION").is_none_or(|value| value != "0");
        let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
        desc.backends = wgpu::Backends::VULKAN;
        desc.flags = match validated {
            true => wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG,
            false => wgpu::InstanceFlags::empty(),
        };
        let instance = wgpu::Instance::new(desc);
        let adapter = pollster::block_on(instance.request_adapter(&Default::default())).unwrap();
        let desc = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) = request_device(&adapter, &desc).unwrap();
        Self { adapter, device, queue }
    }

    fn texture(&self, format: wgpu::TextureFormat) -> wgpu::Texture {
        let mut usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        if format == DEPTH {
            usage |= wgpu::TextureUsages::TEXTURE_BINDING;
        }
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 2 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    fn pipeline(&self, entry: &str, format: wgpu::TextureFormat, writes: bool) -> wgpu::RenderPipeline {
        let shader = self.device.create_shader_module(wgpu::include_wgsl!("host.wgsl"));
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(entry),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: Some("everywhere"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(writes),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &shader,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// A copy of a texture that can be read later.
    fn copy(&self, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) -> wgpu::Buffer {
        let texel = if texture.format() == COLOUR { 8 } else { 4 };
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 2 * PIXELS as u64 * texel,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(SIZE[0] * texel as u32),
            rows_per_image: Some(SIZE[1]),
        };
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            texture.size(),
        );
        buffer
    }

    fn wait(&self) {
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    }

    fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer) -> Vec<T> {
        buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
        self.wait();
        bytemuck::pod_collect_to_vec(&buffer.get_mapped_range(..).unwrap())
    }
}

/// A half float that is normal or 0.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    match exponent {
        0 => sign * fraction * 2f64.powi(-24),
        _ => sign * (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

/// Where a ray `origin + t · along` enters and leaves a box round the origin.
fn in_box(origin: Vec3, along: Vec3, half: Vec3) -> Option<[f64; 2]> {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..3 {
        let (o, d, h) = (f64::from(origin[i]), f64::from(along[i]), f64::from(half[i]));
        let ends = [(-h - o) / d, (h - o) / d];
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    (from < to).then_some([from.max(0.0), to])
}

/// A volume of even matter, 22 × 18 × 16 mm.
fn block() -> (Volume, TransferFunction) {
    let values = Values::F32(vec![1.0; 22 * 18 * 16]);
    let volume = Volume::new([22, 18, 16], [1.0; 3], values).unwrap();
    let points = vec![[0.0, OPACITY as f32], [2.0, OPACITY as f32]];
    (volume, TransferFunction::new(points, vec![[0.0, 1.0, 1.0, 1.0]], Some(1.0)).unwrap())
}

/// As Bevy has it: reversed, without a far plane.
fn eyes(volume: &Volume) -> [View; 2] {
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    let views = StereoRig::framing(volume.size_mm(), 30.0, 20.0).views(aspect, 10.0, 400.0).unwrap();
    views.map(|view| View { far_mm: f32::INFINITY, reversed: true, ..view })
}

/// Half inside of the volume, in front of it, behind it; each off the middle.
fn spheres(views: &[View; 2]) -> [(Vec3, f32); 3] {
    let eye = 0.5 * (views[0].position + views[1].position);
    let (ahead, right) = (-eye.normalize(), views[0].orientation * Vec3::X);
    [(Vec3::new(4.0, 2.0, 6.0), 5.0), (-25.0 * ahead - 5.0 * right, 4.0), (25.0 * ahead + 5.0 * right, 7.0)]
}

fn numbers(view: &View, spheres: &[(Vec3, f32); 3], plane: f32) -> [[f32; 4]; 8] {
    let ray = |x: f32, y: f32| view.ray(Vec2::new(x / SIZE[0] as f32, y / SIZE[1] as f32)).1;
    let corner = ray(0.0, 0.0);
    let [a, b] = view.depth_terms();
    let [inside, front, behind] = spheres.map(|(centre, radius)| centre.extend(radius).to_array());
    let vectors =
        [view.position, corner, ray(1.0, 0.0) - corner, ray(0.0, 1.0) - corner, Vec3::new(a, b, plane)];
    let [origin, corner, right, down, depth] = vectors.map(|v| v.extend(0.0).to_array());
    [origin, corner, right, down, depth, inside, front, behind]
}

/// Passes over both layers.
struct Passes {
    pipeline: wgpu::RenderPipeline,
    eyes: Vec<wgpu::BindGroup>,
}

impl Passes {
    fn new(host: &Host, pipeline: wgpu::RenderPipeline, eyes: &[wgpu::Buffer]) -> Self {
        let layout = pipeline.get_bind_group_layout(0);
        let group = |buffer: &wgpu::Buffer| {
            let entries = &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }];
            let desc = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries };
            host.device.create_bind_group(&desc)
        };
        let eyes = eyes.iter().map(group).collect();
        Self { pipeline, eyes }
    }

    fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (colour, background): (&wgpu::Texture, wgpu::Color),
        (depth, depths): (&wgpu::Texture, wgpu::LoadOp<f32>),
    ) {
        for (layer, group) in self.eyes.iter().enumerate() {
            let view = |texture: &wgpu::Texture| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    dimension: Some(wgpu::TextureViewDimension::D2),
                    base_array_layer: layer as u32,
                    array_layer_count: Some(1),
                    ..Default::default()
                })
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view(colour),
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(background),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &view(depth),
                    depth_ops: Some(wgpu::Operations { load: depths, store: wgpu::StoreOp::Store }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

/// What a frame left: colours and depths before and after cao drew, and where the plane was in front.
struct Found {
    colour: [wgpu::Buffer; 2],
    depth: [wgpu::Buffer; 2],
    mask: wgpu::Buffer,
}

#[test]
fn a_volume_goes_behind_and_in_front_of_what_wgpu_draws() {
    let host = Host::new();
    // SAFETY: the device was made for it, is dropped last, and its queue is used by this thread alone.
    let gpu = unsafe { adopt(&host.device) }.unwrap();
    let (volume, transfer) = block();
    let half_size = 0.5 * Vec3::from_array(volume.size_mm().map(|s| s as f32));
    let setup = Setup::new(volume.min_spacing());
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, Format::Rgba16Float).unwrap();
    let views = eyes(&volume);
    let spheres = spheres(&views);
    let look = Look { shading: Shading::None, tolerance: 0.0, ..Look::default() };

    let (colour, depth, mask) = (host.texture(COLOUR), host.texture(DEPTH), host.texture(MASK));
    // SAFETY: they are of the device, and never destroyed by hand.
    let lent = [&colour, &depth].map(|texture| unsafe { adopt_texture(&gpu, texture) }.unwrap());
    let [lent_colour, lent_depth]: &[Texture; 2] = &lent;
    let targets = Target::layers(lent_colour, lent_depth, 2);
    let targets: Vec<_> = targets.into_iter().map(|t| Target { scene: t.depth, ..t }).collect();

    // A plane through the volume's middle.
    let [a, b] = views[0].depth_terms();
    let plane = a + b / views[0].position.length();
    let uniforms = views.map(|view| {
        host.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: bytemuck::cast_slice(&numbers(&view, &spheres, plane)),
            usage: wgpu::BufferUsages::UNIFORM,
        })
    });
    let scene = Passes::new(&host, host.pipeline("spheres", COLOUR, true), &uniforms);
    let compared = Passes::new(&host, host.pipeline("plane", MASK, false), &uniforms);

    // Two frames in flight: half of the volume clipped away, and all of it there.
    let mut frames = Vec::new();
    for clipped in [true, false] {
        let mut encoder = host.encoder();
        scene.draw(&mut encoder, (&colour, BACKGROUND), (&depth, wgpu::LoadOp::Clear(0.0)));
        let before = [host.copy(&mut encoder, &colour), host.copy(&mut encoder, &depth)];
        let mut commands = vec![encoder.finish()];

        let mut clip = Clip::remove(Shape::Sphere);
        clip.pose.scale = Vec3::splat(9.0);
        renderer.set_clips(if clipped { std::slice::from_ref(&clip) } else { &[] }).unwrap();
        let targets = Targets { over: Over::Scene, ..Targets::new(&targets, SIZE) };
        let mut kept = Vec::new();
        // Twice where only differences are looked at: nothing of wgpu's is between then.
        for _ in 0..1 + usize::from(clipped) {
            // SAFETY: both are submitted below, in this order and at once, after a pass that clears; `recorded` is kept until they have run.
            let frame = unsafe {
                record(&gpu, &host.device, &[lent_colour, lent_depth], |rec| {
                    renderer.record_update(rec)?;
                    Ok(renderer.record_draw(rec, &views, &look, &targets)?)
                })
            }
            .unwrap();
            commands.extend(frame.commands);
            kept.push(frame.recorded);
        }

        let mut encoder = host.encoder();
        compared.draw(&mut encoder, (&mask, wgpu::Color::BLACK), (&depth, wgpu::LoadOp::Load));
        let after = [&colour, &depth, &mask].map(|texture| host.copy(&mut encoder, texture));
        commands.push(encoder.finish());
        host.queue.submit(commands);
        host.queue.on_submitted_work_done(move || drop(kept));

        let ([colour_before, depth_before], [colour_after, depth_after, mask]) = (before, after);
        frames.push(Found {
            colour: [colour_before, colour_after],
            depth: [depth_before, depth_after],
            mask,
        });
    }
    host.wait();

    let read = |found: &Found| {
        let colours = found.colour.each_ref().map(|buffer| host.read::<[u16; 4]>(buffer));
        let depths = found.depth.each_ref().map(|buffer| host.read::<f32>(buffer));
        (colours, depths, host.read::<f32>(&found.mask))
    };
    let ([_, clipped], ..) = read(&frames[0]);
    let ([there, found], [scene_depth, after], mask) = read(&frames[1]);
    let differ = clipped.iter().zip(&found).filter(|(clipped, whole)| clipped != whole).count();
    assert!(differ > 200, "the clip changes {differ} pixels");

    let half_way = 0.5f64.ln() / (1.0 - OPACITY).ln();
    let (mut within, mut hidden, mut seen_through, mut alone, mut deep) = (0, 0, 0, 0, 0);
    for i in 0..2 * PIXELS {
        let view = &views[i / PIXELS];
        let (x, y) = (i % PIXELS % SIZE[0] as usize, i % PIXELS / SIZE[0] as usize);
        let uv = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
        let (origin, along) = view.ray(uv);
        let [a, b] = view.depth_terms().map(f64::from);
        let empty = scene_depth[i] == 0.0;
        let end = if empty { f64::INFINITY } else { b / (f64::from(scene_depth[i]) - a) };
        let block = in_box(origin, along, half_size);
        let crossing = block.map_or([0.0; 2], |[from, to]| [from, to.min(end).max(from)]);
        let length = f64::from(along.length());
        let way = (crossing[1] - crossing[0]) * length;
        let alpha = 1.0 - (1.0 - OPACITY).powf(way);
        for c in 0..4 {
            let expected = alpha + (1.0 - alpha) * half(there[i][c]);
            let error = (half(found[i][c]) - expected).abs();
            // A float of the depth, and half a step of half floats.
            assert!(error < 2e-3 + 5e-4, "{x}, {y}: {:?} over {:?}", found[i].map(half), there[i].map(half));
        }
        if way > half_way + 0.6 {
            // Opacity passes a half in a stretch of at most a voxel.
            let t = b / (f64::from(after[i]) - a);
            let expected = crossing[0] + half_way / length;
            assert!((t - expected).abs() < 0.6, "{x}, {y}: half at {t} mm for {expected}");
            deep += 1;
        } else if way < half_way - 0.6 {
            assert_eq!(after[i].to_bits(), scene_depth[i].to_bits(), "{x}, {y}: the host's depth");
        }
        if way == 0.0 {
            assert_eq!(found[i], there[i], "{x}, {y}: the host's colour");
        }
        assert_eq!(mask[i] == 1.0, plane > after[i], "{x}, {y}: the host's plane and the volume's depth");
        let Some([from, to]) = block else { continue };
        hidden += u32::from(end < from);
        within += u32::from(from < end && end < to);
        seen_through += u32::from(!empty && end > to);
        alone += u32::from(empty);
    }
    let planes = mask.iter().filter(|&&one| one == 1.0).count();
    let counts = [within, hidden, seen_through, alone, deep, planes as u32];
    assert!(counts.iter().all(|&count| count > 40), "{counts:?}");

    assert_eq!(*MESSAGES.lock().unwrap(), [] as [&str; 0]);
    refusals(&host, &gpu, &colour);

    // The control: without the command buffer that moves the textures, they are in the layout of the copies above, and the layer says so.
    if std::env::var_os("CAO_VALIDATION").is_none_or(|value| value != "0") {
        let targets = Targets { over: Over::Scene, ..Targets::new(&targets, SIZE) };
        // SAFETY: it is not, and meant not to be: what the software driver and others make of it is a wrong picture at worst.
        let frame = unsafe {
            record(&gpu, &host.device, &[lent_colour, lent_depth], |rec| {
                Ok(renderer.record_draw(rec, &views, &look, &targets)?)
            })
        }
        .unwrap();
        let [_, ours] = frame.commands;
        host.queue.submit([ours]);
        host.wait();
        drop(frame.recorded);
        let messages = std::mem::take(&mut *MESSAGES.lock().unwrap());
        assert!(messages.iter().any(|message| message.contains("ayout")), "{messages:?}");
    }
    drop(targets);
    drop((renderer, lent));
    assert_eq!(gpu.memory_report(), []);
    drop(gpu);
    drop((scene, compared, frames, uniforms, colour, depth, mask));
    drop(host);
    // What is left of a device that is gone would be told now.
    assert_eq!(*MESSAGES.lock().unwrap(), [] as [&str; 0]);
}

/// What cannot be taken, and why.
fn refusals(host: &Host, gpu: &Gpu, colour: &wgpu::Texture) {
    let adopt_texture = |texture: &wgpu::Texture| {
        // SAFETY: what is refused is not used.
        unsafe { adopt_texture(gpu, texture) }.map(drop).unwrap_err().to_string()
    };
    let texture = |format, sample_count, usage| {
        host.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: 8, height: 8, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
    assert!(adopt_texture(&texture(MASK, 1, drawn)).contains("R32Float"));
    assert!(adopt_texture(&texture(COLOUR, 4, drawn)).contains("one sample"));
    assert!(adopt_texture(&texture(COLOUR, 1, wgpu::TextureUsages::COPY_DST)).contains("RENDER_ATTACHMENT"));

    // A texture named twice: nothing of it is submitted.
    // SAFETY: it is of the device, and never destroyed by hand.
    let lent = unsafe { cao_wgpu::adopt_texture(gpu, colour) }.unwrap();
    // SAFETY: nothing is submitted.
    let twice = unsafe { record(gpu, &host.device, &[&lent, &lent], |_| Ok(())) }.map(drop);
    assert!(twice.unwrap_err().to_string().contains("held already"));

    // A device as wgpu makes it.
    let bare = pollster::block_on(host.adapter.request_device(&Default::default())).unwrap().0;
    // SAFETY: what is refused is not used.
    let refused = unsafe { adopt(&bare) }.map(drop).unwrap_err().to_string();
    assert!(refused.contains("request_device"), "{refused}");
    let greedy = wgpu::DeviceDescriptor {
        required_limits: wgpu::Limits { max_texture_dimension_2d: u32::MAX, ..host.adapter.limits() },
        ..Default::default()
    };
    assert!(request_device(&host.adapter, &greedy).unwrap_err().to_string().contains("limits"));
}
