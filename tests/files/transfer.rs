//! Transfer functions: interpolation, the exact maximum, presets, the file format and its refusals.

use cao_formats::Error;
use cao_model::transfer::{MAX_POINTS, PRESETS, TransferFunction};
use proptest::prelude::*;

fn opacity(points: &[[f32; 2]]) -> TransferFunction {
    TransferFunction::new(points.to_vec(), vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

fn refusal(text: &str) -> String {
    cao_formats::transfer::from_toml(text).unwrap_err().to_string()
}

#[test]
fn opacity_is_linear_between_points_and_constant_beyond() {
    let tf = opacity(&[[-100.0, 0.2], [0.0, 0.2], [100.0, 1.0]]);
    for (value, expected) in [(-1e9, 0.2), (-100.0, 0.2), (-50.0, 0.2), (50.0, 0.6), (100.0, 1.0), (1e9, 1.0)]
    {
        assert!((tf.opacity_at(value) - expected).abs() < 1e-6, "{value}");
    }
    assert_eq!(opacity(&[[7.0, 0.5]]).opacity_at(-3.0), 0.5);
}

#[test]
fn two_equal_values_make_a_step_that_belongs_to_the_second() {
    let tf = opacity(&[[0.0, 0.0], [10.0, 0.0], [10.0, 0.8], [20.0, 0.8]]);
    assert_eq!(tf.opacity_at(9.999), 0.0);
    assert_eq!(tf.opacity_at(10.0), 0.8);
    let down = opacity(&[[0.0, 0.5], [10.0, 0.5], [10.0, 0.0]]);
    assert_eq!(down.opacity_at(10.0), 0.0);
    assert_eq!(down.max_opacity_in(10.0, 20.0), 0.0, "the lower side is not reached from above");
    assert_eq!(down.max_opacity_in(9.0, 10.0), 0.5);
}

#[test]
fn colours_are_srgb_in_the_file_and_linear_inside() {
    let tf = cao_formats::transfer::from_toml(
        "opacity = [[0, 0], [1, 1]]\ncolour = [[0, \"#000000\"], [10, \"#ffffff\"], [20, [0.5, 1, 0]]]",
    )
    .unwrap();
    // Half-way between black and white in light, not in sRGB numbers.
    assert_eq!(tf.colour_at(5.0), [0.5; 3]);
    // sRGB 0.5 is 0.21404 of the light.
    let [r, g, b] = tf.colour_at(30.0);
    assert!((r - 0.214_041).abs() < 1e-6 && g == 1.0 && b == 0.0);
    for single in ["\"#ff8000\"", "[1, 0.5019607843137255, 0]"] {
        let tf = cao_formats::transfer::from_toml(&format!("opacity = [[0, 1]]\ncolor = {single}")).unwrap();
        let [r, g, b] = tf.colour_at(123.0);
        assert!(r == 1.0 && (g - 0.215_860_5).abs() < 1e-6 && b == 0.0);
    }
}

#[test]
fn reference_length_is_the_smallest_spacing_unless_given() {
    let with = "reference_mm = 2.5\nopacity = [[0, 1]]\ncolour = \"#ffffff\"";
    assert_eq!(cao_formats::transfer::from_toml(with).unwrap().reference_mm(0.7), 2.5);
    assert_eq!(opacity(&[[0.0, 1.0]]).reference_mm(0.75), 0.75);
}

#[test]
fn impossible_files_are_refused_by_key() {
    let good = "opacity = [[0, 0.5]]\ncolour = \"#ffffff\"\n";
    assert!(cao_formats::transfer::from_toml(good).is_ok());
    let points: Vec<String> = (0..=MAX_POINTS).map(|i| format!("[{i}, 0.1]")).collect();
    let many = format!("opacity = [{}]\ncolour = \"#ffffff\"", points.join(","));
    for (text, expected) in [
        ("colour = \"#ffffff\"", "missing field `opacity`"),
        ("opacity = [[0, 1]]", "missing field `colour`"),
        ("opacity = []\ncolour = \"#ffffff\"", "opacity: has no points"),
        ("opacity = 1\ncolour = \"#ffffff\"", "opacity: 1: expected a list of [value, opacity]"),
        (
            "opacity = [[0, 0.5, 1]]\ncolour = \"#ffffff\"",
            "opacity[0]: [0, 0.5, 1]: expected [value, opacity]",
        ),
        ("opacity = [[0, \"a\"]]\ncolour = \"#ffffff\"", "opacity[0]: [0, \"a\"]: expected [value, opacity]"),
        (
            "opacity = [[0, 0], [1, 1.5]]\ncolour = \"#ffffff\"",
            "opacity[1]: 1.5: expected a number from 0 to 1",
        ),
        ("opacity = [[0, nan]]\ncolour = \"#ffffff\"", "opacity[0]: NaN: expected a number from 0 to 1"),
        ("opacity = [[inf, 0]]\ncolour = \"#ffffff\"", "opacity[0]: value inf: expected a finite number"),
        ("opacity = [[1e300, 0]]\ncolour = \"#ffffff\"", "opacity[0]: value inf: expected a finite number"),
        (
            "opacity = [[5, 0], [4, 1]]\ncolour = \"#ffffff\"",
            "opacity[1]: value 4 after 5: expected ascending",
        ),
        (
            "opacity = [[5, 0], [5, 1], [5, 0]]\ncolour = \"#ffffff\"",
            "opacity[2]: value 5 for the third time",
        ),
        ("opacity = [[0, 1]]\ncolour = \"white\"", "colour: \"white\": expected \"#rrggbb\""),
        ("opacity = [[0, 1]]\ncolour = \"#+12345\"", "colour: \"#+12345\": expected \"#rrggbb\""),
        ("opacity = [[0, 1]]\ncolour = [255, 0, 0]", "colour: [255, 0, 0]: expected"),
        ("opacity = [[0, 1]]\ncolour = [[0, [1, 2, 0]]]", "colour[0]: [1, 2, 0]: expected"),
        (
            "opacity = [[0, 1]]\ncolour = [[0, 0.5, 0.5, 0.5]]",
            "colour[0]: [0, 0.5, 0.5, 0.5]: expected [value, colour]",
        ),
        ("opacity = [[0, 1]]\ncolour = []", "colour: has no points"),
        ("opacities = [[0, 1]]\ncolour = \"#ffffff\"", "unknown field `opacities`"),
        (
            "reference_mm = 0\nopacity = [[0, 1]]\ncolour = \"#ffffff\"",
            "reference_mm: 0: expected a length > 0 mm",
        ),
        (
            "reference_mm = \"1\"\nopacity = [[0, 1]]\ncolour = \"#ffffff\"",
            "reference_mm: \"1\": expected a length > 0 mm",
        ),
        ("opacity = [", "transfer function: TOML parse error"),
        (&many, "opacity: has 65 points: expected at most 64"),
    ] {
        let found = refusal(text);
        assert!(found.contains(expected), "{text}\n gave: {found}\n not: {expected}");
    }
}

#[test]
fn fields_changed_by_hand_are_checked_the_same_way() {
    let mut tf = opacity(&[[0.0, 0.5]]);
    tf.check().unwrap();
    tf.colour[0][2] = -0.1;
    assert!(tf.check().unwrap_err().to_string().contains("colour[0]: -0.1"));
}

#[test]
fn every_preset_fits_every_range() {
    for (name, _) in PRESETS {
        for range in [(-1024.0, 3071.0), (0.0, 255.0), (0.0, 0.0), (255.0, 255.0), (-3.0, -3.0), (1e-3, 2e-3)]
        {
            let tf = TransferFunction::preset(name, range).unwrap();
            assert_eq!(tf.opacity_at(range.0.min(0.0) as f32 - 1e4), 0.0, "{name} {range:?}");
            // Something is visible at the upper end, also of a range that is one positive value.
            if range.1 > 0.0 {
                assert!(tf.opacity_at(range.1 as f32) > 0.5, "{name} {range:?}");
            }
        }
        for range in [(f64::NAN, 1.0), (0.0, f64::INFINITY), (2.0, 1.0)] {
            assert!(TransferFunction::preset(name, range).is_err(), "{name} {range:?}");
        }
    }
    assert_eq!(TransferFunction::preset("paper", (0.0, 255.0)).unwrap().colour.len(), 1);
}

/// Data that are one value to 32 bits are shown as such; data that no preset can show are spoken of, not points that nobody wrote.
#[test]
fn presets_work_on_data_whose_range_defeats_them_or_speak_of_the_data() {
    let next = |x: f32| f64::from(x.next_up());
    for (name, _) in PRESETS {
        for range in [
            (1.0, 1.0 + 1e-12),
            (1.0, next(1.0)),
            (1e6, next(1e6_f32.next_up())),
            (1e30, next(1e30)),
            (4096.0, 4096.001),
            (0.1, f64::from(0.1f32)),
            (8e37, 8.4e37),
        ] {
            let tf =
                TransferFunction::preset(name, range).unwrap_or_else(|e| panic!("{name} {range:?}: {e}"));
            assert!(tf.opacity.is_sorted_by(|a, b| a[0] < b[0]), "{name} {range:?}");
            for value in [range.0, range.1] {
                let seen = tf.opacity_at(value as f32) > 0.5;
                // Within a range that 32 bits do not resolve, everything is seen alike.
                assert!(seen || range.0 == 8e37 || value < range.1, "{name} {range:?} {value}");
            }
        }
        let (max, huge) = (f64::from(f32::MAX), f64::MAX);
        for range in
            [(0.0, max), (-max, 5.0), (-max, max), (0.0, huge), (-huge, huge), (0.0, 1e-40), (-1e-300, 0.0)]
        {
            let error = TransferFunction::preset(name, range).unwrap_err().to_string();
            assert!(error.contains("the data run from") && error.contains(name), "{error}");
            assert!(!error.contains("opacity[") && !error.contains("colour["), "{error}");
            if range.1 > 1.0 {
                assert!(
                    error.contains("--nan VALUE|transparent") && error.contains("--transfer FILE"),
                    "{error}"
                );
            }
        }
    }
}

#[test]
fn values_without_opacity_are_found_nearest_first() {
    assert_eq!(opacity(&[[1.0, 0.0], [2.0, 1.0]]).transparent_near(-5.0)[0], -5.0);
    assert_eq!(
        opacity(&[[1.0, 0.5], [2.0, 0.0], [3.0, 0.0]]).transparent_near(0.0)[0],
        2.0f32.next_down().max(2.0)
    );
    assert!(opacity(&[[1.0, 0.5]]).transparent_near(0.0).is_empty());
    // The step belongs to the second point.
    assert_eq!(opacity(&[[1.0, 0.0], [1.0, 0.5]]).transparent_near(7.0), [1.0f32.next_down(); 2]);
    assert!(opacity(&[[0.0, 0.5], [1.0, 0.0], [1.0, 0.5]]).transparent_near(7.0).is_empty());
}

#[test]
fn ct_presets_keep_hounsfield_units_and_map_other_data() {
    let hounsfield = TransferFunction::preset("ct-bone", (-1024.0, 3071.0)).unwrap();
    assert_eq!(hounsfield.opacity_at(100.0), 0.0, "soft tissue");
    assert!(hounsfield.opacity_at(700.0) > 0.8, "bone");
    assert_eq!(TransferFunction::preset("auto", (-1024.0, 3071.0)).unwrap(), hounsfield);
    let paper = TransferFunction::preset("paper", (0.0, 255.0)).unwrap();
    assert_eq!(TransferFunction::preset("auto", (0.0, 255.0)).unwrap(), paper);
    // -1000…1500 HU over 0…255: 300 HU is 132.6.
    let bytes = TransferFunction::preset("ct-bone", (0.0, 255.0)).unwrap();
    assert!((bytes.opacity_at(132.6) - hounsfield.opacity_at(300.0)).abs() < 1e-3);
}

#[test]
fn load_takes_presets_and_files_and_names_what_is_wrong() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mine.toml");
    let spec = path.to_str().unwrap();
    assert!(cao_formats::transfer::load("mr", (0.0, 1.0)).is_ok());
    let found = cao_formats::transfer::load("ct-bones", (0.0, 1.0)).unwrap_err().to_string();
    assert!(found.contains("\"ct-bones\"") && found.contains("auto, ct-bone, ct-soft, mr, paper"), "{found}");
    std::fs::write(&path, cao_formats::transfer::to_toml(&opacity(&[[0.0, 0.25]]))).unwrap();
    assert_eq!(cao_formats::transfer::load(spec, (0.0, 1.0)).unwrap().opacity_at(0.0), 0.25);
    std::fs::write(&path, "opacity = [[0, 2]]\ncolour = \"#ffffff\"").unwrap();
    let found = cao_formats::transfer::load(spec, (0.0, 1.0)).unwrap_err();
    assert!(matches!(&found, Error::File { field, .. } if field == "opacity[0]"), "{found}");
    assert!(found.to_string().contains("mine.toml"));
    let found = cao_formats::transfer::load(dir.path().to_str().unwrap(), (0.0, 1.0)).unwrap_err();
    assert!(matches!(found, Error::Io { .. }), "a folder is not a file: {found}");
}

fn any_transfer() -> impl Strategy<Value = TransferFunction> {
    let points = prop::collection::vec((-20i32..20, 0f32..=1.0), 1..12);
    let colours = prop::collection::vec((-1e6f32..1e6, 0f32..=1.0, 0f32..=1.0, 0f32..=1.0), 1..8);
    (points, colours, prop::option::of(1e-3f32..1e3)).prop_map(|(mut points, mut colours, reference)| {
        points.sort_by_key(|p| p.0);
        colours.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Steps are likely with so few values; three of a kind are not allowed.
        let mut opacity: Vec<[f32; 2]> = Vec::new();
        for (value, a) in points {
            let value = value as f32;
            if opacity.len() < 2 || opacity[opacity.len() - 2][0] != value {
                opacity.push([value, a]);
            }
        }
        TransferFunction::new(opacity, colours.iter().map(|c| [c.0, c.1, c.2, c.3]).collect(), reference)
            .unwrap()
    })
}

proptest! {
    #[test]
    fn text_reads_back_bit_for_bit(tf in any_transfer()) {
        prop_assert_eq!(cao_formats::transfer::from_toml(&cao_formats::transfer::to_toml(&tf)).unwrap(), tf);
    }

    /// Never below any value inside, and attained: at an end, at a point, or just below a step.
    #[test]
    fn largest_opacity_is_exact(tf in any_transfer(), a in -25f32..25.0, b in -25f32..25.0) {
        let (low, high) = (a.min(b), a.max(b));
        let most = tf.max_opacity_in(low, high);
        let mut candidates: Vec<f32> = (0..=1000).map(|i| (low + (high - low) * i as f32 / 1000.0).min(high)).collect();
        for [value, _] in &tf.opacity {
            candidates.extend([value.next_down(), *value].into_iter().filter(|v| (low..=high).contains(v)));
        }
        let found = candidates.iter().map(|v| tf.opacity_at(*v)).fold(0.0, f32::max);
        prop_assert!(found <= most);
        // One float below a step the line is within a few roundings of its upper point.
        prop_assert!(most - found < 1e-5, "{} {}", most, found);
    }

    #[test]
    fn opacity_and_colour_stay_between_zero_and_one(tf in any_transfer(), v in prop::num::f32::ANY) {
        prop_assert!((0.0..=1.0).contains(&tf.opacity_at(v)));
        prop_assert!(tf.colour_at(v).iter().all(|c| (0.0..=1.0).contains(c)));
    }
}
