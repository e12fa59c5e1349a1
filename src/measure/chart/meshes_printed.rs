//! AOV Fig. 9 as printed: what [`super::meshes`] is to be laid beside.

use super::meshes::{Of, PRINTED_RAYS};

/// What it has of a scene, 1280 × 720 pixels: 5000, 1941, 292 and 1 rays; volumes at 1, 1/9, 1/25 and 1/225 of the pixels; Volumetric AO with 1024, 256, 32 and
/// 1 lines; Crytek SSAO.
#[derive(Clone, Copy, Debug)]
pub struct Printed {
    /// Which of ours stands for it.
    pub ours: &'static str,
    /// Its name.
    pub theirs: &'static str,
    /// Its triangles.
    pub triangles: u32,
    /// Milliseconds of a GeForce 280 GT, volumes static; of rays those of eight cores.
    pub ms: [f64; 13],
    /// Errors by eq. (31).
    pub error: [f64; 13],
}

/// In the order of [`cao_model::scenes::SCENES`].
pub const FIGURE_9: [Printed; 7] = [
    Printed {
        ours: "colonnade",
        theirs: "Sponza",
        triangles: 199_362,
        ms: [642_571.0, 249_890.0, 37_627.1, 180.9, 110.1, 31.1, 20.8, 9.1, 967.9, 242.9, 238.6, 3.1, 15.7],
        error: [0.0, 0.45, 1.12, 3.5, 0.34, 0.61, 0.72, 0.88, 1.49, 2.03, 2.39, 8.93, 2.81],
    },
    Printed {
        ours: "fence",
        theirs: "City",
        triangles: 9_624,
        ms: [603_202.0, 234_515.0, 35_372.4, 167.9, 137.3, 19.4, 7.9, 1.9, 1035.3, 259.3, 33.6, 3.2, 15.6],
        error: [0.0, 0.65, 1.47, 6.06, 0.46, 0.52, 0.72, 1.1, 3.96, 4.75, 7.03, 12.89, 3.82],
    },
    Printed {
        ours: "house",
        theirs: "House",
        triangles: 28_866,
        ms: [283_226.0, 109_923.0, 16_574.2, 87.7, 25.9, 6.2, 4.5, 2.0, 473.7, 119.0, 15.6, 1.7, 12.8],
        error: [0.0, 0.23, 0.6, 2.88, 0.51, 0.69, 0.78, 0.9, 1.2, 1.47, 2.42, 4.58, 1.68],
    },
    Printed {
        ours: "trees",
        theirs: "Trees",
        triangles: 148_101,
        ms: [691_334.0, 270_322.0, 40_803.0, 195.0, 100.3, 37.0, 27.6, 11.7, 742.8, 186.8, 24.4, 2.4, 14.3],
        error: [0.0, 0.28, 0.8, 6.06, 1.59, 1.74, 2.1, 4.01, 4.32, 4.98, 6.35, 12.26, 2.98],
    },
    Printed {
        ours: "relief",
        theirs: "Belgium",
        triangles: 687_054,
        ms: [490_803.0, 190_687.0, 28_779.9, 156.4, 77.7, 40.3, 27.1, 10.9, 895.4, 224.3, 29.3, 3.1, 15.6],
        error: [0.0, 0.35, 1.02, 6.83, 0.72, 1.13, 1.55, 2.28, 2.19, 2.5, 4.11, 6.65, 4.34],
    },
    Printed {
        ours: "level",
        theirs: "Secret War",
        triangles: 1_445_620,
        ms: [
            556_228.0, 216_142.0, 32_564.8, 161.1, 31.18, 20.19, 17.9, 3.45, 954.8, 252.1, 30.9765, 3.1, 15.6,
        ],
        error: [0.0, 0.89, 2.07, 9.38, 0.43221, 0.72643, 0.87595, 1.16066, 1.62, 2.55, 4.7377, 9.94, 2.85],
    },
    Printed {
        ours: "suburb",
        theirs: "Suburb",
        triangles: 2_688,
        ms: [401_222.0, 155_504.0, 23_439.2, 130.7, 31.7, 4.2, 1.8, 0.4, 1050.1, 265.2, 34.4, 3.2, 15.5],
        error: [0.0, 1.05, 2.19, 8.98, 1.53, 1.48, 1.4, 1.08, 1.34, 2.28, 4.29, 11.36, 2.76],
    },
];

impl Printed {
    /// What is printed of the scene that one of ours stands for.
    pub fn of(ours: &str) -> Option<&'static Self> {
        FIGURE_9.iter().find(|printed| printed.ours == ours)
    }

    /// ms and error of a row.
    pub fn row(&self, of: Of) -> Option<[f64; 2]> {
        let place = match of {
            Of::Rays(part) => [PRINTED_RAYS, 1941, 292, 1].iter().position(|rays| *rays == part),
            Of::Gathered(step) => [1, 3, 5, 15].iter().position(|own| *own == step).map(|n| 4 + n),
            Of::Drawn { is_static } => is_static.then_some(4),
            // Theirs are clamped.
            Of::Clamped => Some(4),
            Of::Volumetric(samples) => {
                [1024, 256, 32, 1].iter().position(|own| *own == samples).map(|n| 8 + n)
            }
            Of::Crytek => Some(12),
            Of::Hbao => None,
        };
        place.map(|place| [self.ms[place], self.error[place]])
    }
}
