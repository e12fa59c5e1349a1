//! The light that a visible place of a ray sends towards the eye.

use crate::draw::raycast::Frame;
use crate::trilinear;
use cao_kernels::raycast as kernel;
use glam::DVec3;

/// The ambient factor is shown times this: a flat wall's is ½.
pub const GAIN: f64 = 2.0;
/// Below this gradient of opacity per smallest spacing there is no surface, and the diffuse term is 1.
pub const FLAT: f64 = 1e-4;
const _: () = assert!(FLAT as f32 == kernel::FLAT);

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

/// Linear red, green and blue that it sends back along a ray of this direction; its ambient factor from `ambient` of index coordinates.
pub fn shaded(
    frame: &Frame,
    at: &Shown,
    _direction: DVec3,
    ambient: &mut dyn FnMut([f64; 3]) -> f64,
) -> DVec3 {
    let shade = if frame.look.occluded { GAIN * ambient(at.position) } else { 1.0 };
    let light = f64::from(frame.look.ambient) + f64::from(frame.look.diffuse) * surface(frame, at.position);
    shade * light * at.colour
}

/// |n·l|, or 1 where there is no surface.
fn surface(frame: &Frame, position: [f64; 3]) -> f64 {
    let gradient = DVec3::from_array(std::array::from_fn(|axis| {
        let beside = |shift: f64| {
            let mut at = position;
            at[axis] += shift;
            trilinear(&frame.grid, frame.opacity, at)
        };
        (beside(1.0) - beside(-1.0)) / (2.0 * frame.grid.spacing[axis])
    }));
    if gradient.length() * frame.grid.min_spacing() < FLAT {
        return 1.0;
    }
    gradient.normalize().dot(frame.look.light.as_dvec3()).abs()
}
