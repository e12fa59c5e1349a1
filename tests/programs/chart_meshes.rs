//! `cao chart --meshes`: what is written, and that its numbers are of what they are said to be of.

use crate::support::Folder;
use cao_measure::chart::meshes::{ROWS, SOUGHT};
use cao_model::scenes::SCENES;
use std::collections::BTreeMap;

/// The cells of one line; names of methods have commas and stand in quotes.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            c => cells.last_mut().unwrap().push(c),
        }
    }
    cells
}

fn records(text: &str) -> Vec<BTreeMap<String, String>> {
    let mut lines = text.lines().map(cells);
    let names = lines.next().unwrap();
    let record = |row: Vec<String>| {
        assert_eq!(row.len(), names.len(), "{row:?}");
        names.iter().cloned().zip(row).collect()
    };
    lines.map(record).collect()
}

/// A first look: every row of every scene, the reference without error and a single ray worse than many; verdicts and errors by δ; figures.
#[test]
fn a_first_look_has_every_scene_row_verdict_and_figure() {
    let folder = Folder::with_device();
    let printed = folder.ok("chart --meshes --quick --runs 1 -o out");
    let read = |name: &str| std::fs::read_to_string(folder.path(&format!("out/{name}"))).unwrap();
    let runs = records(&read("meshes.csv"));
    for scene in SCENES {
        let own: Vec<_> = runs.iter().filter(|run| run["scene"] == scene.name).collect();
        assert_eq!(own.len(), ROWS.len(), "{}", scene.name);
        let number = |of: usize, what: &str| -> f64 {
            assert_eq!(own[of]["method"], ROWS[of].name(64), "{}", scene.name);
            own[of][what].parse().unwrap()
        };
        let errors: Vec<f64> = (0..ROWS.len()).map(|n| number(n, "error")).collect();
        assert_eq!((errors[0], number(0, "rmse")), (0.0, 0.0), "{}", scene.name);
        // Of 64 rays half, 25, 4 and 1.
        assert!(errors[1..5].is_sorted() && errors[1] > 0.0, "{}: {errors:?}", scene.name);
        assert!(errors[5..].iter().all(|error| *error > 0.0 && error.is_finite()), "{errors:?}");
        // Volumes are the same, gathered or drawn.
        let rmse: Vec<f64> = (5..8).map(|n| number(n, "rmse")).collect();
        assert!(rmse.iter().all(|other| (other - rmse[0]).abs() < SAME), "{}: {rmse:?}", scene.name);
        assert!(own.iter().all(|run| run["ms"].parse::<f64>().unwrap() > 0.0), "{}", scene.name);
    }
    assert_eq!(records(&read("fits.csv")).len(), SCENES.len() * 2 * SOUGHT.len());
    let verdicts = records(&read("verdicts.csv"));
    assert_eq!(verdicts.len(), 5);
    for verdict in &verdicts {
        assert!(printed.contains(&verdict["claim"]), "{verdict:?} is not in {printed}");
        let holds = verdict["where"].split_whitespace().count();
        assert_eq!(verdict["holds"], holds.to_string());
        assert_eq!(verdict["reached"], (holds >= 5).to_string());
    }
    // As read from the paper's figure: AOV loses to Volumetric AO in Suburb alone; one ray is the worst of all in Belgium alone.
    let theirs: Vec<&str> = verdicts.iter().map(|verdict| verdict["printed"].as_str()).collect();
    assert_eq!(theirs, ["6", "1", "7", "7", "4"]);
    let page = read("meshes.html");
    for said in ["Secret War, 1445620", "0.34", "642571", "Fig. 11", "Convergence"] {
        assert!(page.contains(said), "{said}");
    }
    let picture = image::open(folder.path("out/figure-11.png")).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (4 * 48, 7 * 27));
    assert!(read("figure-10.svg").contains("Sponza, as printed"));
}

/// Gathered and drawn volumes sum the same values in another order and cover pixels at edges of volumes by other roundings, where they are as good as nothing.
const SAME: f64 = 1e-3;
