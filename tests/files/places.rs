//! Volumes of patients, compared by where voxels lie and not by the order in which memory holds them.

use cao_model::volume::Volume;

/// A volume seen along other axes of the same grid.
pub struct Along {
    pub dims: [usize; 3],
    pub spacing: [f64; 3],
    /// Centre of the first voxel.
    pub origin: [f64; 3],
    /// For each voxel, first axis fastest, its number in the volume.
    pub order: Vec<usize>,
}

/// The volume along these axes, one unit vector each; says so when they are not its own, perhaps turned round.
pub fn along(volume: &Volume, axes: [[f64; 3]; 3]) -> Result<Along, String> {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut own = [0; 3];
    let mut turned = [false; 3];
    for (a, axis) in axes.into_iter().enumerate() {
        let cosines = volume.directions.map(|d| dot(d, axis));
        let Some(b) = cosines.iter().position(|c| (c.abs() - 1.0).abs() < 1e-5) else {
            return Err(format!("axes {:?}, expected {axes:?}", volume.directions));
        };
        (own[a], turned[a]) = (b, cosines[b] < 0.0);
    }
    let dims = own.map(|b| volume.dims[b]);
    let stride = [1, volume.dims[0], volume.dims[0] * volume.dims[1]];
    let mut origin = volume.origin;
    for a in (0..3).filter(|a| turned[*a]) {
        let length = (dims[a] - 1) as f64 * volume.spacing[own[a]];
        (0..3).for_each(|i| origin[i] += length * volume.directions[own[a]][i]);
    }
    let at = |a: usize, i: usize| stride[own[a]] * if turned[a] { dims[a] - 1 - i } else { i };
    let mut order = Vec::with_capacity(volume.len());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            order.extend((0..dims[0]).map(|x| at(0, x) + at(1, y) + at(2, z)));
        }
    }
    Ok(Along { dims, spacing: own.map(|b| volume.spacing[b]), origin, order })
}
