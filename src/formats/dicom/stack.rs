//! From frames, each with its own place, to one grid: put in order along the normal, and refused by name where they
//! do not make one.

use std::path::Path;

use super::image::{Frame, Image, cross};
use crate::Result;
use crate::grid::{self, Grid};
use crate::volume::bad;
use cao_model::volume::check_spacing;

/// Slices at least this share of a pixel's edge apart are at different places.
const APART: f64 = 0.01;
/// A slice lies at most this share of a voxel from where an even grid puts it: headers round positions.
const EVEN: f64 = 0.1;
/// A distance of this many usual ones is a gap.
const GAP: f64 = 1.5;
/// Directions and pixel sizes that differ by less are equal: headers round them.
const SAME: f64 = 1e-3;
/// Lengths of directions, and cosines between them, are off by no more.
const UNIT: f64 = 0.01;

/// A frame among several images: which image, which of its frames.
pub(super) type Place = (usize, usize);

/// Frames from the first to the last slice, and where the voxels are.
pub(super) fn stack(path: &Path, images: &[Image]) -> Result<(Vec<Place>, Grid)> {
    let frames =
        |(i, image): (usize, &Image)| (0..image.frames.len()).map(move |f| (i, f)).collect::<Vec<_>>();
    let mut order: Vec<Place> = images.iter().enumerate().flat_map(frames).collect();
    let frame = |place: Place| -> &Frame { &images[place.0].frames[place.1] };
    let named = |place: Place| {
        let image = &images[place.0];
        let file = image.path.file_name().unwrap_or_default().to_string_lossy().escape_debug().to_string();
        if image.frames.len() > 1 { format!("frame {} of {file}", place.1 + 1) } else { file }
    };
    let first = &images[0];
    for image in images {
        let (a, b) = ((first.columns, first.rows, first.kind()), (image.columns, image.rows, image.kind()));
        if a != b {
            let shown =
                |(x, y, kind): (usize, usize, cao_model::values::Kind)| format!("{x} × {y} {}", kind.name());
            let problem = format!(
                "mixed: {} in {}, {} in {}; expected images of one size and type (move the others away)",
                shown(a),
                named((0, 0)),
                shown(b),
                image.path.file_name().unwrap_or_default().to_string_lossy().escape_debug()
            );
            return Err(bad(path, "size", problem));
        }
    }
    let Frame { orientation, spacing, .. } = *frame(order[0]);
    for place in &order {
        let found = frame(*place);
        let turned = found.orientation.as_flattened().iter().zip(orientation.as_flattened());
        if turned.into_iter().any(|(a, b)| (a - b).abs() > SAME) {
            let problem = format!(
                "mixed: {:?} in {}, {orientation:?} in {}; expected parallel slices (a localizer? move it away)",
                found.orientation,
                named(*place),
                named(order[0])
            );
            return Err(bad(path, "ImageOrientationPatient", problem));
        }
        if found.spacing.iter().zip(spacing).any(|(a, b)| (a - b).abs() > SAME * b.abs()) {
            let problem = format!(
                "mixed: {:?} mm in {}, {spacing:?} mm in {}; expected one size of pixels",
                found.spacing,
                named(*place),
                named(order[0])
            );
            return Err(bad(path, "PixelSpacing", problem));
        }
    }
    let lengths = orientation.map(|v| dot(v, v).sqrt());
    let right = dot(orientation[0], orientation[1]).abs() < UNIT;
    if !(right && lengths.iter().all(|length| (length - 1.0).abs() < UNIT)) {
        let problem = format!("{orientation:?}, expected two directions of length 1 at right angles");
        return Err(bad(path, "ImageOrientationPatient", problem));
    }
    // Rounded in the header, so not quite of length 1.
    let row = orientation[0].map(|x| x / lengths[0]);
    let column = orientation[1].map(|x| x / lengths[1]);
    if !spacing.iter().all(|mm| *mm > 0.0) {
        return Err(bad(path, "PixelSpacing", format!("{spacing:?} mm, expected lengths above 0")));
    }
    let normal = cross(row, column);
    let normal = normal.map(|x| x / dot(normal, normal).sqrt());
    let along = |place: Place| dot(frame(place).position, normal);
    order.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
    let (start, end) = (frame(order[0]), frame(order[order.len() - 1]));
    let step = match order.len() {
        1 => {
            let Some(mm) = start.thickness else {
                let problem = "missing, expected the distance of slices, as there is only one slice";
                return Err(bad(path, "SliceThickness", problem));
            };
            normal.map(|x| x * mm)
        }
        n => std::array::from_fn(|a| (end.position[a] - start.position[a]) / (n - 1) as f64),
    };
    let distances: Vec<f64> = order.windows(2).map(|w| along(w[1]) - along(w[0])).collect();
    let small = spacing[0].min(spacing[1]);
    let same: Vec<usize> = (0..distances.len()).filter(|i| distances[*i] < APART * small).collect();
    if let Some(&i) = same.first() {
        let (a, b) = (order[i], order[i + 1]);
        let copy = a.0 != b.0 && images[a.0].uid == images[b.0].uid && !images[a.0].uid.is_empty();
        let why = if copy { "the same image twice" } else { "time points, echoes or phases?" };
        let problem = format!(
            "{} of {} slices lie where another lies, first {} and {} ({why}); expected each place once",
            same.len(),
            order.len(),
            named(a),
            named(b)
        );
        return Err(bad(path, "ImagePositionPatient", problem));
    }
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    if let Some(i) = distances.iter().position(|d| *d > GAP * usual) {
        let problem = format!(
            "a gap of {:.4} mm between {} and {}, where slices are {usual:.4} mm apart: about {} are missing",
            distances[i],
            named(order[i]),
            named(order[i + 1]),
            (distances[i] / usual).round() - 1.0
        );
        return Err(bad(path, "ImagePositionPatient", problem));
    }
    let length = dot(step, normal);
    for (i, place) in order.iter().enumerate() {
        let from = |a: usize| frame(*place).position[a] - start.position[a] - step[a] * i as f64;
        let off: [f64; 3] = std::array::from_fn(from);
        let (away, beside) = (dot(off, normal).abs(), dot(off, row).abs().max(dot(off, column).abs()));
        if away > EVEN * length || beside > EVEN * small {
            let what = if away > EVEN * length { "uneven spacing" } else { "slices beside each other" };
            let problem = format!(
                "{what}: {} lies {:.4} mm from where slices at even distances of {length:.4} mm would put it \
                 (distances are {:.4} to {:.4} mm); resample the series first, for example with 3D Slicer",
                named(*place),
                dot(off, off).sqrt(),
                sorted[0],
                sorted[sorted.len() - 1]
            );
            return Err(bad(path, "ImagePositionPatient", problem));
        }
    }
    let vectors = [row.map(|x| x * spacing[0]), column.map(|x| x * spacing[1]), step];
    let (spacing, directions) = grid::axes(vectors).map_err(|problem| {
        let tilt = (length / dot(step, step).sqrt()).clamp(-1.0, 1.0).acos().to_degrees();
        bad(path, "ImagePositionPatient", format!("gantry tilt of {tilt:.1}°: {problem}"))
    })?;
    check_spacing(spacing).map_err(|p| bad(path, "PixelSpacing or ImagePositionPatient", p))?;
    let grid = Grid { spacing, origin: start.position, directions, ..Grid::plain(spacing) };
    Ok((order, grid.flipped([-1.0, -1.0, 1.0])))
}

/// Slope and intercept when they are the same for all frames.
pub(super) fn common_rescale(images: &[Image]) -> Option<(f64, f64)> {
    let mut all = images.iter().flat_map(|image| &image.frames).map(|frame| frame.rescale);
    let first = all.next()?;
    all.all(|rescale| rescale == first).then_some(first)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
