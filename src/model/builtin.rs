//! Built-in volumes: procedural, the same bit for bit on every machine, at any size.
//!
//! `builtin:NAME:SIZE` is a cube of SIZE³ voxels of 1 mm; `builtin:NAME:XxYxZ` has other dimensions and
//! `builtin:NAME:XxYxZ:SX,SY,SZ` another spacing in mm. Every scene fills its box, whatever its proportions.
//!
//! Scenes are written as solids in coordinates from -1 to 1 along each axis: the centre of voxel `i` of `n` is at
//! `(2i + 1 - n) / n`. A solid of value `v` with signed distance `d` (negative inside) covers the share
//! `clamp(1/2 - d/h)` of a voxel, `h` being the edge of the coarsest voxel: the partial-volume effect of a scanner,
//! which keeps surfaces smooth. Only `+ - × ÷`, `sqrt` and comparisons are used, all exact by IEEE 754, so that no
//! mathematical library can make a difference.

use crate::error::quoted;
use crate::values::Values;
use crate::volume::Volume;
use crate::{Error, Result};

/// Names of the built-in volumes, each with one line on what it is.
pub const NAMES: [(&str, &str); 10] = [
    ("engine", "uint8; engine block (110) with bores, bolt holes, oil channels; liners (150), valves (230)"),
    ("fruit", "uint8; rind (200), pith (50), soft flesh (70-120), membranes (140), seeds (240), core (180)"),
    ("beetle", "uint8; a thin shell of chitin (180) with six hollow legs, tissue (40), a hollow trunk"),
    (
        "skeleton",
        "int16, Hounsfield; spine, ribs, breastbone and pelvis of thin bone (300-1000) in soft tissue (40)",
    ),
    (
        "bucky",
        "uint8; 60 soft balls (255 in the middle) at the corners of a truncated icosahedron, bonds (160) between",
    ),
    ("empty", "uint8; 0 everywhere: every ambient value is 1"),
    ("uniform", "uint8; 255 everywhere"),
    ("half-space", "uint8; 255 in the upper half along z (index >= Z/2), 0 below"),
    ("voxel", "uint8; 255 in the one voxel at index dims/2 (rounded down), 0 elsewhere"),
    (
        "sheets",
        "uint8; 255 in every eighth slice along z (index 4, 12, ...), 0 between: thin parallel layers",
    ),
];

/// Most voxels of a built-in volume (1290³).
const MAX_VOXELS: u64 = 1 << 31;

/// The built-in volume `name` as a cube of `size`³ voxels of 1 mm.
///
/// # Errors
/// As [`builtin_box`].
pub fn builtin(name: &str, size: usize) -> Result<Volume> {
    builtin_box(name, [size; 3], [1.0; 3])
}

/// The built-in volume `name` with `dims` voxels along x, y, z of `spacing` mm.
///
/// # Errors
/// [`Error::Config`] for a name that is none of [`NAMES`], an axis without voxels or a spacing that is not positive;
/// [`Error::Limit`] above 2³¹ voxels.
pub fn builtin_box(name: &str, dims: [usize; 3], spacing: [f64; 3]) -> Result<Volume> {
    if dims.contains(&0) {
        return Err(refused(format!(
            "{}x{}x{} voxels: expected at least 1 along each axis",
            dims[0], dims[1], dims[2]
        )));
    }
    let voxels = dims.iter().fold(1u64, |product, &n| product.saturating_mul(n as u64));
    if voxels > MAX_VOXELS {
        return Err(Error::Limit {
            what: format!("built-in volume {name} of {}x{}x{} voxels", dims[0], dims[1], dims[2]),
            needed: voxels,
            limit: MAX_VOXELS,
            hint: "choose a smaller size".into(),
        });
    }
    let [nx, ny, nz] = dims;
    let values = match name {
        "engine" => Values::U8(sampled(dims, |p, h| engine(p, h) as u8)),
        "fruit" => Values::U8(sampled(dims, |p, h| fruit(p, h) as u8)),
        "beetle" => Values::U8(sampled(dims, |p, h| beetle(p, h) as u8)),
        "skeleton" => Values::I16(sampled(dims, |p, h| skeleton(p, h) as i16)),
        "bucky" => Values::U8(sampled(dims, |p, _| bucky(p) as u8)),
        "empty" => Values::U8(indexed(dims, |_| false)),
        "uniform" => Values::U8(indexed(dims, |_| true)),
        "half-space" => Values::U8(indexed(dims, |[_, _, z]| z >= nz / 2)),
        "voxel" => Values::U8(indexed(dims, |at| at == [nx / 2, ny / 2, nz / 2])),
        "sheets" => Values::U8(indexed(dims, |[_, _, z]| z % 8 == 4)),
        _ => {
            let names = NAMES.map(|(name, _)| name).join(", ");
            return Err(refused(format!("no volume {}; expected one of {names}", quoted(name))));
        }
    };
    Volume::new(dims, spacing, values)
}

/// The built-in volume that `spec` names: `builtin:NAME:SIZE`, `builtin:NAME:XxYxZ` or `builtin:NAME:XxYxZ:SX,SY,SZ`.
///
/// # Errors
/// [`Error::Config`] when `spec` has another form, else as [`builtin_box`].
pub fn from_spec(spec: &str) -> Result<Volume> {
    let expected = || {
        let forms = "builtin:NAME:SIZE, builtin:NAME:XxYxZ or builtin:NAME:XxYxZ:SX,SY,SZ";
        let problem = format!("expected {forms} with sizes of at least 1 voxel, such as builtin:engine:128");
        Error::Config { what: spec.into(), problem }
    };
    let mut parts = spec.strip_prefix("builtin:").ok_or_else(expected)?.split(':');
    let name = parts.next().unwrap_or_default();
    let dims = parts.next().and_then(|text| numbers::<usize>(text, 'x'));
    let dims = dims.filter(|dims| !dims.contains(&0)).ok_or_else(expected)?;
    let spacing =
        parts.next().map_or(Some([1.0; 3]), |text| numbers::<f64>(text, ',')).ok_or_else(expected)?;
    match parts.next() {
        None => builtin_box(name, dims, spacing),
        Some(_) => Err(expected()),
    }
}

fn refused(problem: String) -> Error {
    Error::Config { what: "builtin".into(), problem }
}

/// One number for all axes, or three.
fn numbers<T: std::str::FromStr + Copy>(text: &str, separator: char) -> Option<[T; 3]> {
    let list: Vec<T> = text.split(separator).map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
    match list[..] {
        [n] => Some([n; 3]),
        [x, y, z] => Some([x, y, z]),
        _ => None,
    }
}

/// 255 where `inside` holds for the voxel's index.
fn indexed(dims: [usize; 3], inside: impl Fn([usize; 3]) -> bool + Sync) -> Vec<u8> {
    filled(dims, |at| if inside(at) { 255 } else { 0 })
}

/// A scene at every voxel centre, in coordinates from -1 to 1, with the edge of the coarsest voxel in them.
fn sampled<T: Copy + Default + Send>(dims: [usize; 3], scene: impl Fn([f64; 3], f64) -> T + Sync) -> Vec<T> {
    let edge = 2.0 / dims.into_iter().fold(usize::MAX, usize::min) as f64;
    let at = |i: usize, n: usize| ((2 * i + 1) as f64 - n as f64) / n as f64;
    filled(dims, |[x, y, z]| scene([at(x, dims[0]), at(y, dims[1]), at(z, dims[2])], edge))
}

/// `value` at every index, x fastest. Each voxel is on its own, so threads share the slices.
fn filled<T: Copy + Default + Send>(
    [nx, ny, nz]: [usize; 3],
    value: impl Fn([usize; 3]) -> T + Sync,
) -> Vec<T> {
    let mut out = vec![T::default(); nx * ny * nz];
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(nz);
    let slices = nz.div_ceil(threads);
    std::thread::scope(|scope| {
        for (chunk, part) in out.chunks_mut(slices * nx * ny).enumerate() {
            let value = &value;
            scope.spawn(move || {
                for (row, line) in part.chunks_mut(nx).enumerate() {
                    let (y, z) = (row % ny, row / ny + chunk * slices);
                    line.iter_mut().enumerate().for_each(|(x, out)| *out = value([x, y, z]));
                }
            });
        }
    });
    out
}

/// Share of a voxel of edge `h` that a solid at signed distance `d` covers.
fn cover(d: f64, h: f64) -> f64 {
    (0.5 - d / h).clamp(0.0, 1.0)
}

/// `value` where the solid is, `below` elsewhere.
fn over(below: f64, value: f64, d: f64, h: f64) -> f64 {
    below + (value - below) * cover(d, h)
}

/// To the nearest integer, halves up.
fn nearest(value: f64) -> f64 {
    (value + 0.5).floor()
}

fn length2(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

fn length3(x: f64, y: f64, z: f64) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// Outside of a range: `|t - middle| - half`.
fn slab(t: f64, low: f64, high: f64) -> f64 {
    (t - (low + high) / 2.0).abs() - (high - low) / 2.0
}

/// Round rod from `a` to `b`.
fn rod([x, y, z]: [f64; 3], a: [f64; 3], b: [f64; 3], radius: f64) -> f64 {
    let (ux, uy, uz) = (b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    let (px, py, pz) = (x - a[0], y - a[1], z - a[2]);
    let t = ((px * ux + py * uy + pz * uz) / (ux * ux + uy * uy + uz * uz)).clamp(0.0, 1.0);
    length3(px - t * ux, py - t * uy, pz - t * uz) - radius
}

/// Ellipse of half-axes `a`, `b`: signed distance to first order.
fn ellipse(x: f64, y: f64, a: f64, b: f64) -> f64 {
    let level = length2(x / a, y / b);
    let slope = length2(x / (a * a), y / (b * b));
    if slope < 1e-9 { -a.min(b) } else { (level - 1.0) * level / slope }
}

/// Ellipsoid of half-axes `a`, `b`, `c`: signed distance to first order.
fn ellipsoid([x, y, z]: [f64; 3], [a, b, c]: [f64; 3]) -> f64 {
    let level = length3(x / a, y / b, z / c);
    let slope = length3(x / (a * a), y / (b * b), z / (c * c));
    if slope < 1e-9 { -a.min(b).min(c) } else { (level - 1.0) * level / slope }
}

/// Block |x| <= 0.88, |y| <= 0.56, -0.8 <= z <= 0.5 of value 110. Cut out of it: four bores along z (radius 0.15, at
/// x = ±0.2, ±0.6) that open into a crankcase (radius 0.42 along x at z = -0.8), a water jacket round each bore
/// (radius 0.19 to 0.23, -0.15 <= z <= 0.35), ten bolt holes (radius 0.04, y = ±0.44), an oil gallery along x
/// (radius 0.05 at y = 0.42, z = -0.3) with a feed from it to the crankcase beside each bore. Added: a hollow pipe with
/// a flange on the side of two bores, liners of value 150 in the bores (radius 0.15 to 0.17), and two valves of
/// value 230 with thin stems over each bore.
fn engine([x, y, z]: [f64; 3], h: f64) -> f64 {
    // The nearest bore, bolt and feed: they repeat every 0.4 along x.
    let bore_x = x - (nearest((x - 0.2) / 0.4).clamp(-2.0, 1.0) * 0.4 + 0.2);
    let bolt_x = x - nearest(x / 0.4).clamp(-2.0, 2.0) * 0.4;
    let bore = length2(bore_x, y);
    let block = slab(x, -0.88, 0.88).max(slab(y, -0.56, 0.56)).max(slab(z, -0.8, 0.5));
    // Pipes leave the two middle bores towards -y.
    let pipe = length2(x.abs() - 0.2, z - 0.12);
    let pipe_solid = (pipe - 0.15).max(slab(y, -0.95, -0.5));
    let flange = slab(x, -0.42, 0.42).max(slab(z, -0.1, 0.34)).max(slab(y, -0.95, -0.87));
    let solid = block.min(pipe_solid).min(flange);
    let crankcase = length2(y, z + 0.8) - 0.42;
    let holes = (bore - 0.15)
        .max(-0.8 - z)
        .min(crankcase.max(x.abs() - 0.8))
        .min(slab(bore, 0.19, 0.23).max(slab(z, -0.15, 0.35)))
        .min((length2(bolt_x, y.abs() - 0.44) - 0.04).max(0.05 - z))
        .min(length2(y - 0.42, z + 0.3) - 0.05)
        .min(rod([bolt_x, y, z], [0.0, 0.42, -0.3], [0.0, 0.2, -0.6], 0.03))
        .min((pipe - 0.1).max(slab(y, -1.0, -0.2)));
    let mut value = over(0.0, 110.0, solid.max(-holes), h);
    // A liner lines its bore as far as the crankcase, and leaves the pipes open.
    let liner = slab(bore, 0.15, 0.17).max(slab(z, -0.45, 0.5)).max(-crankcase).max(0.1 - pipe.max(y));
    value = over(value, 150.0, liner, h);
    let valve_x = bore_x.abs() - 0.07;
    let valve = length2(valve_x, y);
    let disc = (valve - 0.065).max(slab(z, 0.37, 0.44));
    let stem = (valve - 0.02).max(slab(z, 0.42, 0.85));
    let spring = slab(valve, 0.03, 0.045).max(slab(z, 0.6, 0.82)).max(nearest(z / 0.06) * 0.06 - z);
    nearest(over(value, 230.0, disc.min(stem).min(spring), h))
}

/// Normals of the five planes through the z axis, 36° apart: (cos, sin) of 0°, 36°, 72°, 108°, 144°.
const MEMBRANES: [[f64; 2]; 5] = [
    [1.0, 0.0],
    [0.809016994374947, 0.587785252292473],
    [0.309016994374947, 0.951056516295154],
    [-0.309016994374947, 0.951056516295154],
    [-0.809016994374947, 0.587785252292473],
];

/// Shells inside shells round a slightly flattened centre (z stretched by 1/0.92), by radius r: rind of value 200
/// from 0.86 to 0.92, pith of 50 from 0.78, flesh below that falling from 120 outside to 70 inside, in ten
/// segments between membranes (value 140, 0.02 thick), a hard core of 180 from 0.3 to 0.26 and nothing in it; ten
/// seeds of value 240 in the flesh at r = 0.5, one a segment. A stalk hole of radius 0.08 pierces the rind along +z.
fn fruit([x, y, z]: [f64; 3], h: f64) -> f64 {
    let r = length3(x, y, z / 0.92);
    if r > 0.93 + h {
        return 0.0;
    }
    let mut value = over(0.0, 200.0, r - 0.92, h);
    value = over(value, 50.0, r - 0.86, h);
    let flesh = 70.0 + 50.0 * (r / 0.78).min(1.0) * (r / 0.78).min(1.0);
    value = over(value, flesh, r - 0.78, h);
    let membrane = MEMBRANES.iter().fold(f64::INFINITY, |d, [c, s]| d.min((x * c + y * s).abs())) - 0.01;
    value = over(value, 140.0, membrane.max(r - 0.8).min((r - 0.79).abs() - 0.01), h);
    // Seeds lie between the membranes: across the planes' normals turned by half a segment, 18°.
    let (c, s) = (0.951056516295154, 0.309016994374947);
    let seed = MEMBRANES.iter().fold(f64::INFINITY, |d, [a, b]| {
        let (nx, ny) = (a * c - b * s, a * s + b * c);
        let (along, across) = ((x * nx + y * ny).abs(), y * nx - x * ny);
        d.min(ellipsoid([along - 0.5, across, z], [0.07, 0.04, 0.12]))
    });
    value = over(value, 240.0, seed, h);
    value = over(value, 180.0, r - 0.3, h);
    value = over(value, 0.0, r - 0.26, h);
    nearest(over(value, 0.0, (length2(x, y) - 0.08).max(0.7 - z), h))
}

/// Abdomen, thorax and head along -y: ellipsoids of tissue (40) in a shell of chitin (180) 0.03 thick, the abdomen's inside empty and its wing cases apart
/// along a seam of 0.016 on top (+z). Three pairs of hollow legs of two rods each (radius 0.045, walls 0.02), which stand out to the side and down, and two
/// jaws. The size of a stag beetle in its box, which has more of its opacity in thin sheets than any other scene here.
fn beetle([x, y, z]: [f64; 3], h: f64) -> f64 {
    let side = x.abs();
    let trunk = [
        ellipsoid([x, y - 0.3, z - 0.1], [0.5, 0.6, 0.6]),
        ellipsoid([x, y + 0.36, z - 0.05], [0.42, 0.24, 0.48]),
        ellipsoid([x, y + 0.64, z], [0.24, 0.17, 0.3]),
    ];
    let inside = trunk.into_iter().fold(f64::INFINITY, f64::min);
    let shell = trunk.into_iter().fold(f64::INFINITY, |d, part| d.min(part.max(-0.03 - part)));
    let seam = (side - 0.008).max(0.2 - z).max(-0.1 - y);
    let mut value = over(0.0, 40.0, inside, h);
    value = over(value, 0.0, ellipsoid([x, y - 0.3, z - 0.1], [0.36, 0.45, 0.42]), h);
    value = over(value, 180.0, shell.max(-seam), h);
    // The nearest pair of legs: they leave the trunk 0.35 apart.
    let pair = (nearest((y - 0.02) / 0.35).clamp(-1.0, 1.0)) * 0.35;
    let (hip, lean) = ([0.3, pair + 0.02, -0.25], 0.3 * pair);
    let (knee, foot) = ([0.7, hip[1] + lean, 0.05], [0.9, hip[1] + 2.0 * lean, -0.92]);
    let leg = rod([side, y, z], hip, knee, 0.045).min(rod([side, y, z], knee, foot, 0.045));
    value = over(value, 180.0, leg.max(-0.02 - leg).max(-inside), h);
    let jaw = rod([side, y, z], [0.1, -0.78, 0.0], [0.2, -0.9, 0.05], 0.04).min(rod(
        [side, y, z],
        [0.2, -0.9, 0.05],
        [0.05, -0.95, 0.08],
        0.03,
    ));
    nearest(over(value, 180.0, jaw, h))
}

/// A trunk in Hounsfield units: air -1000, an elliptic body (half-axes 0.92 × 0.7 along x and y) of soft tissue 40
/// under a fat layer of -100, lungs of -850. In it, of compact bone (1000) and thin: ten pairs of ribs (radius 0.022,
/// ellipse 0.74 × 0.54, sloping down to the front), a breastbone plate, a spine of vertebrae whose bodies are a shell
/// (0.012) round a lattice of rods (pitch 0.05, radius 0.008, 500), each with an arch, a canal and three
/// processes, and a pelvis: a bowl of 0.03 with two holes.
fn skeleton([x, y, z]: [f64; 3], h: f64) -> f64 {
    let body = ellipse(x, y, 0.92, 0.7);
    let mut value = over(-1000.0, -100.0, body, h);
    value = over(value, 40.0, body + 0.04, h);
    if body > h {
        return nearest(value);
    }
    let side = x.abs();
    let lung = ellipsoid([side - 0.34, y + 0.04, z - 0.3], [0.24, 0.38, 0.55]);
    value = over(value, -850.0, lung, h);

    // Ribs: the nearest of ten, 0.12 apart, in planes that slope down to the front (-y).
    let slope = z + 0.3 * (0.4 - y);
    let level = slope - (nearest((slope + 0.1) / 0.12).clamp(0.0, 9.0) * 0.12 - 0.1);
    let rib = length2(ellipse(x, y, 0.74, 0.54), level / 1.044) - 0.022;
    // They start beside the spine and end in softer cartilage before the breastbone.
    value = over(value, 300.0, rib.max(0.05 - side).max(y - 0.5).max(-0.62 - y), h);
    value = over(value, 1000.0, rib.max(0.05 - side).max(y - 0.53).max(-0.44 - y), h);
    let front = y + 0.55 + 0.05 * (z - 0.3);
    let breastbone = (side - 0.07 - 0.03 * z).max(slab(front, -0.025, 0.025)).max(slab(z, -0.15, 0.72));
    value = over(value, 900.0, breastbone, h);

    // Spine: the nearest vertebra, 0.17 apart.
    let up = z - (nearest(z / 0.17).clamp(-4.0, 5.0) * 0.17);
    let (sy, disc) = (y - 0.36, slab(up, -0.065, 0.065));
    let round = ellipse(x, sy, 0.13, 0.1);
    let vertebra = round.max(disc);
    if vertebra < h {
        let fold = |t: f64| t - nearest(t / 0.05) * 0.05;
        let (fx, fy, fz) = (fold(x), fold(sy), fold(up));
        let lattice = length2(fx, fy).min(length2(fy, fz)).min(length2(fz, fx)) - 0.008;
        value = over(value, 20.0, vertebra, h);
        value = over(value, 500.0, lattice.max(vertebra), h);
        value = over(value, 1000.0, vertebra.max(-0.012 - vertebra), h);
    }
    let canal = length2(x, y - 0.5);
    let arch = slab(canal, 0.045, 0.065).max(slab(up, -0.045, 0.045));
    let spinous = rod([x, y, up], [0.0, 0.56, 0.01], [0.0, 0.66, -0.05], 0.016);
    let transverse = rod([side, y, up], [0.05, 0.48, 0.0], [0.2, 0.54, 0.02], 0.018);
    value = over(value, 1000.0, arch.min(spinous).min(transverse).max(slab(z, -0.76, 0.93)), h);

    // Pelvis: a bowl open to the top and the front, with a hole on each side.
    if z < -0.4 {
        let bowl = ellipsoid([x, y - 0.05, z + 0.45], [0.66, 0.46, 0.5]);
        let hole = ellipsoid([side - 0.28, y + 0.2, z + 0.8], [0.12, 0.16, 0.12]);
        let cut = (z + 0.42 + 0.5 * (side - 0.66).min(0.0) * 0.3).max(-0.05 - side - y);
        value = over(value, 800.0, (bowl.abs() - 0.015).max(cut).max(-hole), h);
    }
    nearest(value)
}

/// A corner of each kind of a truncated icosahedron of edge 2 (golden ratio g): (0, 1, 3g), (1, 2 + g, 2g), (g, 2, 2g + 1). The others follow by
/// cyclic exchange of the axes and by signs.
const CORNERS: [[f64; 3]; 3] = [
    [0.0, 1.0, 4.854_101_966_249_685],
    [1.0, 3.618_033_988_749_895, 3.236_067_977_499_79],
    [1.618_033_988_749_895, 2.0, 4.236_067_977_499_79],
];
/// From the middle to its corners, and their balls' radius.
const CAGE: f64 = 0.72;
const BALL: f64 = 0.22;

/// The carbon cage C60 as its electron density: the sum of (1 - (d / 0.22)^2)^2 over the 60 corners within 0.22 of a place, times 255. Neighbours are 0.29
/// apart, so that balls of less than 160 join to bonds.
fn bucky([x, y, z]: [f64; 3]) -> f64 {
    let r = length3(x, y, z);
    if (r - CAGE).abs() >= BALL {
        return 0.0;
    }
    // (9 g + 10)^(1/2).
    let scale = CAGE / 4.956_037_318_135_231;
    let mut sum = 0.0;
    for corner in CORNERS {
        for turn in 0..3 {
            let [a, b, c] = std::array::from_fn(|axis| scale * corner[(axis + turn) % 3]);
            for signs in 0..8_u32 {
                let sign = |bit: u32| if signs >> bit & 1 == 1 { -1.0 } else { 1.0 };
                // Without a side there is no mirror image.
                if (a == 0.0 && sign(0) < 0.0) || (b == 0.0 && sign(1) < 0.0) || (c == 0.0 && sign(2) < 0.0) {
                    continue;
                }
                let (dx, dy, dz) = (x - sign(0) * a, y - sign(1) * b, z - sign(2) * c);
                let part = 1.0 - (dx * dx + dy * dy + dz * dz) / (BALL * BALL);
                if part > 0.0 {
                    sum += part * part;
                }
            }
        }
    }
    nearest((255.0 * sum).min(255.0))
}
