//! Dilation maps: the region of voxels whose neighbourhood a mesh clip may change (CAO §3.4 step 3).
//!
//! ```text
//! literal       D_front(x) = min_{|x−i| ≤ r_xy} Z_front(i) − r_z √(1 − (|x−i|/r_xy)²)         CAO eq. (4), (c), (d)
//! conservative  D_front(x) = min_{d(x,c) ≤ r}  Z_front(c) − √(r² − d²),
//!               d(x, c) = cell · |(max(|dx|−1, 0), max(|dy|−1, 0))|                          method.md §5
//! ```
//!
//! and D_back with max and +. Cells are the pixels of the dilation map; one holds the nearest front and the farthest
//! back of all layers of all mesh pixels in it, and d is the distance between the nearest points of two cells, so
//! that no point of a column within r of a point of another is missed. A clip that keeps its inside changes what lies
//! *outside*: there the map is contracted (max front + h, min back − h), and an empty pixel empties every cell in reach.

use crate::clip::clips::{MeshLayers, NO_BACK, NO_FRONT, pixel};
use crate::{Grid, each};
use cao_model::clip::{ClipCamera, Mode};
use cao_model::settings::Support;
use cao_model::{Error, Result};
use glam::Vec3;

/// One interval of depths for each cell: the dilated mesh of a clip that removes, the contracted mesh of one that
/// keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct DilationMap {
    /// The layers' camera at the map's own resolution.
    pub camera: ClipCamera,
    /// Mode of the clip.
    pub mode: Mode,
    /// D_front, row-major, depth in units of the camera; above `back` where the interval is empty.
    pub front: Vec<f32>,
    /// D_back.
    pub back: Vec<f32>,
}

impl DilationMap {
    /// Whether a point of the mesh's rigid frame (mm) may be within the radius of the region that the clip hides.
    pub fn dilated(&self, rigid: Vec3) -> bool {
        holds(&self.camera, self.mode, rigid, |cell| [self.front[cell], self.back[cell]])
    }
}

/// Radius in mm around a hidden region within which a voxel's ambient value may change (method.md §5): the reach of
/// its rays, the voxel diagonal over which a sample interpolates, the way from a voxel's centre to its farthest
/// clip samples, and a hundredth for rounding, of which the 1/512 voxel of a GPU's texture coordinates is the most.
pub fn changed_radius(grid: &Grid, reach_mm: f32, support: Support) -> f32 {
    (f64::from(reach_mm) + (1.0 + f64::from(support.corner()) + 1e-2) * grid.diagonal()) as f32
}

/// A dilation map of which each cell is computed when it is asked for: of the largest maps the few cells that matter take seconds,
/// the whole minutes.
#[derive(Clone, Debug)]
pub struct Cells {
    camera: ClipCamera,
    mode: Mode,
    /// D_front is the least of front − h for a clip that removes, and the most of front + h, the least of −front − h with its
    /// sign turned, for one that keeps; D_back the other way round.
    front: Envelope,
    back: Envelope,
    /// For each |dy| the half-heights of the ball over dx = −n … n, as far as it reaches.
    heights: Vec<Vec<f64>>,
    half: bool,
    /// Depths are interpolated between the four cells around a point, instead of those of the cell that it falls into.
    bilinear: bool,
}

impl Cells {
    /// The conservative map with `resolution` cells along an edge.
    ///
    /// # Errors
    /// [`Error::Config`] when `resolution` is below 4.
    pub fn conservative(layers: &MeshLayers, mode: Mode, radius_mm: f32, resolution: u32) -> Result<Self> {
        if resolution < 4 {
            return Err(Error::Config {
                what: "dilation map resolution".into(),
                problem: format!("{resolution}; expected at least 4"),
            });
        }
        let camera = layers.camera.widened(radius_mm, resolution);
        let (side, fine) = (resolution as usize, layers.camera.resolution as usize);
        // Pixels that a row or column of cells touches, with a thousandth of a pixel for rounding; `None` where some lie
        // beyond the layers.
        let (cell, pixel) = (f64::from(camera.pixel_mm), f64::from(layers.camera.pixel_mm));
        let touched = |shift: f32, index: usize| {
            let from = (f64::from(shift) + index as f64 * cell) / pixel - 1e-3;
            let to = (f64::from(shift) + (index + 1) as f64 * cell) / pixel + 1e-3;
            let range = from.floor().max(0.0) as usize..((to.floor() + 1.0).max(0.0) as usize).min(fine);
            (range, from < 0.0 || to >= fine as f64)
        };
        let shift = camera.corner - layers.camera.corner;
        let cells = (0..side * side).map(|cell| {
            let (columns, past_x) = touched(shift.x, cell % side);
            let (rows, past_y) = touched(shift.y, cell / side);
            if mode == Mode::Keep && (past_x || past_y) {
                return EMPTY;
            }
            let pixels = rows.flat_map(|y| columns.clone().map(move |x| y * fine + x));
            merge(mode, pixels.map(|pixel| interval(layers, mode, pixel)))
        });
        let (radius, cell_mm) = (f64::from(radius_mm), f64::from(camera.pixel_mm));
        let height = |dx: usize, dy: usize| {
            let gap = |d: usize| d.saturating_sub(1) as f64 * cell_mm;
            let square = radius * radius - gap(dx).powi(2) - gap(dy).powi(2);
            (square >= 0.0).then(|| square.sqrt() / f64::from(camera.depth_mm))
        };
        Ok(Self::new(camera, mode, cells, (radius / cell_mm) as usize + 1, height, false))
    }

    /// The paper's map: at the layers' resolution, from pixel centre to pixel centre, radius in pixels; depths rounded to
    /// half floats if `half`. Empty pixels are skipped, which is more careful than dilating their stored depth.
    pub fn literal(layers: &MeshLayers, mode: Mode, radius_mm: f32, half: bool) -> Self {
        let camera = layers.camera;
        let stored = |depth: f64| if half { round_to_half(depth) } else { depth };
        let side = camera.resolution as usize;
        let pixels = (0..side * side).map(|pixel| interval(layers, mode, pixel).map(stored));
        let r_xy = f64::from(radius_mm / camera.pixel_mm);
        let r_z = f64::from(radius_mm / camera.depth_mm);
        let height = |dx: usize, dy: usize| {
            let square = 1.0 - (dx * dx + dy * dy) as f64 / (r_xy * r_xy);
            (square >= 0.0).then(|| r_z * square.sqrt())
        };
        Self::new(camera, mode, pixels, r_xy as usize, height, half)
    }

    /// The map of the paper's authors' program, as far as its public code says: as [`Self::literal`], but the radius in pixels is rounded
    /// up, the dilated depths are half floats, and they are read bilinearly. Its radius in mm is `radius_mm`, to which the program gives the length
    /// of a ray and a voxel's diagonal.
    pub fn programmed(layers: &MeshLayers, mode: Mode, radius_mm: f32) -> Self {
        let camera = layers.camera;
        let side = camera.resolution as usize;
        let pixels = (0..side * side).map(|pixel| interval(layers, mode, pixel));
        let r_xy = f64::from(radius_mm / camera.pixel_mm).ceil();
        let r_z = f64::from(radius_mm / camera.depth_mm);
        let height = |dx: usize, dy: usize| {
            let square = 1.0 - (dx * dx + dy * dy) as f64 / (r_xy * r_xy);
            (square >= 0.0).then(|| r_z * square.sqrt())
        };
        Self { bilinear: true, ..Self::new(camera, mode, pixels, r_xy as usize, height, true) }
    }

    /// Intervals of cells, to be grown (remove) or shrunk (keep) by those of all cells within `span`, where
    /// `height(|dx|, |dy|)` is the half-height of the ball at that distance.
    fn new(
        camera: ClipCamera,
        mode: Mode,
        cells: impl Iterator<Item = [f64; 2]>,
        span: usize,
        height: impl Fn(usize, usize) -> Option<f64>,
        half: bool,
    ) -> Self {
        let side = camera.resolution as usize;
        let sign = sign(mode);
        // Where a clip that removes has nothing, nothing is reached.
        let skipped = |cell| if mode == Mode::Remove && cell == EMPTY { NOWHERE } else { cell };
        let (front, back) = cells.map(skipped).map(|[front, back]| (sign * front, -sign * back)).unzip();
        let (front, back) = (Envelope::new(side, front), Envelope::new(side, back));
        let row = |dy: usize| {
            let right: Vec<f64> = (0..=span).map_while(|dx| height(dx, dy)).collect();
            right.iter().skip(1).rev().chain(&right).copied().collect()
        };
        Self { camera, mode, front, back, heights: (0..=span).map(row).collect(), half, bilinear: false }
    }

    /// D_front and D_back of one cell. Beyond the map everything is empty.
    fn cell(&self, cell: usize) -> [f32; 2] {
        let side = self.camera.resolution as usize;
        let (x, y) = (cell % side, cell / side);
        let span = self.heights.len() - 1;
        let past_edge = |c: usize| c < span || c + span >= side;
        if self.mode == Mode::Keep && (past_edge(x) || past_edge(y)) {
            return EMPTY.map(|depth| self.stored(depth));
        }
        let sign = sign(self.mode);
        let front = sign * self.front.least(x, y, &self.heights);
        let back = -sign * self.back.least(x, y, &self.heights);
        let found = if [front, back] == NOWHERE { EMPTY } else { [front, back] };
        found.map(|depth| self.stored(depth))
    }

    fn stored(&self, depth: f64) -> f32 {
        // Through f32, which a depth map holds before it is stored in 16 bits.
        let depth = depth as f32;
        if self.half { round_to_half(f64::from(depth)) as f32 } else { depth }
    }

    /// Whether a point of the mesh's rigid frame (mm) may be within the radius of the region that the clip hides.
    pub fn dilated(&self, rigid: Vec3) -> bool {
        match self.bilinear {
            true => self.between_cells(rigid) == (self.mode == Mode::Remove),
            false => holds(&self.camera, self.mode, rigid, |cell| self.cell(cell)),
        }
    }

    /// Whether a point lies in the interval that a linear sampler reads there; nothing does outside the map. A cell without anything holds
    /// the depths that a map is cleared to, 1 and 0.
    fn between_cells(&self, rigid: Vec3) -> bool {
        let p = self.camera.map(rigid);
        if pixel(&self.camera, p).is_none() {
            return false;
        }
        let side = self.camera.resolution as usize;
        let [x, y] = [p.x, p.y].map(|c| f64::from(c) - 0.5);
        let mut sum = [0.0; 2];
        for n in 0..4 {
            let at = |c: f64, step: usize| {
                let low = c.floor();
                let weight = if step == 0 { 1.0 - (c - low) } else { c - low };
                ((low + step as f64).clamp(0.0, (side - 1) as f64) as usize, weight)
            };
            let ((i, u), (j, v)) = (at(x, n % 2), at(y, n / 2));
            let depths = self.cell(j * side + i).map(f64::from);
            let depths = if depths == EMPTY { [1.0, 0.0] } else { depths };
            sum = [0, 1].map(|side| sum[side] + u * v * depths[side]);
        }
        sum[0] < f64::from(p.z) && f64::from(p.z) < sum[1]
    }

    /// All cells.
    pub fn whole(&self) -> DilationMap {
        let side = self.camera.resolution as usize;
        let intervals = each(side * side, |cell| self.cell(cell));
        DilationMap {
            camera: self.camera,
            mode: self.mode,
            front: intervals.iter().map(|i| i[0]).collect(),
            back: intervals.iter().map(|i| i[1]).collect(),
        }
    }
}

/// A removing clip's interval grows, a keeping one's shrinks.
fn sign(mode: Mode) -> f64 {
    if mode == Mode::Remove { 1.0 } else { -1.0 }
}

/// A square of values, and the least of each block of them, which tells the blocks that need not be looked at.
#[derive(Clone, Debug)]
struct Envelope {
    side: usize,
    values: Vec<f64>,
    least: Vec<f64>,
}

/// Cells along an edge of an [`Envelope`]'s blocks.
const BLOCK: usize = 16;

impl Envelope {
    fn new(side: usize, values: Vec<f64>) -> Self {
        let blocks = side.div_ceil(BLOCK);
        let mut least = vec![f64::INFINITY; blocks * blocks];
        for (cell, &value) in values.iter().enumerate() {
            let slot = &mut least[cell / side / BLOCK * blocks + cell % side / BLOCK];
            *slot = slot.min(value);
        }
        Self { side, values, least }
    }

    /// The least of value − height over the cells around (x, y); `heights[|dy|]` is for dx = −n … n and nowhere grows with |dx| or |dy|.
    fn least(&self, x: usize, y: usize, heights: &[Vec<f64>]) -> f64 {
        let span = heights.len() - 1;
        let blocks = self.side.div_ceil(BLOCK);
        let reached = |c: usize| c.saturating_sub(span) / BLOCK..=((c + span) / BLOCK).min(blocks - 1);
        let gap = |c: usize, block: usize| {
            let first = block * BLOCK;
            first.saturating_sub(c).max(c.saturating_sub(first + BLOCK - 1))
        };
        // Its own block first, so that few others can hold less.
        let mut least = self.least_in(x / BLOCK, y / BLOCK, x, y, heights, f64::INFINITY);
        for v in reached(y) {
            let row = &heights[gap(y, v)];
            for u in reached(x) {
                // The block's highest ball is the one nearest to (x, y).
                let highest = row.get(row.len() / 2 + gap(x, u));
                if highest.is_some_and(|h| self.least[v * blocks + u] - h < least) {
                    least = self.least_in(u, v, x, y, heights, least);
                }
            }
        }
        least
    }

    fn least_in(&self, u: usize, v: usize, x: usize, y: usize, heights: &[Vec<f64>], mut least: f64) -> f64 {
        for j in v * BLOCK..((v + 1) * BLOCK).min(self.side) {
            let Some(row) = heights.get(j.abs_diff(y)) else { continue };
            let reach = row.len() / 2;
            for i in u * BLOCK..((u + 1) * BLOCK).min(self.side) {
                if i.abs_diff(x) <= reach && !row.is_empty() {
                    least = least.min(self.values[j * self.side + i] - row[i + reach - x]);
                }
            }
        }
        least
    }
}

/// Whether the interval of the cell that a point falls into contains it, for a clip that removes; or does not, for one that keeps.
fn holds(camera: &ClipCamera, mode: Mode, rigid: Vec3, interval: impl Fn(usize) -> [f32; 2]) -> bool {
    let p = camera.map(rigid);
    let between = pixel(camera, p).is_some_and(|cell| {
        let [front, back] = interval(cell);
        front < p.z && p.z < back
    });
    between == (mode == Mode::Remove)
}

/// All cells of [`Cells::conservative`].
///
/// # Errors
/// [`Error::Config`] when `resolution` is below 4.
pub fn conservative(layers: &MeshLayers, mode: Mode, radius_mm: f32, resolution: u32) -> Result<DilationMap> {
    Ok(Cells::conservative(layers, mode, radius_mm, resolution)?.whole())
}

/// All cells of [`Cells::literal`].
pub fn literal(layers: &MeshLayers, mode: Mode, radius_mm: f32, half: bool) -> DilationMap {
    Cells::literal(layers, mode, radius_mm, half).whole()
}

const EMPTY: [f64; 2] = [NO_FRONT as f64, NO_BACK as f64];
/// An interval that no ball grows into one that holds anything.
const NOWHERE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// The one interval that stands for all pairs of a pixel: their hull for a clip that removes, their common part for
/// one that keeps, which a gap between pairs leaves empty.
fn interval(layers: &MeshLayers, mode: Mode, pixel: usize) -> [f64; 2] {
    let pairs = layers.front.iter().zip(&layers.back).map(|(f, b)| [f[pixel], b[pixel]].map(f64::from));
    let mut found = pairs.filter(|pair| *pair != EMPTY).peekable();
    if found.peek().is_none() { EMPTY } else { merge(mode, found) }
}

fn merge(mode: Mode, intervals: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    intervals
        .reduce(|a, b| match mode {
            Mode::Remove => [a[0].min(b[0]), a[1].max(b[1])],
            Mode::Keep => [a[0].max(b[0]), a[1].min(b[1])],
        })
        .unwrap_or(EMPTY)
}

/// Nearest IEEE half float, ties to even; the depths here are far from its limits.
fn round_to_half(value: f64) -> f64 {
    if value == 0.0 {
        return value;
    }
    let unit = 2.0_f64.powi((value.abs().log2().floor() as i32).max(-14) - 10);
    (value / unit).round_ties_even() * unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::peel::{peel, tests as meshes};
    use crate::random::Random;
    use cao_model::mesh::TriangleMesh;

    fn shapes() -> Vec<(&'static str, TriangleMesh)> {
        let (ball, torus) = (TriangleMesh::sphere(3), TriangleMesh::torus(48, 24));
        vec![
            ("sphere", ball.clone()),
            ("box", TriangleMesh::cuboid()),
            ("torus", torus.clone()),
            ("torus from the side", meshes::from_the_side(&torus)),
            (
                "cavity and satellite",
                meshes::join(&[
                    (&ball, Vec3::ZERO, 1.0, false),
                    (&ball, Vec3::ZERO, 0.6, true),
                    (&ball, Vec3::new(1.5, 0.2, 0.9), 0.2, false),
                ]),
            ),
        ]
    }

    fn layers(mesh: &TriangleMesh, scale: f32, radius_mm: f32, resolution: u32) -> MeshLayers {
        let scale = Vec3::new(scale, scale * 0.8, scale * 1.1);
        let camera = ClipCamera::around(mesh, scale, radius_mm, resolution);
        peel(mesh, scale, &camera, 4).0
    }

    /// A random point of the region that the layers stand for: anywhere in a pixel's column between a pair.
    fn inside_point(layers: &MeshLayers, random: &mut Random) -> Vec3 {
        let camera = layers.camera;
        let side = camera.resolution as usize;
        loop {
            let (x, y) = (random.unit() * side as f32, random.unit() * side as f32);
            let pixel = y as usize * side + x as usize;
            let k = (random.unit() * layers.front.len() as f32) as usize;
            let (front, back) = (layers.front[k][pixel], layers.back[k][pixel]);
            if front < back {
                let p = Vec3::new(
                    x * camera.pixel_mm,
                    y * camera.pixel_mm,
                    random.within(front, back) * camera.depth_mm,
                );
                return camera.corner + p;
            }
        }
    }

    /// A random point at most 0.999 r away, most of them near that; the rest is rounding.
    fn nearby(p: Vec3, radius: f32, random: &mut Random) -> Vec3 {
        p + random.vector(-1.0, 1.0).normalize_or_zero() * radius * 0.999 * random.unit().powf(0.1)
    }

    /// How many of `count` points within r of a random inside point the map calls untouched.
    fn missed(layers: &MeshLayers, map: &DilationMap, radius: f32, count: usize) -> usize {
        let mut random = Random(17);
        (0..count)
            .filter(|_| {
                let p = inside_point(layers, &mut random);
                !map.dilated(nearby(p, radius, &mut random))
            })
            .count()
    }

    /// Blocks that are not looked at hold nothing less.
    #[test]
    fn the_envelope_is_the_least_of_all_cells_in_reach() {
        let mut random = Random(5);
        for (side, radius) in [(1, 3.0), (16, 2.5), (37, 40.0), (50, 17.3), (64, 6.0)] {
            let values: Vec<f64> = (0..side * side)
                .map(
                    |_| if random.unit() < 0.4 { f64::INFINITY } else { f64::from(random.within(-9.0, 9.0)) },
                )
                .collect();
            let height = |dx: usize, dy: usize| {
                let square = radius * radius - (dx * dx + dy * dy) as f64;
                (square >= 0.0).then(|| square.sqrt())
            };
            let camera =
                ClipCamera { corner: Vec3::ZERO, pixel_mm: 1.0, depth_mm: 1.0, resolution: side as u32 };
            let cells = values.iter().map(|&v| [v, -v]);
            let made = Cells::new(camera, Mode::Remove, cells, radius as usize, height, false);
            for _ in 0..60 {
                let [x, y] = [(); 2].map(|()| (random.unit() * side as f32) as usize);
                let all = (0..side * side).filter_map(|cell: usize| {
                    let h = height((cell % side).abs_diff(x), (cell / side).abs_diff(y))?;
                    Some(values[cell] - h)
                });
                assert_eq!(made.front.least(x, y, &made.heights), all.fold(f64::INFINITY, f64::min));
            }
        }
    }

    #[test]
    fn conservative_map_contains_every_point_within_the_radius() {
        for (name, mesh) in shapes() {
            for (scale, radius) in [(5.0, 3.0), (20.0, 6.5), (1.0, 9.0), (30.0, 0.7)] {
                for (fine, coarse) in [(64, 64), (128, 32), (128, 64), (96, 13), (48, 4), (64, 77)] {
                    let layers = layers(&mesh, scale, radius, fine);
                    let map = conservative(&layers, Mode::Remove, radius, coarse).unwrap();
                    assert_eq!(
                        missed(&layers, &map, radius, 4000),
                        0,
                        "{name} {scale} {radius} {fine}/{coarse}"
                    );
                }
            }
        }
    }

    /// So the property above can fail, and the paper's recipe does.
    /// A flat face moves by the radius, and a linear sampler reads the same between its cells; the radius rounded up to pixels reaches a pixel's
    /// part farther sideways than eq. (4) does.
    #[test]
    fn the_programmed_map_reads_between_cells_and_rounds_its_radius_up() {
        let radius = 1.3;
        let layers = layers(&TriangleMesh::cuboid(), 4.0, radius, 64);
        let pixel = layers.camera.pixel_mm;
        let programmed = Cells::programmed(&layers, Mode::Remove, radius);
        let literal = Cells::literal(&layers, Mode::Remove, radius, false);
        let mut found = [0; 4];
        // In the middle of a face along the depth, a grid finer than the cells.
        for n in 0..400 {
            let place = |n: i32| (n as f32 - 10.0) * 0.13 * pixel;
            let face = 4.0 * 1.1;
            for (k, z) in [face + radius - 0.02, face + radius + 0.02].into_iter().enumerate() {
                found[k] += usize::from(programmed.dilated(Vec3::new(place(n % 20), place(n / 20), z)));
            }
        }
        assert_eq!(&found[..2], &[400, 0]);
        // Sideways, at the level of the box.
        let reach = |map: &Cells| {
            (0..400)
                .map(|n| 4.0 + n as f32 * 0.05 * pixel)
                .take_while(|&x| map.dilated(Vec3::new(x, 0.1, 0.1)))
                .last()
                .unwrap()
        };
        let rounded = (radius / pixel).ceil() * pixel;
        assert!(reach(&programmed) > reach(&literal), "{} {}", reach(&programmed), reach(&literal));
        assert!((reach(&programmed) - 4.0 - rounded).abs() < 1.1 * pixel, "{} {rounded}", reach(&programmed));
    }

    #[test]
    fn literal_map_misses_points_within_the_radius() {
        for (name, mesh) in shapes() {
            for half in [false, true] {
                let layers = layers(&mesh, 20.0, 6.5, 64);
                let map = literal(&layers, Mode::Remove, 6.5, half);
                let missed = missed(&layers, &map, 6.5, 200_000);
                assert!(missed > 0 && missed < 1000, "{name}, half {half}: {missed}");
            }
        }
    }

    /// Keeping: what the map calls untouched has its whole ball inside the mesh.
    #[test]
    fn contraction_is_conservative() {
        let mut random = Random(23);
        for (name, mesh) in shapes() {
            for (scale, radius) in [(20.0, 3.0), (40.0, 6.5), (3.0, 9.0)] {
                for (fine, coarse) in [(64, 64), (128, 32), (160, 80)] {
                    let layers = layers(&mesh, scale, radius, fine);
                    let map = conservative(&layers, Mode::Keep, radius, coarse).unwrap();
                    let mut untouched = 0;
                    for _ in 0..4000 {
                        let p = inside_point(&layers, &mut random);
                        if !map.dilated(p) {
                            untouched += 1;
                            for _ in 0..8 {
                                let q = nearby(p, radius, &mut random);
                                assert!(layers.inside(q), "{name} {scale} {radius} {fine}/{coarse}: {p} {q}");
                            }
                        }
                    }
                    // Not by calling everything changed.
                    if scale == 40.0 && ["sphere", "box"].contains(&name) {
                        assert!(untouched > 400, "{name}: {untouched}");
                    }
                }
            }
        }
    }

    /// Tight, too: on a box far from its edges the map is the surface moved by r.
    #[test]
    fn dilation_moves_a_flat_face_by_the_radius() {
        let mesh = TriangleMesh::cuboid();
        let camera = ClipCamera::around(&mesh, Vec3::splat(20.0), 4.0, 128);
        let layers = peel(&mesh, Vec3::splat(20.0), &camera, 1).0;
        for (mode, z) in [(Mode::Remove, 24.0), (Mode::Keep, 16.0)] {
            let maps = [conservative(&layers, mode, 4.0, 64).unwrap(), literal(&layers, mode, 4.0, false)];
            for map in maps {
                for sign in [-1.0, 1.0] {
                    let at = |z: f32| map.dilated(Vec3::new(0.3, -0.2, sign * z));
                    assert_ne!(at(z - 0.01), at(z + 0.01), "{mode:?}");
                }
            }
        }
    }

    /// Sideways the conservative map is at most a cell and a mesh pixel larger than the ball.
    #[test]
    fn dilation_grows_sideways_by_the_radius_and_two_cells() {
        let mesh = TriangleMesh::cuboid();
        let camera = ClipCamera::around(&mesh, Vec3::splat(20.0), 4.0, 256);
        let layers = peel(&mesh, Vec3::splat(20.0), &camera, 1).0;
        let map = conservative(&layers, Mode::Remove, 4.0, 128).unwrap();
        let edge = (0..4000).map(|i| 20.0 + i as f32 * 0.002).find(|&x| !map.dilated(Vec3::new(x, 0.1, 0.0)));
        let extra = edge.unwrap() - 24.0;
        assert!(extra >= -0.01 && extra <= 2.5 * map.camera.pixel_mm, "{extra} of {}", map.camera.pixel_mm);
    }

    #[test]
    fn outside_the_map_nothing_is_removed_and_nothing_is_kept() {
        let layers = layers(&TriangleMesh::sphere(2), 5.0, 1.0, 32);
        let far = Vec3::splat(100.0);
        assert!(!conservative(&layers, Mode::Remove, 1.0, 16).unwrap().dilated(far));
        assert!(conservative(&layers, Mode::Keep, 1.0, 16).unwrap().dilated(far));
    }

    #[test]
    fn a_map_of_too_few_cells_is_refused() {
        let layers = layers(&TriangleMesh::sphere(1), 5.0, 1.0, 32);
        for side in [0, 2, 3] {
            let error = conservative(&layers, Mode::Remove, 1.0, side).unwrap_err().to_string();
            assert!(error.contains("dilation map resolution") && error.contains("at least 4"), "{error}");
        }
    }

    #[test]
    fn half_floats_have_eleven_bits() {
        for (value, half) in
            [(0.0, 0.0), (1.0, 1.0), (0.1, 0.099_975_586), (0.333_333, 0.333_251_953), (-1.0, -1.0)]
        {
            assert!((round_to_half(value) - half).abs() < 1e-9, "{value}");
        }
        assert_eq!(round_to_half(1.0 + 1.0 / 2048.0), 1.0);
        assert_eq!(round_to_half(1.0 + 3.0 / 2048.0), 1.0 + 2.0 / 1024.0);
    }
}
