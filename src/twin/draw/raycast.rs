//! The volume as one eye sees it (CAO §3.5 step 6).
//!
//! Along the ray of each pixel, front to back, segments between samples at t_begin + k·Δt in mm (`segment.rs`):
//!
//! ```text
//! α_k = 1 − exp ∫ ln(1 − TF_o(V)) dt/ℓ,  over the part of the segment that no clip hides
//! C  += (1 − A) α_k · L(c_k, p_k)                                         L: shading.rs
//! A  += (1 − A) α_k                                                         until (1 − A)·L·E′(C) ≤ ½/255
//! ```
//!
//! where c_k is the segment's mean colour and p_k where its light comes from; the last L is the brightest light there is and E′ the slope
//! of sRGB coding at the darkest component: what remains cannot change an 8-bit pixel by more than half a level. A segment that stops
//! more light than its ends alone say is halved, up to four times; stretches of segments are lit together, up to four steps and a voxel long or until they stop an eighth of the light.

use crate::clip::clips::{ClipField, visible};
use crate::draw::air::{air_of, ambient_at, coloured_ambient_at};
use crate::draw::feature_colour::{Parts, colour_at, light_at};
use crate::draw::segment::{Segment, segment, varies};
use crate::draw::shading::{Shown, shaded};
use crate::{Grid, each, trilinear_clamped};
use cao_kernels::raycast as kernel;
use cao_model::look::Look;
use cao_model::transfer::TransferFunction;
use cao_model::view::View;
use glam::{DVec3, Vec2, Vec3};

/// A ray ends when what remains cannot change an 8-bit sRGB pixel by more than this many levels.
pub const TOLERANCE: f64 = 0.5;

/// Share of a pixel's light that a stretch of steps may stop before it is lit.
const MOST_LIT: f64 = kernel::MOST_LIT as f64;

/// Parts that a step can be halved into.
const PARTS: u64 = kernel::PARTS as u64;

/// What is drawn; fields are x fastest.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// Shape of the fields.
    pub grid: Grid,
    /// Data values V; with features opacities after them.
    pub values: &'a [f32],
    /// The features, if there are any.
    pub parts: Option<Parts<'a>>,
    /// Opacity and colour of data values; with features its opacities are its values.
    pub transfer: &'a TransferFunction,
    /// Length ℓ in mm that opacities are for.
    pub reference_mm: f64,
    /// V_AO, ambient factor.
    pub ambient: &'a [f32],
    /// Clips.
    pub clips: &'a [ClipField],
    /// Distance Δt of samples in mm.
    pub step_mm: f64,
    /// Light; where it is the head's, each view is a head.
    pub look: Look,
}

/// Image of one eye, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Linear RGBA, premultiplied.
    pub colour: Vec<[f32; 4]>,
    /// Vulkan depth 0 … 1 where half of the light is stopped; 1 where never.
    pub depth: Vec<f32>,
}

/// Draws `size` = [width, height] pixels: the mean of the look's samples, each the picture of a field of view that is shifted by its
/// place in the pixel, and the depth of the first.
pub fn raycast(frame: &Frame, view: &View, size: [usize; 2]) -> Image {
    let ambient = |position| {
        let channels = frame.parts.and_then(|parts| Some((parts, parts.channels?)));
        let values = channels.map_or(frame.ambient, |(parts, channels)| {
            let place = Vec3::from_array(frame.grid.to_world(position).map(|c| c as f32));
            let voxels = if visible(frame.clips, place) { frame.values } else { parts.spared };
            let feature = light_at(&frame.grid, &parts, voxels, position);
            &channels[feature.checked_sub(1).map_or(4, |channel| channel % 4)]
        });
        ambient_at(&frame.grid, values, position)
    };
    drawn(frame, view, size, ambient)
}

/// The same by V_AO in coloured light, red, green and blue: each as if its factors were those of all.
pub fn raycast_coloured(frame: &Frame, ambient: &[Vec<f32>; 3], view: &View, size: [usize; 2]) -> Image {
    let [mut red, green, blue] = [0, 1, 2]
        .map(|c| drawn(frame, view, size, |position| coloured_ambient_at(&frame.grid, ambient, position)[c]));
    for (i, colour) in red.colour.iter_mut().enumerate() {
        (colour[1], colour[2]) = (green.colour[i][1], blue.colour[i][2]);
    }
    red
}

/// By ambient factors of index coordinates.
fn drawn(
    frame: &Frame,
    view: &View,
    size: [usize; 2],
    ambient: impl Fn([f64; 3]) -> f64 + Sync + Copy,
) -> Image {
    let views: Vec<View> = frame.look.offsets().into_iter().map(|at| shifted(view, size, at)).collect();
    let mean = |i| {
        let samples = views.iter().map(|view| pixel(frame, view, size, i, &mut |position| ambient(position)));
        let samples: Vec<([f32; 4], f32)> = samples.collect();
        let sum = |c: usize| samples.iter().map(|(colour, _)| f64::from(colour[c])).sum::<f64>();
        (std::array::from_fn(|c| (sum(c) / samples.len() as f64) as f32), samples[0].1)
    };
    let (colour, depth) = each(size[0] * size[1], mean).into_iter().unzip();
    Image { colour, depth }
}

/// The view whose pixels' centres are at this place, in pixels, from those of `view`.
pub fn shifted(view: &View, size: [usize; 2], place: Vec2) -> View {
    let mut tan = view.tan;
    let x = place.x / size[0] as f32 * (tan.right - tan.left);
    let y = place.y / size[1] as f32 * (tan.down - tan.up);
    (tan.left, tan.right, tan.up, tan.down) = (tan.left + x, tan.right + x, tan.up + y, tan.down + y);
    View { tan, ..*view }
}

/// Index coordinates of the air whose ambient factor these pixels show, in the order of their rays; where a ray ends depends on what it
/// has read, and these go as far as the darkest does. One sample a pixel.
pub fn ambient_positions(
    frame: &Frame,
    view: &View,
    size: [usize; 2],
    pixels: &[usize],
) -> Vec<Vec<[f64; 3]>> {
    each(pixels.len(), |i| {
        let mut positions = Vec::new();
        pixel(frame, view, size, pixels[i], &mut |position| {
            positions.push(air_of(&frame.grid, frame.ambient, position));
            0.0
        });
        positions
    })
}

/// Draws these pixels with ambient factors of their own instead of the frame's, one for each of [`ambient_positions`].
pub fn raycast_lit(
    frame: &Frame,
    view: &View,
    size: [usize; 2],
    pixels: &[usize],
    ambient: &[Vec<f64>],
) -> Image {
    let (colour, depth) = each(pixels.len(), |i| {
        let mut ambient = ambient[i].iter();
        pixel(frame, view, size, pixels[i], &mut |_| *ambient.next().expect("one value a position"))
    })
    .into_iter()
    .unzip();
    Image { colour, depth }
}

/// Pixel `index`, its ambient factors from `ambient` of index coordinates.
fn pixel(
    frame: &Frame,
    view: &View,
    size: [usize; 2],
    index: usize,
    ambient: &mut dyn FnMut([f64; 3]) -> f64,
) -> ([f32; 4], f32) {
    let [x, y] = [index % size[0], index / size[0]];
    let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
    let (origin, direction) = view.ray(centre / Vec2::new(size[0] as f32, size[1] as f32));
    let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
    // The view's ray advances 1 mm of depth per unit; samples are spaced along the ray itself.
    let slant = direction.length();
    let direction = direction / slant;
    let box_range = crossing(&frame.grid, origin, direction);
    let begin = box_range[0].max(f64::from(view.near_mm) * slant);
    let end = box_range[1].min(f64::from(view.far_mm) * slant);

    let at = |t: f64| frame.grid.to_index((origin + t * direction).to_array());
    let value_at = |t: f64| trilinear_clamped(&frame.grid, frame.values, at(t)) as f32;
    let shown_at = |t: f64| visible(frame.clips, (origin + t * direction).as_vec3());
    // A white background, or a white sample that faces the light and mirrors it.
    let brightest = 1.0_f64.max(frame.look.parts().iter().sum::<f32>().into());
    let light = frame.look.towards_light(view.orientation).as_dvec3();
    let (mut colour, mut alpha, mut depth) = (DVec3::ZERO, 0.0, 1.0);
    let (mut clip, mut cut_at) = (None, 0.0);
    // Of the stretch that is not lit yet: where it begins, what passes, and the colours that it stops, place and value times the share that
    // is stopped there.
    let (mut first, mut open, mut lit) = (0, 1.0, (DVec3::ZERO, 0.0, 0.0));
    let steps = (frame.grid.min_spacing() / frame.step_mm + 0.01).clamp(1.0, f64::from(kernel::STEPS_LIT));
    let stretch = PARTS * steps as u64;
    // Parts of steps so far, and of the next one.
    let (mut n, mut size) = (0, PARTS);
    let place = |n: u64| begin + n as f64 * frame.step_mm / PARTS as f64;
    loop {
        let t = place(n);
        if open < 1.0 {
            let covered = (1.0 - alpha) * (1.0 - open);
            let ends = |colour: DVec3, rest: f64| {
                rest * brightest * srgb_slope(colour.min_element()) <= TOLERANCE / 255.0
            };
            let full = n % PARTS == 0 && (covered > MOST_LIT || n - first >= stretch);
            // What is left out of a stretch also moves the place where it is lit.
            if t >= end || full || ends(colour, 2.0 * (1.0 - alpha) * open) {
                // The stretch is lit where its light comes from.
                let stops = 1.0 - open;
                let t = lit.1 / stops;
                let shown = Shown {
                    position: at(t),
                    world: origin + t * direction,
                    value: (lit.2 / stops) as f32,
                    colour: lit.0 / stops,
                    cut: clip,
                    beside: t - cut_at,
                };
                let hidden = frame.parts.filter(|_| !shown_at(t));
                let shown = Shown { cut: shown.cut.filter(|_| hidden.is_none()), ..shown };
                let left = Frame { values: hidden.map_or(frame.values, |parts| parts.spared), ..*frame };
                // With features, of the place; else of the way.
                let own = frame
                    .parts
                    .map(|parts| colour_at(&frame.grid, &parts, left.values, frame.transfer, shown.position));
                let shown = Shown { colour: own.unwrap_or(shown.colour), ..shown };
                colour += covered * shaded(&left, &shown, direction, light, ambient);
                alpha += covered;
                if depth == 1.0 && alpha >= 0.5 {
                    depth = vulkan_depth(view, t / slant);
                }
                if ends(colour, 1.0 - alpha) {
                    break;
                }
                (open, lit) = (1.0, (DVec3::ZERO, 0.0, 0.0));
            }
        }
        if t >= end {
            break;
        }
        let next = place(n + size).min(end);
        let [mut from, mut to] = [t, next];
        let mut hidden_at = None;
        let [shown, stays] = [t, next].map(shown_at);
        if shown != stays {
            let (hidden, cut) = if stays { cut(t, next, shown_at) } else { cut(next, t, shown_at) };
            hidden_at = Some(hidden);
            if stays {
                clip =
                    frame.clips.iter().position(|clip| clip.hides((origin + hidden * direction).as_vec3()));
                (from, cut_at) = (cut, cut);
            } else {
                to = cut;
            }
        }
        let mut ends = [from, to];
        let mut values = ends.map(value_at);
        let mut found = piece(frame, ends, values);
        if let Some(parts) = frame.parts.filter(|_| !(shown && stays)) {
            // What clips leave whole of what they hide.
            let [mut first, mut last] = [t, next];
            if let Some(hidden) = hidden_at {
                if stays { last = hidden } else { first = hidden }
            }
            let kept_at = |t: f64| trilinear_clamped(&frame.grid, parts.spared, at(t)) as f32;
            let kept_values = [first, last].map(kept_at);
            let kept = piece(frame, [first, last], kept_values);
            ends = [t, next];
            (found, values) = match hidden_at {
                None => (kept, kept_values),
                Some(hidden) if stays => {
                    (joined(kept, found, (hidden - t) / (next - t)), [kept_values[0], values[1]])
                }
                Some(hidden) => (joined(found, kept, (hidden - t) / (next - t)), [values[0], kept_values[1]]),
            };
        }
        if shown || stays || frame.parts.is_some_and(|_| found.alpha > 0.0) {
            [from, to] = ends;
            let length = (to - from) / frame.reference_mm;
            if size > 1 && varies(frame.transfer, &found, values, length, open * (1.0 - alpha)) {
                size /= 2;
                continue;
            }
            if open == 1.0 {
                first = n;
            }
            let share = open * found.alpha;
            lit.0 += open * found.colour;
            lit.1 += share * (from + found.centre * (to - from));
            lit.2 += share * (f64::from(values[0]) + found.centre * f64::from(values[1] - values[0]));
            open *= 1.0 - found.alpha;
        }
        n += size;
        size = (2 * size).min(PARTS).min(1 << n.trailing_zeros());
    }
    ([colour.x as f32, colour.y as f32, colour.z as f32, alpha as f32], depth as f32)
}

/// A segment between two depths with these values.
fn piece(frame: &Frame, [from, to]: [f64; 2], values: [f32; 2]) -> Segment {
    segment(frame.transfer, values[0], values[1], (to - from) / frame.reference_mm)
}

/// Two segments one behind the other as one, the first of which has a share of the length.
fn joined(a: Segment, b: Segment, share: f64) -> Segment {
    let behind = (1.0 - a.alpha) * b.alpha;
    let alpha = a.alpha + behind;
    let centre = a.alpha * a.centre * share + behind * (share + b.centre * (1.0 - share));
    Segment {
        alpha,
        colour: a.colour + (1.0 - a.alpha) * b.colour,
        centre: if alpha > 0.0 { centre / alpha } else { 0.5 },
    }
}

/// Slope of sRGB coding (IEC 61966-2-1) at a linear component; beyond 1, where a screen shows no more, that at 1.
fn srgb_slope(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 } else { 1.055 / 2.4 * linear.min(1.0).powf(1.0 / 2.4 - 1.0) }
}

/// Where a ray comes out of a clip, between a hidden and a visible sample, by a few halvings of their distance: just before and just
/// behind. A cut face is shaded at one depth.
fn cut(mut hidden: f64, mut shown: f64, shown_at: impl Fn(f64) -> bool) -> (f64, f64) {
    for _ in 0..kernel::CUT_HALVINGS {
        let middle = (hidden + shown) / 2.0;
        if shown_at(middle) {
            shown = middle;
        } else {
            hidden = middle;
        }
    }
    (hidden, shown)
}

/// Distances in mm at which a ray enters and leaves the volume, the box of index coordinates −½ … dims − ½; the first
/// is larger than the second when it misses.
fn crossing(grid: &Grid, origin: DVec3, direction: DVec3) -> [f64; 2] {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let half = grid.dims[axis] as f64 * grid.spacing[axis] / 2.0;
        if direction[axis] == 0.0 {
            if origin[axis].abs() > half {
                return [f64::INFINITY, f64::NEG_INFINITY];
            }
            continue;
        }
        let a = (-half - origin[axis]) / direction[axis];
        let b = (half - origin[axis]) / direction[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    [enter, leave]
}

/// Depth buffer value at a distance in mm along the view axis.
fn vulkan_depth(view: &View, distance: f64) -> f64 {
    let (near, far) = (f64::from(view.near_mm), f64::from(view.far_mm));
    (far / (far - near) * (1.0 - near / distance)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::classify::tests::{field, random_clip, shapes};
    use crate::random::Random;
    use cao_model::clip::{Clip, Mode, Pose, Shape};
    use cao_model::look::{LightFrom, Occluded, Shading};
    use cao_model::view::{StereoRig, Tangents};
    use glam::{Quat, Vec3};

    /// One opacity for every value, colour by value.
    fn even(opacity: f32) -> TransferFunction {
        TransferFunction::new(vec![[0.0, opacity]], vec![[0.0, 0.2, 0.4, 0.8]], None).unwrap()
    }

    /// Fields of one volume.
    struct Scene {
        grid: Grid,
        values: Vec<f32>,
        transfer: TransferFunction,
        ambient: Vec<f32>,
        clips: Vec<ClipField>,
        look: Look,
    }

    impl Scene {
        fn even(opacity: f32) -> Self {
            let grid = Grid { dims: [10, 12, 8], spacing: [1.0, 1.0, 2.0] };
            Self {
                grid,
                values: vec![0.0; grid.len()],
                transfer: even(opacity),
                ambient: vec![0.5; grid.len()],
                clips: Vec::new(),
                look: Look {
                    ambient: 0.25,
                    diffuse: 0.5,
                    specular: 0.0,
                    light: Vec3::new(0.0, 0.6, 0.8),
                    light_from: LightFrom::World,
                    occluded: Occluded::All,
                    ..Look::default()
                },
            }
        }

        fn draw(&self, view: &View, size: [usize; 2], step_mm: f64) -> Image {
            let frame = Frame {
                grid: self.grid,
                values: &self.values,
                parts: None,
                transfer: &self.transfer,
                reference_mm: 1.0,
                ambient: &self.ambient,
                clips: &self.clips,
                step_mm,
                look: self.look,
            };
            raycast(&frame, view, size)
        }
    }

    /// An eye on the z axis that looks down it.
    fn from_above(height: f32) -> View {
        View {
            position: Vec3::new(0.0, 0.0, height),
            orientation: Quat::IDENTITY,
            tan: Tangents { left: -0.3, right: 0.4, up: 0.35, down: -0.25 },
            near_mm: 1.0,
            far_mm: 200.0,
            reversed: false,
        }
    }

    const SIZE: [usize; 2] = [28, 24];

    /// Pixel index → (x, y) of the view axis components.
    fn slopes(view: &View, i: usize) -> [f32; 2] {
        let uv = [(i % SIZE[0]) as f32 + 0.5, (i / SIZE[0]) as f32 + 0.5];
        let t = view.tan;
        [
            t.left + (t.right - t.left) * uv[0] / SIZE[0] as f32,
            t.up + (t.down - t.up) * uv[1] / SIZE[1] as f32,
        ]
    }

    #[test]
    fn empty_volume_is_transparent() {
        let image = Scene::even(0.0).draw(&from_above(40.0), SIZE, 0.5);
        assert!(image.colour.iter().all(|&c| c == [0.0; 4]) && image.depth.iter().all(|&d| d == 1.0));
    }

    /// Through the upper and lower face of the box, 16 mm apart, a ray of slope s covers 1 − (1 − a)^(16·√(1+s²)/ℓ).
    #[test]
    fn uniform_slab_has_the_closed_form_alpha() {
        let view = from_above(100.0);
        let step = 0.01;
        for opacity in [0.01, 0.1, 0.2] {
            let image = Scene::even(opacity).draw(&view, SIZE, step);
            let mut compared = 0;
            for (i, &[.., alpha]) in image.colour.iter().enumerate() {
                let [x, y] = slopes(&view, i);
                let slant = f64::from(1.0 + x * x + y * y).sqrt();
                // At the lower face, 108 mm below the eye, the box ends at 5 and 6 mm.
                if x.abs() * 108.0 < 5.0 && y.abs() * 108.0 < 6.0 {
                    let exact = 1.0 - (1.0 - f64::from(opacity)).powf(16.0 * slant);
                    // Half a step more or less.
                    let bound = 0.5 * step * -(1.0 - f64::from(opacity)).ln() + 1e-6;
                    assert!((f64::from(alpha) - exact).abs() < bound, "{alpha} {exact}");
                    compared += 1;
                }
            }
            assert!(compared > 10);
        }
    }

    #[test]
    fn opaque_box_covers_its_pixels_at_its_depth() {
        let view = from_above(30.0);
        let image = Scene::even(1.0).draw(&view, SIZE, 0.1);
        let mut covered = 0;
        for (i, (&[.., alpha], &depth)) in image.colour.iter().zip(&image.depth).enumerate() {
            let [x, y] = slopes(&view, i);
            // The upper face, 22 mm below the eye, hides the rest of the box.
            let expected = x.abs() * 22.0 < 5.0 && y.abs() * 22.0 < 6.0;
            assert_eq!(alpha == 1.0, expected, "{x} {y}");
            assert_eq!(alpha == 0.0, !expected, "{x} {y}");
            if expected {
                let on_face = view.project(Vec3::new(x * 22.0, y * 22.0, 8.0)).unwrap().1;
                let slope = 200.0 / 199.0 / (22.0 * 22.0);
                assert!(depth >= on_face - 1e-5 && depth < on_face + 0.1 * slope, "{depth} {on_face}");
                covered += 1;
            } else {
                assert_eq!(depth, 1.0);
            }
        }
        assert!(covered > 50 && covered < image.depth.len() - 50, "{covered}");
    }

    /// On the upper face the normal is along z and the ambient factor ½, shown at full light: colour · 2·½ · (¼ + ½ · 0.8).
    #[test]
    fn colour_is_shaded_by_ambient_factor_and_gradient() {
        let view = from_above(30.0);
        let mut scene = Scene::even(1.0);
        let middle = SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2;
        let check = |scene: &Scene, shade: f32| {
            let found = scene.draw(&view, SIZE, 0.1).colour[middle];
            for (found, expected) in found.iter().zip([0.2 * shade, 0.4 * shade, 0.8 * shade, 1.0]) {
                assert!((found - expected).abs() < 1e-6, "{found} {expected}");
            }
        };
        check(&scene, 0.25 + 0.5 * 0.8);
        // Half as much is half as light, all of it or what comes from everywhere; more is not lighter.
        scene.ambient.fill(0.25);
        check(&scene, 0.5 * (0.25 + 0.5 * 0.8));
        scene.look.occluded = Occluded::Ambient;
        check(&scene, 0.5 * 0.25 + 0.5 * 0.8);
        scene.ambient.fill(0.9);
        check(&scene, 0.25 + 0.5 * 0.8);
        scene.ambient.fill(0.25);
        scene.look.shading = Shading::Phong;
        check(&scene, 0.25 + 0.5 * 0.8);
        scene.look.shading = Shading::Ao;
        check(&scene, 0.5);
        scene.look.shading = Shading::None;
        check(&scene, 1.0);
        // From below nothing comes but to surfaces that are lit from both sides.
        scene.look = Look { shading: Shading::Phong, light: -scene.look.light, ..scene.look };
        check(&scene, 0.25);
        scene.look.two_sided = true;
        check(&scene, 0.25 + 0.5 * 0.8);
    }

    /// Behind the faces, opacity that varies nowhere has no surface: the light of no direction.
    #[test]
    fn where_there_is_no_surface_light_has_no_direction() {
        let mut scene = Scene::even(0.2);
        scene.look.shading = Shading::Phong;
        // The eye and its near plane in the middle of the box.
        let view = View { near_mm: 2.0, ..from_above(0.0) };
        let image = scene.draw(&view, SIZE, 0.1);
        for colour in &image.colour {
            let expected = colour[3] * 0.8 * (0.25 + 0.5 * 0.5);
            assert!((colour[2] - expected).abs() < 1e-5, "{colour:?}");
        }
    }

    #[test]
    fn clipped_samples_show_nothing() {
        let view = from_above(100.0);
        let mut scene = Scene::even(0.1);
        // Nearest to the axis: the ray leaves through the lower face.
        let axis = 14 * SIZE[0] + 12;
        let full = scene.draw(&view, SIZE, 0.05).colour[axis][3];
        let mut clip = |mode| {
            let clip = Clip { shape: Shape::Plane, mode, pose: Pose::default() };
            scene.clips = vec![field(&clip, &scene.grid, 1.0)];
            scene.draw(&view, SIZE, 0.05).colour[axis][3]
        };
        // The plane z = 0 halves the way: the two transmittances multiply to the whole.
        let (lower, upper) = (clip(Mode::Remove), clip(Mode::Keep));
        assert!((lower - upper).abs() < 1e-2 && lower < full - 0.1);
        assert!(((1.0 - lower) * (1.0 - upper) - (1.0 - full)).abs() < 1e-5);
    }

    #[test]
    fn an_eye_inside_sees_from_its_near_plane_on() {
        let scene = Scene::even(1.0);
        let image = scene.draw(&from_above(0.5), SIZE, 0.25);
        assert!(image.colour.iter().all(|c| c[3] == 1.0));
        assert!(image.depth.iter().all(|&d| d < 1e-6));
        // A near plane behind the volume leaves nothing; so does a far plane before it.
        for (near_mm, far_mm) in [(20.0, 30.0), (0.1, 1.0)] {
            let view = View { near_mm, far_mm, ..from_above(10.0) };
            assert!(scene.draw(&view, SIZE, 0.25).colour.iter().all(|c| c[3] == 0.0));
        }
    }

    #[test]
    fn equal_eyes_see_equal_images() {
        let scene = Scene::even(0.15);
        let rig = StereoRig::framing(std::array::from_fn(|i| 2.0 * [5.0, 6.0, 8.0][i]), 30.0, 20.0);
        let draw =
            |rig: StereoRig| rig.views(1.2, 1.0, 300.0).unwrap().map(|v| scene.draw(&v, [12, 10], 0.5));
        let [left, right] = draw(StereoRig { ipd_mm: 0.0, ..rig });
        assert_eq!(left, right);
        let [left, right] = draw(rig);
        assert_ne!(left, right);
    }

    #[test]
    fn no_pose_makes_a_nan() {
        let mut random = Random(61);
        let grid = Grid { dims: [6, 1, 9], spacing: [1.0, 3.0, 0.7] };
        for _ in 0..60 {
            let mut scene = Scene::even(0.5);
            scene.grid = grid;
            scene.ambient = random.opacities(grid.len());
            scene.values = random.opacities(grid.len());
            scene.transfer.opacity = vec![[0.0, 0.0], [1.0, 1.0]];
            let all = shapes();
            let shape = &all[(random.unit() * all.len() as f32) as usize];
            scene.clips = vec![field(&random_clip(shape, &grid, &mut random), &grid, 1.0)];
            let mut view = from_above(0.0);
            // Half of them on a grid plane, looking along an axis: rays that only touch.
            if random.unit() < 0.5 {
                view.position = random.vector(-3.0, 3.0).round() + Vec3::splat(0.5);
                view.tan = Tangents { left: -0.5, right: 0.5, up: 0.5, down: -0.5 };
            } else {
                view.position = random.vector(-8.0, 8.0);
                view.orientation = Quat::from_rotation_y(random.within(0.0, 6.0))
                    * Quat::from_rotation_x(random.within(0.0, 6.0));
            }
            view.near_mm = random.within(0.01, 2.0);
            let image = scene.draw(&view, [7, 7], 0.4);
            for (colour, depth) in image.colour.iter().zip(&image.depth) {
                assert!(colour.iter().all(|c| (0.0..=1.0).contains(c)) && (0.0..=1.0).contains(depth));
            }
        }
    }
}
