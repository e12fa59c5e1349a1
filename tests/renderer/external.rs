//! A host's own images: every form of target and every format, laid over what is there; its depth ends rays, and takes theirs.

use crate::host::Host;
use crate::host_image::HostImage;
use ash::vk;
use cao::draw::picture::Picture;
use cao::renderer::{COLOUR, Coding, LateViews, Over, Place, Renderer, Target, Targets};
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageState, ImageUse, Lent};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Shape};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::{View, with_insets};
use cao_model::volume::Volume;
use cao_testing::*;
use glam::{Vec2, Vec3};

const SIZE: [u32; 2] = [37, 29];
/// What the host's images hold before, as red, green, blue and alpha: exact in eight bits.
const THERE: [u8; 4] = [51, 102, 204, 255];

fn decode(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

fn encode(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    if c <= 0.0031308 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// A colour format: bytes of [`THERE`], and the components of a texel as the numbers that it stores.
struct Colours {
    format: Format,
    vulkan: vk::Format,
    coding: Coding,
    /// Distance of what can be stored.
    step: f32,
}

const COLOURS: [Colours; 7] = [
    Colours {
        format: Format::Rgba8Unorm,
        vulkan: vk::Format::R8G8B8A8_UNORM,
        coding: Coding::Linear,
        step: 1.0 / 255.0,
    },
    Colours {
        format: Format::Rgba8Unorm,
        vulkan: vk::Format::R8G8B8A8_UNORM,
        coding: Coding::Srgb,
        step: 1.0 / 255.0,
    },
    Colours {
        format: Format::Bgra8Unorm,
        vulkan: vk::Format::B8G8R8A8_UNORM,
        coding: Coding::Linear,
        step: 1.0 / 255.0,
    },
    Colours {
        format: Format::Rgba8Srgb,
        vulkan: vk::Format::R8G8B8A8_SRGB,
        coding: Coding::Linear,
        step: 1.0 / 255.0,
    },
    Colours {
        format: Format::Bgra8Srgb,
        vulkan: vk::Format::B8G8R8A8_SRGB,
        coding: Coding::Linear,
        step: 1.0 / 255.0,
    },
    Colours {
        format: Format::A2b10g10r10Unorm,
        vulkan: vk::Format::A2B10G10R10_UNORM_PACK32,
        coding: Coding::Linear,
        step: 1.0 / 1023.0,
    },
    // Eleven bits, and Vulkan lets a device round down.
    Colours {
        format: Format::Rgba16Float,
        vulkan: vk::Format::R16G16B16A16_SFLOAT,
        coding: Coding::Linear,
        step: 1.0 / 512.0,
    },
];

impl Colours {
    fn is_srgb(&self) -> bool {
        matches!(self.format, Format::Rgba8Srgb | Format::Bgra8Srgb)
    }

    /// [`THERE`] in this format.
    fn there(&self) -> Vec<u8> {
        let [r, g, b, a] = THERE;
        match self.format {
            Format::Bgra8Unorm | Format::Bgra8Srgb => vec![b, g, r, a],
            // 51, 102 and 204 of 255 are fifths.
            Format::A2b10g10r10Unorm => (205u32 | 409 << 10 | 818 << 20 | 3 << 30).to_le_bytes().to_vec(),
            // 0.2, 0.4, 0.8 and 1
            Format::Rgba16Float => [0x3266u16, 0x3666, 0x3a66, 0x3c00].map(u16::to_le_bytes).concat(),
            _ => vec![r, g, b, a],
        }
    }

    /// The numbers that a texel stores.
    fn stored(&self, texel: &[u8]) -> [f32; 4] {
        let bytes = || [0, 1, 2, 3].map(|i| f32::from(texel[i]) / 255.0);
        match self.format {
            Format::Bgra8Unorm | Format::Bgra8Srgb => {
                let [b, g, r, a] = bytes();
                [r, g, b, a]
            }
            Format::A2b10g10r10Unorm => {
                let word = u32::from_le_bytes(texel.try_into().unwrap());
                let tenth = |shift: u32| (word >> shift & 1023) as f32 / 1023.0;
                [tenth(0), tenth(10), tenth(20), (word >> 30) as f32 / 3.0]
            }
            Format::Rgba16Float => {
                [0, 1, 2, 3].map(|i| half_float(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]])))
            }
            _ => bytes(),
        }
    }

    /// What must be stored where a premultiplied linear colour lies over a stored one.
    fn over(&self, [r, g, b, a]: [f32; 4], there: [f32; 4]) -> [f32; 4] {
        let mixed = |colour: f32, there: f32| match self.coding {
            _ if self.is_srgb() => encode(colour + (1.0 - a) * decode(there)),
            Coding::Linear => colour + (1.0 - a) * there,
            Coding::Srgb if a == 0.0 => there,
            Coding::Srgb => a * encode(colour / a) + (1.0 - a) * there,
        };
        let [x, y, z, w] = there;
        let alpha = a + (1.0 - a) * w;
        let all = [mixed(r, x), mixed(g, y), mixed(b, z), alpha];
        if self.format == Format::Rgba16Float { all } else { all.map(|c| c.clamp(0.0, 1.0)) }
    }
}

/// Where views go: the host's images, each with a size and layers, and each view's image, layer and place.
struct Form {
    name: &'static str,
    images: Vec<([u32; 2], u32)>,
    places: Vec<(usize, u32, [u32; 2])>,
}

fn forms() -> Vec<Form> {
    let [w, h] = SIZE;
    let form = |name, images, places| Form { name, images, places };
    vec![
        form("one view", vec![(SIZE, 1)], vec![(0, 0, [0, 0])]),
        form("two layers", vec![(SIZE, 2)], vec![(0, 0, [0, 0]), (0, 1, [0, 0])]),
        form("an image an eye", vec![(SIZE, 1), (SIZE, 1)], vec![(0, 0, [0, 0]), (1, 0, [0, 0])]),
        form("side by side", vec![([2 * w, h], 1)], vec![(0, 0, [0, 0]), (0, 0, [w, 0])]),
        form(
            "viewports in a larger image",
            vec![([2 * w + 9, h + 7], 1)],
            vec![(0, 0, [w + 6, 5]), (0, 0, [2, 3])],
        ),
        form(
            "four views",
            vec![(SIZE, 2), ([w + 4, h + 4], 2)],
            vec![(0, 0, [0, 0]), (0, 1, [0, 0]), (1, 1, [4, 4]), (1, 0, [0, 1])],
        ),
    ]
}

/// All layers of an image of ours, one after the other.
fn texels(gpu: &Gpu, image: &Image) -> Vec<[f32; 4]> {
    let layers = image.desc().layers;
    let back = gpu.buffer("back", u64::from(16 * SIZE[0] * SIZE[1] * layers), BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        for layer in 0..layers {
            let at = u64::from(16 * SIZE[0] * SIZE[1] * layer);
            rec.copy_image_to_buffer(image, layer, [0; 3], [SIZE[0], SIZE[1], 1], &back, at).unwrap();
        }
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    bytemuck::pod_collect_to_vec(&back.read(0, back.bytes()).unwrap())
}

fn lend(
    gpu: &Gpu,
    host: &HostImage,
    desc: (Format, [u32; 2], u32),
    usage: ImageUse,
    state: ImageState,
) -> Image {
    let (format, size, layers) = desc;
    let lent = Lent { image: host.raw, size, layers, format, usage, before: state, after: state };
    // SAFETY: the image is of this device, as described, and destroyed after what is made of it; the host keeps it in the state.
    unsafe { gpu.adopt_image("host's", &lent) }.unwrap()
}

#[test]
fn every_form_and_format_holds_the_picture_over_what_was_there() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let renderer = fruit(&gpu, Format::Rgba8Srgb);
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let all = with_insets(eyes(&volume, 30.0), 0.5).unwrap();
    let look = Look::default();
    for (n, form) in forms().into_iter().enumerate() {
        let views = &all[..form.places.len()];
        let picture = Picture::new(&gpu, SIZE, views.len()).unwrap();
        run(&gpu, |rec| {
            renderer.record_picture(rec, views, &look, &picture).unwrap();
        });
        let expected = texels(&gpu, &picture.colour);
        // Every format with the first two forms, then one or two a form: what a form does depends on no format.
        for kind in COLOURS.iter().enumerate().filter(|(i, _)| n < 2 || i % 4 == n % 4).map(|(_, kind)| kind)
        {
            let state = ImageState::COLOUR_ATTACHMENT;
            let texel = kind.format.bytes() as usize;
            let images: Vec<_> = form
                .images
                .iter()
                .map(|&(size, layers)| HostImage::new(&host, kind.vulkan, texel, size, layers))
                .collect();
            let lent: Vec<_> = form
                .images
                .iter()
                .zip(&images)
                .map(|(&(size, layers), image)| {
                    lend(&gpu, image, (kind.format, size, layers), ImageUse::ATTACHMENT, state)
                })
                .collect();
            let targets: Vec<_> = form
                .places
                .iter()
                .map(|&(image, layer, at)| Target {
                    colour: Place { image: &lent[image], layer, at },
                    depth: None,
                    scene: None,
                })
                .collect();
            let cmd = host.begin();
            for (&(size, layers), image) in form.images.iter().zip(&images) {
                let texels = kind.there().repeat((size[0] * size[1] * layers) as usize);
                image.fill(&host, cmd, &texels, state.layout);
            }
            // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until then.
            let mut rec = unsafe { gpu.record_into(cmd) };
            lent.iter().for_each(|image| rec.acquire(image).unwrap());
            let targets = Targets { over: Over::Scene, coding: kind.coding, ..Targets::new(&targets, SIZE) };
            renderer.record_draw(&mut rec, views, &look, &targets).unwrap();
            lent.iter().for_each(|image| rec.release(image).unwrap());
            let recorded = rec.finish().unwrap();
            images.iter().for_each(|image| image.copy(&host, cmd, state.layout));
            host.submit_and_wait(&[cmd]);

            let what = format!("{}, {:?}, {:?}", form.name, kind.format, kind.coding);
            let there = kind.stored(&kind.there());
            for (i, (image, &(size, layers))) in images.iter().zip(&form.images).enumerate() {
                let texels = image.texels(&host);
                let (mut covered, mut untouched) = (0, 0);
                for at in 0..size[0] * size[1] * layers {
                    let (x, y, layer) = (at % size[0], at / size[0] % size[1], at / (size[0] * size[1]));
                    let view = form.places.iter().position(|&(of, in_layer, [left, top])| {
                        let inside = |at: u32, first: u32, size: u32| at >= first && at < first + size;
                        of == i && in_layer == layer && inside(x, left, SIZE[0]) && inside(y, top, SIZE[1])
                    });
                    let found = kind.stored(&texels[at as usize * texel..][..texel]);
                    let Some(view) = view else {
                        assert_eq!(found, there, "{what}: beside the view at {x}, {y}");
                        continue;
                    };
                    let [left, top] = form.places[view].2;
                    let pixel = (view as u32 * SIZE[1] + y - top) * SIZE[0] + x - left;
                    let colour = expected[pixel as usize];
                    let must = kind.over(colour, there);
                    for c in 0..4 {
                        // A device may round what comes, its product with what is there, and the sum to the format: half a step each.
                        let step = if kind.format == Format::A2b10g10r10Unorm && c == 3 {
                            1.0 / 3.0
                        } else {
                            kind.step
                        };
                        assert!(
                            (found[c] - must[c]).abs() <= 1.51 * step,
                            "{what}: {x}, {y}: {found:?} for {must:?}"
                        );
                    }
                    covered += u32::from(colour[3] > 0.5);
                    untouched += u32::from(colour[3] == 0.0);
                }
                assert!(covered > 30 && untouched > 10, "{what}: {covered}, {untouched}");
            }
            drop((recorded, lent));
            images.into_iter().for_each(|image| image.destroy(&host));
        }
    }
    drop(renderer);
    assert_eq!(gpu.memory_report(), []);
    drop(gpu);
    host.destroy();
}

/// A depth format: how it stores a depth, and what it stores.
struct Depths {
    format: Format,
    vulkan: vk::Format,
    store: fn(f64) -> Vec<u8>,
    load: fn(&[u8]) -> f64,
    texel: usize,
    /// Half the distance of what can be stored.
    error: f64,
}

const LOW_24: f64 = 16777215.0;

const DEPTHS: [Depths; 3] = [
    Depths {
        format: Format::D32Float,
        vulkan: vk::Format::D32_SFLOAT,
        store: |d| (d as f32).to_le_bytes().to_vec(),
        load: |b| f32::from_le_bytes(b.try_into().unwrap()).into(),
        texel: 4,
        error: 1e-7,
    },
    Depths {
        format: Format::D24UnormS8,
        vulkan: vk::Format::D24_UNORM_S8_UINT,
        store: |d| ((d * LOW_24).round() as u32).to_le_bytes().to_vec(),
        load: |b| f64::from(u32::from_le_bytes(b.try_into().unwrap()) & 0xff_ffff) / LOW_24,
        texel: 4,
        error: 1e-7,
    },
    Depths {
        format: Format::D16Unorm,
        vulkan: vk::Format::D16_UNORM,
        store: |d| ((d * 65535.0).round() as u16).to_le_bytes().to_vec(),
        load: |b| f64::from(u16::from_le_bytes(b.try_into().unwrap())) / 65535.0,
        texel: 2,
        error: 8e-6,
    },
];

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

/// Where it first meets a sphere round `centre`.
fn on_sphere(origin: Vec3, along: Vec3, centre: Vec3, radius: f64) -> Option<f64> {
    let (o, d) = ((origin - centre).as_dvec3(), along.as_dvec3());
    let (a, half_b, c) = (d.dot(d), o.dot(d), o.dot(o) - radius * radius);
    let root = half_b * half_b - a * c;
    (root > 0.0).then(|| (-half_b - root.sqrt()) / a)
}

/// The host's sphere is half inside of a block of even matter, which light passes by a known share a mm: each pixel's opacity is that of
/// the way in front of the sphere, and the depth is where half of it is stopped, else the host's own to the bit.
#[test]
fn a_hosts_sphere_ends_rays_in_every_convention_and_format() {
    const OPACITY: f64 = 0.06;
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let values = Values::F32(vec![1.0; 22 * 18 * 16]);
    let volume = Volume::new([22, 18, 16], [1.0; 3], values).unwrap();
    let half = Vec3::new(11.0, 9.0, 8.0);
    let points = vec![[0.0, OPACITY as f32], [2.0, OPACITY as f32]];
    let transfer = TransferFunction::new(points, vec![[0.0, 1.0, 1.0, 1.0]], Some(1.0)).unwrap();
    let setup = Setup::of(Method::Cao, volume.min_spacing());
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, Format::Rgba16Float).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let look = Look { shading: Shading::None, tolerance: 0.0, ..Look::default() };
    let (centre, radius) = (Vec3::new(4.0, 2.0, 6.0), 5.0);
    let colour_state = ImageState::COLOUR_ATTACHMENT;
    let depth_state = ImageState::DEPTH_ATTACHMENT;
    for kind in &DEPTHS {
        for (reversed, far_mm) in
            [(false, 400.0), (true, 400.0), (false, f32::INFINITY), (true, f32::INFINITY)]
        {
            let views = eyes(&volume, 30.0).map(|view| View { near_mm: 20.0, far_mm, reversed, ..view });
            let what = format!("{:?}, reversed {reversed}, far {far_mm}", kind.format);
            let rays: Vec<_> = views
                .iter()
                .flat_map(|view| {
                    let places =
                        (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| Vec2::new(x as f32, y as f32)));
                    places.map(move |at| {
                        (view, view.ray((at + 0.5) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32)))
                    })
                })
                .collect();
            let spheres: Vec<_> = rays.iter().map(|(_, (o, d))| on_sphere(*o, *d, centre, radius)).collect();
            let depths: Vec<_> = rays
                .iter()
                .zip(&spheres)
                .flat_map(|((view, _), sphere)| {
                    let [a, b] = view.depth_terms().map(f64::from);
                    (kind.store)(sphere.map_or(f64::from(view.depth_of_nothing()), |t| a + b / t))
                })
                .collect();

            let colour = HostImage::new(&host, vk::Format::R32G32B32A32_SFLOAT, 16, SIZE, 2);
            let depth = HostImage::new(&host, kind.vulkan, kind.texel, SIZE, 2);
            let lent_colour = lend(&gpu, &colour, (COLOUR, SIZE, 2), ImageUse::ATTACHMENT, colour_state);
            let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
            let lent_depth = lend(&gpu, &depth, (kind.format, SIZE, 2), usage, depth_state);
            let targets = Target::layers(&lent_colour, &lent_depth, 2);
            let targets: Vec<_> =
                targets.into_iter().map(|target| Target { scene: target.depth, ..target }).collect();

            let cmd = host.begin();
            colour.fill(&host, cmd, &vec![0; 16 * rays.len()], colour_state.layout);
            depth.fill(&host, cmd, &depths, depth_state.layout);
            // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until then.
            let mut rec = unsafe { gpu.record_into(cmd) };
            rec.acquire(&lent_colour).unwrap();
            rec.acquire(&lent_depth).unwrap();
            let targets = Targets { over: Over::Scene, ..Targets::new(&targets, SIZE) };
            renderer.record_draw(&mut rec, &views, &look, &targets).unwrap();
            rec.release(&lent_colour).unwrap();
            rec.release(&lent_depth).unwrap();
            let recorded = rec.finish().unwrap();
            colour.copy(&host, cmd, colour_state.layout);
            depth.copy(&host, cmd, depth_state.layout);
            host.submit_and_wait(&[cmd]);

            let found: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&colour.texels(&host));
            let after = depth.texels(&host);
            let (mut within, mut deep, mut behind) = (0, 0, 0);
            for (i, ((view, (origin, along)), sphere)) in rays.iter().zip(&spheres).enumerate() {
                let [a, b] = view.depth_terms().map(f64::from);
                // The sphere as the format knows it: its error in mm is that of the depth over the slope of a + b/t.
                let end = sphere.map_or(f64::INFINITY, |t| b / ((kind.load)(&(kind.store)(a + b / t)) - a));
                let slack = sphere.map_or(0.0, |t| kind.error * t * t / b.abs());
                let length = f64::from(along.length());
                let crossing = in_box(*origin, *along, half)
                    .map_or([0.0; 2], |[from, to]| [from, to.min(end).max(from)]);
                let way = (crossing[1] - crossing[0]) * length;
                let alpha = 1.0 - (1.0 - OPACITY).powf(way);
                // A float of a thousand mm of way, and the format's.
                let error = 2e-3 + slack * length * 0.07;
                assert!(
                    (f64::from(found[i][3]) - alpha).abs() < error,
                    "{what}: pixel {i}: {} for {alpha}",
                    found[i][3]
                );
                let half_way = 0.5f64.ln() / (1.0 - OPACITY).ln();
                let texel = &after[i * kind.texel..][..kind.texel];
                let before = &depths[i * kind.texel..][..kind.texel];
                if way > half_way + 0.6 {
                    // Opacity passes a half in a stretch of at most a voxel, and its light comes from the middle of that.
                    let t = b / ((kind.load)(texel) - a);
                    let expected = crossing[0] + half_way / length;
                    let error = 0.6 + kind.error * t * t / b.abs();
                    assert!((t - expected).abs() < error, "{what}: pixel {i}: half at {t} mm for {expected}");
                    deep += 1;
                } else if way < half_way - 0.6 {
                    assert_eq!(
                        texel[..kind.texel.min(3)],
                        before[..kind.texel.min(3)],
                        "{what}: pixel {i}: the host's depth"
                    );
                    behind += u32::from(way == 0.0);
                }
                within += u32::from(
                    sphere.is_some() && way > 0.0 && end < in_box(*origin, *along, half).unwrap()[1],
                );
            }
            assert!(within > 80 && deep > 100 && behind > 100, "{what}: {within}, {deep}, {behind}");
            drop((recorded, lent_colour, lent_depth));
            colour.destroy(&host);
            depth.destroy(&host);
        }
    }
    drop(renderer);
    drop(gpu);
    host.destroy();
}

#[test]
fn images_that_are_not_held_or_not_lent_are_refused_by_name() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let renderer = fruit(&gpu, Format::Rgba8Srgb);
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let views = eyes(&volume, 30.0);
    let state = ImageState::COLOUR_ATTACHMENT;
    let image = HostImage::new(&host, vk::Format::R8G8B8A8_SRGB, 4, SIZE, 2);
    let lent = lend(&gpu, &image, (Format::Rgba8Srgb, SIZE, 2), ImageUse::ATTACHMENT, state);
    let target =
        |layer| Target { colour: Place { image: &lent, layer, at: [0; 2] }, depth: None, scene: None };
    let targets = [target(0), target(1)];
    let mut rec = gpu.recorder("refused").unwrap();
    let draw = |rec: &mut cao_gpu::Recorder| {
        let drawn = renderer.record_draw(rec, &views, &Look::default(), &Targets::new(&targets, SIZE));
        drawn.map(drop).map_err(|error| error.to_string())
    };
    assert!(draw(&mut rec).unwrap_err().contains("rec.acquire(&image)"));
    let said = |done: cao_gpu::Result<()>| done.unwrap_err().to_string();
    assert!(said(rec.release(&lent)).contains("not held"));
    rec.discard(&lent);
    rec.acquire(&lent).unwrap();
    assert!(said(rec.acquire(&lent)).contains("held already"));
    assert!(said(rec.clear_image(&lent, [0.0; 4])).contains("the host's"));
    draw(&mut rec).unwrap();
    rec.release(&lent).unwrap();
    assert!(draw(&mut rec).unwrap_err().contains("rec.acquire(&image)"));
    let ours = Picture::new(&gpu, SIZE, 1).unwrap();
    assert!(said(rec.acquire(&ours.colour)).contains("our own"));
    drop(rec);

    // What no image is.
    let good = Lent {
        image: image.raw,
        size: SIZE,
        layers: 2,
        format: Format::Rgba8Srgb,
        usage: ImageUse::ATTACHMENT,
        before: state,
        after: state,
    };
    for (lent, word) in [
        (Lent { image: vk::Image::null(), ..good }, "null"),
        (Lent { size: [0, 3], ..good }, "at least 1"),
        (Lent { layers: 0, ..good }, "at least 1"),
        (Lent { size: [1 << 20, 3], ..good }, "width"),
        (Lent { after: ImageState { layout: vk::ImageLayout::UNDEFINED, ..state }, ..good }, "no layout"),
    ] {
        // SAFETY: what is not as described is refused before it is used.
        let refused = unsafe { gpu.adopt_image("swapchain", &lent) }.map(drop).unwrap_err().to_string();
        assert!(refused.contains("swapchain") && refused.contains(word), "{refused}");
    }
    drop((lent, ours, renderer));
    image.destroy(&host);
    drop(gpu);
    host.destroy();
}

/// A frame is recorded with a guess of where the head will be and submitted to wait; then the head is known, and its views are drawn, in its
/// light, to the bit.
#[test]
fn views_may_come_after_the_frame_was_submitted() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let renderer = fruit(&gpu, Format::Rgba8Srgb);
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let (guess, known) = (eyes(&volume, 30.0), eyes(&volume, 48.0));
    let look = Look::default();
    let late = LateViews::new(&gpu, &guess, &look).unwrap();
    let pictures = [0, 1, 2].map(|_| Picture::new(&gpu, SIZE, 2).unwrap());
    // SAFETY: the device has timeline semaphores.
    let semaphore = unsafe {
        let mut kind = vk::SemaphoreTypeCreateInfo::default()
            .semaphore_type(vk::SemaphoreType::TIMELINE)
            .initial_value(3);
        let create = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        host.device().create_semaphore(&create, None).unwrap()
    };
    let cmd = host.begin();
    // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until then.
    let mut rec = unsafe { gpu.record_into(cmd) };
    renderer.record_picture(&mut rec, &late, &look, &pictures[0]).unwrap();
    let recorded = rec.finish().unwrap();
    host.submit_after(cmd, semaphore, 4);
    late.write(&known, &look).unwrap();
    // SAFETY: the semaphore is alive, and its value lower.
    unsafe {
        let signal = vk::SemaphoreSignalInfo::default().semaphore(semaphore).value(4);
        host.device().signal_semaphore(&signal).unwrap();
        host.device().queue_wait_idle(host.queue).unwrap();
    }
    run(&gpu, |rec| {
        renderer.record_picture(rec, &known, &look, &pictures[1]).unwrap();
        renderer.record_picture(rec, &guess, &look, &pictures[2]).unwrap();
    });
    let [found, expected, guessed] = pictures.each_ref().map(|picture| texels(&gpu, &picture.colour));
    assert!(found == expected && found != guessed);

    let error = |views: &[View]| late.write(views, &look).unwrap_err().to_string();
    assert!(error(&known[..1]).contains("than planned"));
    assert!(error(&known.map(|view| View { far_mm: 9e3, ..view })).contains("planes"));
    // SAFETY: nothing waits for it.
    unsafe { host.device().destroy_semaphore(semaphore, None) };
    drop((recorded, late, pictures, renderer));
    drop(gpu);
    host.destroy();
}

/// The update in a submission of its own, the drawing in another, as on two queues of a family: ordered by a timeline semaphore alone, each update after
/// the drawing before it.
#[test]
fn updates_and_drawings_are_ordered_by_a_timeline_alone() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let mut renderer = fruit(&gpu, Format::Rgba8Srgb);
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let (views, look) = (eyes(&volume, 30.0), Look::default());
    // SAFETY: the device has timeline semaphores.
    let semaphore = unsafe {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let create = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        host.device().create_semaphore(&create, None).unwrap()
    };
    let clip = |frame: usize| {
        let mut clip = Clip::remove(Shape::Sphere);
        clip.pose.scale = Vec3::splat(5.0);
        clip.pose.translate_mm.x = frame as f32 - 2.0;
        clip
    };
    let mut frames = Vec::new();
    for frame in 0..4 {
        renderer.set_clips(&[clip(frame)]).unwrap();
        let picture = Picture::new(&gpu, SIZE, 2).unwrap();
        let (update, draw) = (host.begin(), host.begin());
        // SAFETY: both are recording and submitted once below, in this order; each `Recorded` is kept until then.
        let mut rec = unsafe { gpu.record_into(update) };
        renderer.record_update(&mut rec).unwrap();
        let updated = rec.finish().unwrap();
        // SAFETY: as above.
        let mut rec = unsafe { gpu.record_into(draw) };
        renderer.record_picture(&mut rec, &views, &look, &picture).unwrap();
        let drawn = rec.finish().unwrap();
        let before = 2 * frame as u64;
        host.submit_between(update, semaphore, before, before + 1);
        host.submit_between(draw, semaphore, before + 1, before + 2);
        frames.push((picture, updated, drawn));
    }
    // SAFETY: the queue is the host's.
    unsafe { host.device().queue_wait_idle(host.queue).unwrap() };
    for (frame, (picture, ..)) in frames.iter().enumerate() {
        renderer.set_clips(&[clip(frame)]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let colour = renderer.draw(&views, &look, SIZE).unwrap().0.colour;
        assert!(texels(&gpu, &picture.colour) == colour.concat(), "frame {frame}");
    }
    // SAFETY: nothing waits for it.
    unsafe { host.device().destroy_semaphore(semaphore, None) };
    drop((frames, renderer));
    drop(gpu);
    host.destroy();
}
