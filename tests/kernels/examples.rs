//! Examples to train a network on: labels that are known, and the same examples for the same seed.

use cao_measure::examples::labels::{Labels, radius};
use cao_measure::examples::source::Source;
use cao_measure::examples::{Maker, Plan};
use cao_model::network::Label;
use cao_testing::*;
use cao_twin::Grid;

const EDGE: usize = 24;

/// How far labels may be from integrals: fifty directions, steps of a voxel, a wall that trilinear interpolation makes soft over a voxel.
const COARSE: f64 = 0.04;

fn largest(found: &[f32], expected: impl Fn([usize; 3]) -> Option<f64>) -> f64 {
    let grid = Grid { dims: [EDGE; 3], spacing: [1.0; 3] };
    let off =
        |i: usize| expected(grid.voxel(i)).map_or(0.0, |expected| (f64::from(found[i]) - expected).abs());
    (0..grid.len()).map(off).fold(0.0, f64::max)
}

#[test]
fn labels_of_nothing_and_of_a_half_space_are_known() {
    let gpu = open();
    let mut labels = Labels::new(&gpu, EDGE).unwrap();
    let nothing = vec![0; EDGE.pow(3)];
    for label in Label::ALL {
        let found = labels.of(label, &nothing).unwrap();
        assert_eq!(largest(&found, |_| Some(1.0)), 0.0, "{}", label.name());
    }
    // Opaque from the middle of z on: a ray that rises by cos θ meets it after d / cos θ.
    let wall: Vec<u16> =
        (0..EDGE.pow(3)).map(|i| if i / EDGE / EDGE >= EDGE / 2 { 65535 } else { 0 }).collect();
    // Away from the sides, through which light comes in, and from the wall itself.
    let margin = radius(EDGE).ceil() as usize + 1;
    let distance = |[x, y, z]: [usize; 3]| {
        let inside = [x, y].iter().all(|c| (margin..EDGE - margin).contains(c));
        // Opaque is what is opaque wholly: the wall begins at its first voxels' centres, softly half a voxel before.
        (inside && z + 1 < EDGE / 2).then(|| (EDGE / 2 - z) as f64 - 0.5)
    };
    let r = radius(EDGE);
    let mean = labels.of(Label::Mean, &wall).unwrap();
    let expected =
        |at| distance(at).map(|d| if d < r { 1.0 - (r - d - d * (r / d).ln()) / (2.0 * r) } else { 1.0 });
    assert!(largest(&mean, expected) < COARSE, "{}", largest(&mean, expected));
    // The last sample is at 1.5 voxels and half a voxel for each of the others; it is dark from a hundredth of the wall on.
    let last = 1.5 + 0.5 * ((2.0 * r).ceil() - 1.0);
    let end = labels.of(Label::End, &wall).unwrap();
    let expected = |at| distance(at).map(|d| 1.0 - 0.5 * (1.0 - d / last).max(0.0));
    assert!(largest(&end, expected) < COARSE, "{}", largest(&end, expected));
    // The two are not one, and inside it is dark.
    assert!(largest(&mean, expected) > 2.0 * COARSE);
    let dark = |at: [usize; 3]| (at[2] > EDGE / 2 + 1 && at[2] < EDGE - margin).then_some(0.0);
    let within =
        |at: [usize; 3]| (at.iter().all(|c| (margin..EDGE - margin).contains(c))).then(|| dark(at)).flatten();
    assert!(largest(&end, within) < 1e-3);
    drop(labels);
    close(gpu);
}

#[test]
fn a_seed_gives_the_same_examples_whatever_was_made_before() {
    let gpu = open();
    let plan = |seed| Plan { edge: 16, samples: 1, seed, labels: Label::ALL.to_vec() };
    let sources = || vec![Source::Builtin("fruit".into()), Source::Solids];
    let mut maker = Maker::new(&gpu, plan(3), sources()).unwrap();
    let [first, second] = [0, 1].map(|i| maker.make(i).unwrap());
    let again = maker.make(1).unwrap();
    assert_eq!(
        (&again.opacity, &again.labels, &again.transfer),
        (&second.opacity, &second.labels, &second.transfer)
    );
    assert_eq!([&first.source, &second.source], ["fruit", "solids"]);
    let other = Maker::new(&gpu, plan(4), sources()).unwrap().make(1).unwrap();
    assert!(other.opacity != second.opacity);
    // The first is checked by the reference, the next ones are not.
    assert_eq!([first.errors.len(), second.errors.len()], [2, 0]);
    assert!(first.errors.iter().all(|e| e.rmse < 0.05 && e.count > 100), "{:?}", first.errors);
    // What is to be occluded is somewhere, and labels answer to it.
    for example in [&first, &second] {
        let [mean, end] = [0, 1].map(|k| example.labels[k].iter().map(|v| f64::from(*v)).sum::<f64>());
        assert!(mean < 65534.0 * 16.0_f64.powi(3) && end < mean, "{}", example.source);
        assert_eq!(example.transfer.len() % 6, 0);
    }
    for (wrong, what) in [(Plan { edge: 4, ..plan(1) }, "edge"), (Plan { samples: 0, ..plan(1) }, "samples")]
    {
        assert!(Maker::new(&gpu, wrong, sources()).err().unwrap().to_string().contains(what));
    }
    drop(maker);
    close(gpu);
}
