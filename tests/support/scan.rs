//! A volume of a patient as files: the same one in each of the 48 orders in which its voxels can be stored.

/// A grid of int16 values in the patient.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Distances in mm; f32 holds them exactly.
    pub spacing: [f64; 3],
    /// Unit vectors of the index axes: right, anterior, superior.
    pub directions: [[f64; 3]; 3],
    /// Position of the first voxel in mm.
    pub origin: [f64; 3],
    /// x fastest.
    pub values: Vec<i16>,
}

/// Which of a scan's axes each axis of another order runs along, and which of them run backwards.
pub type Order = ([usize; 3], [bool; 3]);

/// All 48.
pub fn orders() -> Vec<Order> {
    let axes = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let signs = (0..8).map(|bits| [0, 1, 2].map(|a| bits >> a & 1 == 1));
    axes.iter().flat_map(|axes| signs.clone().map(|signs| (*axes, signs))).collect()
}

impl Scan {
    /// Position of a voxel in mm.
    pub fn position(&self, voxel: [usize; 3]) -> [f64; 3] {
        let along = |a: usize, i: usize| voxel[a] as f64 * self.spacing[a] * self.directions[a][i];
        [0, 1, 2].map(|i| self.origin[i] + along(0, i) + along(1, i) + along(2, i))
    }

    /// Every voxel, x fastest.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.dims;
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }

    /// The same values at the same places, stored in another order.
    pub fn in_order(&self, (axes, reversed): Order) -> Self {
        let mut first = [0; 3];
        (0..3).filter(|a| reversed[*a]).for_each(|a| first[axes[a]] = self.dims[axes[a]] - 1);
        let sign = |a: usize| if reversed[a] { -1.0 } else { 1.0 };
        let mut other = Self {
            dims: axes.map(|a| self.dims[a]),
            spacing: axes.map(|a| self.spacing[a]),
            directions: [0, 1, 2].map(|a| self.directions[axes[a]].map(|d| sign(a) * d)),
            origin: self.position(first),
            values: Vec::new(),
        };
        for voxel in other.voxels() {
            let mut at = [0; 3];
            for a in 0..3 {
                at[axes[a]] = if reversed[a] { other.dims[a] - 1 - voxel[a] } else { voxel[a] };
            }
            other.values.push(self.values[at[0] + self.dims[0] * (at[1] + self.dims[1] * at[2])]);
        }
        other
    }

    /// As an attached NRRD; `space` is `RAS`, `LAS` or `LPS`.
    pub fn nrrd(&self, space: &str) -> Vec<u8> {
        let signs = [("L", 0), ("P", 1), ("I", 2)]
            .map(|(letter, a)| if space[a..].starts_with(letter) { -1.0 } else { 1.0 });
        let vector = |v: [f64; 3]| format!("({},{},{})", signs[0] * v[0], signs[1] * v[1], signs[2] * v[2]);
        let axes = [0, 1, 2].map(|a| vector(self.directions[a].map(|d| d * self.spacing[a])));
        let [x, y, z] = self.dims;
        let header = format!(
            "NRRD0004\ntype: int16\ndimension: 3\nspace: {space}\nsizes: {x} {y} {z}\nspace directions: {}\n\
             space origin: {}\nendian: little\nencoding: raw\n\n",
            axes.join(" "),
            vector(self.origin)
        );
        [header.into_bytes(), self.bytes()].concat()
    }

    /// As a MetaImage, which is in LPS.
    pub fn metaimage(&self) -> Vec<u8> {
        let lps = |v: [f64; 3]| format!("{} {} {}", -v[0], -v[1], v[2]);
        let three = |v: [String; 3]| v.join(" ");
        let header = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = {}\n\
             Offset = {}\nElementSpacing = {}\nDimSize = {}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
            three(self.directions.map(lps)),
            lps(self.origin),
            three(self.spacing.map(|s| s.to_string())),
            three(self.dims.map(|d| d.to_string()))
        );
        [header.into_bytes(), self.bytes()].concat()
    }

    /// As a NIfTI-1 file with an sform.
    pub fn nifti(&self) -> Vec<u8> {
        let mut header = self.nifti_header();
        put(&mut header, 254, &1_i16.to_le_bytes());
        for row in 0..3 {
            let of = |a: usize| self.directions[a][row] * self.spacing[a];
            let row_values = [of(0), of(1), of(2), self.origin[row]];
            put(&mut header, 280 + 16 * row, &row_values.map(|v| (v as f32).to_le_bytes()).concat());
        }
        [header, self.bytes()].concat()
    }

    /// As a NIfTI-1 file with a qform.
    pub fn nifti_by_qform(&self) -> Vec<u8> {
        let mut header = self.nifti_header();
        let mut axes = glam::DMat3::from_cols_array_2d(&self.directions);
        // The quaternion is that of right-handed axes; the sign of the third stands in pixdim[0].
        if axes.determinant() < 0.0 {
            axes.z_axis = -axes.z_axis;
            put(&mut header, 76, &(-1_f32).to_le_bytes());
        }
        let q = glam::DQuat::from_mat3(&axes);
        let q = if q.w < 0.0 { -q } else { q };
        put(&mut header, 252, &1_i16.to_le_bytes());
        put(&mut header, 256, &[q.x, q.y, q.z].map(|v| (v as f32).to_le_bytes()).concat());
        put(&mut header, 268, &self.origin.map(|v| (v as f32).to_le_bytes()).concat());
        [header, self.bytes()].concat()
    }

    fn nifti_header(&self) -> Vec<u8> {
        let mut header = vec![0; 352];
        put(&mut header, 0, &348_i32.to_le_bytes());
        let [x, y, z] = self.dims.map(|d| d as i16);
        put(&mut header, 40, &[3, x, y, z, 1, 1, 1, 1].map(i16::to_le_bytes).concat());
        // Type and bits of int16.
        put(&mut header, 70, &[4_i16, 16].map(i16::to_le_bytes).concat());
        let [x, y, z] = self.spacing.map(|s| s as f32);
        put(&mut header, 76, &[1.0, x, y, z].map(f32::to_le_bytes).concat());
        put(&mut header, 108, &352_f32.to_le_bytes());
        put(&mut header, 344, b"n+1\0");
        header
    }

    fn bytes(&self) -> Vec<u8> {
        self.values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }
}

fn put(header: &mut [u8], at: usize, bytes: &[u8]) {
    header[at..at + bytes.len()].copy_from_slice(bytes);
}
