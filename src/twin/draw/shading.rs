//! The light that a visible place of a ray sends towards the eye.
//!
//! ```text
//! L = A k_a c + A' (k_d c d + k_s s)      d = max(n·l, 0), s = d max(n·h, 0)^shininess where a surface is, ½ and 0 where none is
//! ```
//!
//! A is the ambient factor times the gain, at most 1; A' the same, or 1. In coloured light both are red's for red, and so on. n is the direction of the gradient of the values, just behind a
//! cut the normal of what cut. How much of a surface there is, and which side is out, is what opacity does a voxel along n and back.

use crate::draw::clip_normal::clip_normal;
use crate::draw::raycast::Frame;
use crate::trilinear_clamped;
use cao_kernels::raycast as kernel;
use cao_model::look::Occluded;
use glam::DVec3;

/// A visible place of a ray.
pub struct Shown {
    /// Index coordinates.
    pub position: [f64; 3],
    /// Millimetres.
    pub world: DVec3,
    /// V there.
    pub value: f32,
    /// Unlit, linear.
    pub colour: DVec3,
    /// The clip out of which the ray came last.
    pub cut: Option<usize>,
    /// Millimetres of way since then.
    pub beside: f64,
}

/// Linear red, green and blue that it sends back along a ray of this direction to an eye of a head for which light comes from `light`;
/// its ambient factor from `ambient` of index coordinates ([`crate::draw::air`]).
pub fn shaded(
    frame: &Frame,
    at: &Shown,
    direction: DVec3,
    light: DVec3,
    ambient: &mut dyn FnMut([f64; 3]) -> f64,
) -> DVec3 {
    let look = &frame.look;
    let [k_a, k_d, k_s] = look.parts().map(f64::from);
    let open =
        if look.shading.occluded() { (f64::from(look.gain) * ambient(at.position)).min(1.0) } else { 1.0 };
    let open_rest = if look.occluded == Occluded::All { open } else { 1.0 };
    let colour = at.colour;
    let [diffuse, specular] = reflected_at(frame, at, direction.normalize(), light);
    open * k_a * colour + open_rest * (k_d * diffuse * colour + DVec3::splat(k_s * specular))
}

/// The first, and a share of the second instead.
fn mix(a: [f64; 2], b: [f64; 2], share: f64) -> [f64; 2] {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

/// Inside, or just behind what cut.
fn reflected_at(frame: &Frame, at: &Shown, direction: DVec3, light: DVec3) -> [f64; 2] {
    let (entered, face) = entry(frame, at, direction);
    let by_clip = at.cut.filter(|_| at.beside <= entered);
    let voxel = frame.grid.min_spacing();
    let beside = by_clip.map_or(entered, |_| at.beside) / voxel;
    let cut = 1.0 - smoothstep(f64::from(kernel::CUT_HOLDS), f64::from(kernel::CUT_ENDS), beside);
    let inside = reflected_inside(frame, at, -direction, light);
    if cut == 0.0 {
        return inside;
    }
    let normal = by_clip.map_or(face, |clip| {
        clip_normal(&frame.clips[clip].clip, at.world - at.beside * direction, -direction)
    });
    let back = f64::from(u8::from(frame.look.two_sided));
    mix(inside, reflected(frame, normal, [1.0, back], -direction, light), cut)
}

/// Way in mm since a ray came into the volume, were it as large on, and the outer normal of the face.
fn entry(frame: &Frame, at: &Shown, direction: DVec3) -> (f64, DVec3) {
    let mut found = (f64::INFINITY, DVec3::ZERO);
    for axis in 0..3 {
        let half = frame.grid.dims[axis] as f64 * frame.grid.spacing[axis] / 2.0;
        let way = (at.world[axis] + half * direction[axis].signum()) / direction[axis];
        if direction[axis] != 0.0 && way < found.0 {
            let mut normal = DVec3::ZERO;
            normal[axis] = -direction[axis].signum();
            found = (way, normal);
        }
    }
    found
}

/// By the gradient of the values, and by the opacity a voxel before and behind the place along it.
fn reflected_inside(frame: &Frame, at: &Shown, towards_eye: DVec3, light: DVec3) -> [f64; 2] {
    let none = [f64::from(kernel::NO_DIRECTION), 0.0];
    let Some(normal) = gradient(frame, at.position).try_normalize() else { return none };
    let voxel = frame.grid.min_spacing();
    let value = |voxels: f64| {
        let place = frame.grid.to_index((at.world + voxels * voxel * normal).to_array());
        trilinear_clamped(&frame.grid, frame.values, place) as f32
    };
    let (low, high) = (value(-1.0), value(1.0));
    let here = f64::from(frame.transfer.opacity_at(at.value));
    let [before, behind] = [low, high].map(|value| f64::from(frame.transfer.opacity_at(value)));
    let change = (before - here).abs() + (behind - here).abs();
    if change == 0.0 {
        return none;
    }
    let largest = here.max(before).max(behind);
    let way = f64::from((low - at.value).abs() + (high - at.value).abs());
    let straight =
        smoothstep(0.0, f64::from(kernel::STRAIGHT), f64::from((high - low).abs()) / way.max(1e-30));
    let share =
        straight * smoothstep(f64::from(kernel::NO_SURFACE), f64::from(kernel::SURFACE), change / largest);
    let out = (before - behind) / change;
    let least = f64::from(u8::from(frame.look.two_sided));
    let sides = [(1.0 + out.min(0.0)).max(least), (1.0 - out.max(0.0)).max(least)];
    mix(none, reflected(frame, normal, sides, towards_eye, light), share)
}

/// The diffuse and the specular part of what comes back from a surface, by the share of it that is turned to the front and to the back of its normal.
fn reflected(frame: &Frame, normal: DVec3, sides: [f64; 2], towards_eye: DVec3, light: DVec3) -> [f64; 2] {
    let slope = normal.dot(light);
    let arriving = if slope > 0.0 { sides[0] * slope } else { sides[1] * -slope };
    let mirrored = normal.dot((light + towards_eye).normalize_or_zero());
    let same_side = slope * mirrored > 0.0;
    let shininess = f64::from(frame.look.shininess);
    [arriving, if same_side { arriving * mirrored.abs().powf(shininess) } else { 0.0 }]
}

/// Rise of the values a mm: differences over two voxels, of means of 3 × 3 places one voxel apart.
fn gradient(frame: &Frame, position: [f64; 3]) -> DVec3 {
    let middle = f64::from(kernel::MIDDLE);
    let mut rise = DVec3::ZERO;
    for place in 0..27_u8 {
        let step = [place % 3, place / 3 % 3, place / 9].map(|s| f64::from(s) - 1.0);
        let at = std::array::from_fn(|i| position[i] + step[i]);
        let value = trilinear_clamped(&frame.grid, frame.values, at);
        let weight = step.map(|s| if s == 0.0 { middle } else { 1.0 });
        for axis in 0..3 {
            let others: f64 = (0..3).filter(|other| *other != axis).map(|other| weight[other]).product();
            rise[axis] += step[axis] * others * value / frame.grid.spacing[axis];
        }
    }
    rise
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
