//! What one view shows: a unit normal and a view depth a pixel, as of a surface in the middle of each; and the patterns that methods sample by.

use cao_model::view::View;
use glam::{DQuat, DVec2, DVec3, Vec3};

/// Normals and depths of a view.
pub struct Shown {
    /// Pixels across and down.
    pub size: [usize; 2],
    view: View,
    /// Rows from the top: the normal of the side that is seen, depth in mm; `None` where nothing is.
    pixels: Vec<Option<(DVec3, f64)>>,
}

impl Shown {
    /// From the pixels that kernels read: normal and depth, depth 0 where nothing is.
    pub fn new(view: &View, size: [usize; 2], pixels: &[[f32; 4]]) -> Self {
        let pixel = |[x, y, z, depth]: [f32; 4]| {
            (depth > 0.0).then(|| (DVec3::from(Vec3::new(x, y, z)), f64::from(depth)))
        };
        Self { size, view: *view, pixels: pixels.iter().map(|p| pixel(*p)).collect() }
    }

    /// From normals and depths in mm, `None` where nothing is.
    pub fn from_pixels(view: &View, size: [usize; 2], pixels: Vec<Option<(DVec3, f64)>>) -> Self {
        Self { size, view: *view, pixels }
    }

    /// Of a scene that says how far a ray goes, in lengths of its direction, and the normal there. The ray's length is the depth.
    pub fn of(view: &View, size: [usize; 2], hit: impl Fn(DVec3, DVec3) -> Option<(f64, DVec3)>) -> Self {
        let mut shown = Self { size, view: *view, pixels: Vec::new() };
        let rays = (0..size[0] * size[1]).map(|i| shown.direction(i));
        let pixels = rays.map(|direction| {
            hit(shown.origin(), direction).map(|(t, n)| (if n.dot(direction) > 0.0 { -n } else { n }, t))
        });
        shown.pixels = pixels.collect();
        shown
    }

    /// The pixels as kernels read them.
    pub fn pixels(&self) -> Vec<[f32; 4]> {
        let pixel = |(n, depth): (DVec3, f64)| n.as_vec3().extend(depth as f32).to_array();
        self.pixels.iter().map(|p| p.map_or([0.0; 4], pixel)).collect()
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Column and row of a pixel.
    pub fn column_row(&self, i: usize) -> [usize; 2] {
        [i % self.size[0], i / self.size[0]]
    }

    /// The pixel at a column and row that may lie outside.
    pub fn pixel(&self, x: i64, y: i64) -> Option<usize> {
        let [width, height] = self.size.map(|s| s as i64);
        ((0..width).contains(&x) && (0..height).contains(&y)).then(|| (y * width + x) as usize)
    }

    /// Depth of a pixel in mm.
    pub fn depth(&self, i: usize) -> Option<f64> {
        self.pixels[i].map(|(_, depth)| depth)
    }

    /// Normal and position in mm of what a pixel shows.
    pub fn surface(&self, i: usize) -> Option<(DVec3, DVec3)> {
        self.pixels[i].map(|(normal, depth)| (normal, self.origin() + depth * self.direction(i)))
    }

    /// Depth of a position, and the pixel that it falls on, if it is in front of the eye and inside the image.
    pub fn place(&self, position: DVec3) -> Option<(f64, usize)> {
        let local = self.orientation().inverse() * (position - self.origin());
        let depth = -local.z;
        if depth <= 0.0 {
            return None;
        }
        let t = self.view.tan;
        let along = |at: f64, from: f32, to: f32| (at / depth - f64::from(from)) / f64::from(to - from);
        let uv = DVec2::new(along(local.x, t.left, t.right), along(local.y, t.up, t.down));
        let place = (uv * DVec2::new(self.size[0] as f64, self.size[1] as f64)).floor();
        self.pixel(place.x as i64, place.y as i64).map(|pixel| (depth, pixel))
    }

    /// Unit vectors of the image: to the right, down, and back to the eye.
    pub fn axes(&self) -> [DVec3; 3] {
        [DVec3::X, DVec3::NEG_Y, DVec3::Z].map(|axis| self.orientation() * axis)
    }

    fn origin(&self) -> DVec3 {
        self.view.position.as_dvec3()
    }

    fn orientation(&self) -> DQuat {
        self.view.orientation.as_dquat().normalize()
    }

    /// Through the middle of a pixel, mm of way a mm of depth.
    fn direction(&self, i: usize) -> DVec3 {
        let [x, y] = self.column_row(i);
        let t = self.view.tan;
        let along = |from: f32, to: f32, at: usize, of: usize| {
            f64::from(from) + f64::from(to - from) * (at as f64 + 0.5) / of as f64
        };
        let local =
            DVec3::new(along(t.left, t.right, x, self.size[0]), along(t.up, t.down, y, self.size[1]), -1.0);
        self.orientation() * local
    }
}

/// Multiples of 2³² / the golden ratio are spread evenly over the whole numbers.
pub(crate) const GOLDEN: u32 = 0x9e37_79b9;

/// The angle of a share of a turn, in 2³²ths, in −π … π.
pub(crate) fn angle_of(turn: u32) -> f64 {
    (f64::from(turn >> 8) / f64::from(1 << 24) - 0.5) * std::f64::consts::TAU
}

/// A whole number for each pixel, without a pattern (PCG's output permutation).
pub(crate) fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}
