//! Samples of a pixel: the mean of pictures whose fields of view are shifted, and edges that cover their share.

use cao::renderer::{Bands, COLOUR, Renderer, StereoImage};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::look::Look;
use cao_model::samples::Filter;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{Tangents, View};
use cao_testing::*;
use cao_twin::draw::raycast::shifted;
use glam::{Quat, Vec2, Vec3};

const SIZE: [u32; 2] = [45, 38];

fn renderer(gpu: &Gpu, name: &str, transfer: Option<TransferFunction>) -> Renderer {
    let volume = builtin_box(name, [20, 18, 16], [1.0; 3]).unwrap();
    let transfer = transfer.unwrap_or_else(|| TransferFunction::preset("auto", volume.range()).unwrap());
    let setup = Setup::new(volume.min_spacing());
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

/// What a component of a mean may be off by: a shifted field of view rounds its rays to f32 anew, which moves samples by 10⁻⁵ mm.
const ROUNDING: f32 = 2e-3;
/// Share of the components where such a ray passes an edge on the other side.
const GRAZING: f32 = 0.01;

/// Share of the components in which two pictures are further apart.
fn apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.filter(|(a, b)| (*a - *b).abs() > ROUNDING).count() as f32 / (4 * a.len()) as f32
}

#[test]
fn a_picture_is_the_mean_of_shifted_ones() {
    let gpu = open();
    let renderer = renderer(&gpu, "fruit", None);
    let views = eyes(&builtin_box("fruit", [20, 18, 16], [1.0; 3]).unwrap(), 30.0);
    let draw = |views: &[View; 2], look: &Look| renderer.draw(views, look, SIZE).unwrap().0;
    for (samples, filter) in [(2, Filter::Box), (5, Filter::Box), (16, Filter::Box), (6, Filter::Gaussian)] {
        let look = Look { samples, filter, ..Look::default() };
        let found = draw(&views, &look);
        let mean = |turn: Vec2| {
            let mut sums = [0, 1].map(|_| vec![[0.0; 4]; found.colour[0].len()]);
            for place in look.offsets() {
                let views = views.map(|view| shifted(&view, SIZE.map(|s| s as usize), place * turn));
                for (sum, one) in sums.iter_mut().zip(draw(&views, &Look::default()).colour) {
                    for (sum, one) in sum.iter_mut().flatten().zip(one.iter().flatten()) {
                        *sum += one / samples as f32;
                    }
                }
            }
            sums
        };
        let (expected, mirrored) = (mean(Vec2::ONE), mean(Vec2::new(1.0, -1.0)));
        for eye in 0..2 {
            let off = apart(&found.colour[eye], &expected[eye]);
            assert!(off < GRAZING, "{samples} {filter:?}, eye {eye}: {off}");
            // Places turned upside down are others, and so is one sample: the comparison can tell.
            let wrong = apart(&found.colour[eye], &mirrored[eye]);
            assert!(wrong > 3.0 * GRAZING, "{samples} {filter:?}: {wrong}");
            assert!(apart(&found.colour[eye], &draw(&views, &Look::default()).colour[eye]) > 3.0 * GRAZING);
        }
        // Of the nearest sample.
        let first = views.map(|view| shifted(&view, SIZE.map(|s| s as usize), look.offsets()[0]));
        let depths = draw(&first, &Look::default()).depth;
        let pairs = found.depth.iter().flatten().zip(depths.iter().flatten());
        let off = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-4).count() as f32;
        assert!(off < GRAZING * (2 * SIZE[0] * SIZE[1]) as f32, "{off} depths");
    }
    drop(renderer);
    close(gpu);
}

/// Equal eyes see the same, and bands change no bit, with samples too.
#[test]
fn samples_are_the_same_in_every_view_and_band() {
    let gpu = open();
    let renderer = renderer(&gpu, "engine", None);
    let [left, _] = eyes(&builtin_box("engine", [20, 18, 16], [1.0; 3]).unwrap(), 30.0);
    let look = Look { samples: 7, filter: Filter::Gaussian, ..Look::default() };
    let whole = renderer.draw(&[left, left], &look, SIZE).unwrap().0;
    assert!(whole.colour[0] == whole.colour[1] && whole.depth[0] == whole.depth[1]);
    let mut banded = Vec::new();
    let bands = Bands { size: SIZE, rows: 5 };
    let mut take = |_: u32, band: &StereoImage| {
        banded.extend_from_slice(&band.colour[0]);
        Ok::<_, cao::Error>(())
    };
    renderer.draw_bands(&[left, left], &look, bands, &mut take).unwrap();
    assert!(banded == whole.colour[0]);
    drop(renderer);
    close(gpu);
}

/// An opaque box whose face, 22 mm below the eye, ends this far into a pixel on the right and below: the alphas of that pixel, in the
/// middle of the edge, and of the next one outwards, for both edges.
fn edge(renderer: &Renderer, look: &Look, inside: f32) -> [[f32; 2]; 2] {
    // 40 pixels of 0.02 in slope, 22 mm away; the box of 20 x 18 x 16 mm ends at 10 and 9 mm.
    let ends = [10.0_f32 / 22.0, 9.0 / 22.0];
    let pixel = 0.02;
    let right = |end: f32| end + (9.0 + 1.0 - inside) * pixel;
    let tan = Tangents {
        left: right(ends[0]) - 40.0 * pixel,
        right: right(ends[0]),
        up: 40.0 * pixel - right(ends[1]),
        down: -right(ends[1]),
    };
    let position = Vec3::new(0.0, 0.0, 30.0);
    let view =
        View { position, orientation: Quat::IDENTITY, tan, near_mm: 1.0, far_mm: 100.0, reversed: false };
    let image = renderer.draw(&[view, view], look, [40, 40]).unwrap().0;
    let alpha = |x: usize, y: usize| image.colour[0][40 * y + x][3];
    [[alpha(30, 12), alpha(31, 12)], [alpha(12, 30), alpha(12, 31)]]
}

#[test]
fn an_edge_covers_its_share_of_a_pixel() {
    let gpu = open();
    let opaque = TransferFunction::new(vec![[0.0, 1.0]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    let renderer = renderer(&gpu, "uniform", Some(opaque));
    // Rays within a hundredth of a pixel of the edge may leave the box before their first sample.
    let look = |samples, filter| Look { samples, filter, step_mm: Some(0.02), ..Look::default() };
    for inside in [0.13, 0.37, 0.5, 0.71, 0.92] {
        for samples in [1, 4, 16, 25, 64, 256] {
            let found = edge(&renderer, &look(samples, Filter::Box), inside);
            for [on, beyond] in found {
                let off = (on - inside).abs();
                // Half a sample, and the ray on the edge itself.
                assert!(off <= 0.5 / samples as f32 + 0.01, "{samples} samples of {inside}: {on}");
                assert_eq!(beyond, 0.0);
            }
        }
    }
    // Half of a bell, and what lies beyond a pixel of it: (Φ(−2) − Φ(−3)) / (1 − 2 Φ(−3)).
    for [on, beyond] in edge(&renderer, &look(256, Filter::Gaussian), 0.5) {
        assert!((on - 0.5).abs() <= 1.0 / 256.0 + 0.01 && (beyond - 0.0215).abs() <= 0.01, "{on} {beyond}");
    }
    drop(renderer);
    close(gpu);
}

#[test]
fn numbers_of_samples_that_none_has_are_refused_by_name() {
    let gpu = open();
    let renderer = renderer(&gpu, "empty", None);
    let views = eyes(&builtin_box("empty", [20, 18, 16], [1.0; 3]).unwrap(), 0.0);
    for samples in [0, 257, u32::MAX] {
        let look = Look { samples, ..Look::default() };
        let error = renderer.draw(&views, &look, [8, 8]).unwrap_err().to_string();
        assert!(error.contains("image.samples") && error.contains("1 to 256"), "{error}");
    }
    drop(renderer);
    close(gpu);
}
