//! docs/gallery.md: its pictures exist and are small, its commands make them, and run.

use super::support::Folder;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Most bytes of a picture, and of all.
const PICTURE: u64 = 300_000;
const ALL: u64 = 2_500_000;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// The commands of the page's blocks, in words.
fn commands(page: &str) -> Vec<Vec<String>> {
    let blocks = page.split("```sh\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let lines =
        blocks.flat_map(|block| block.replace("\\\n", " ").lines().map(str::to_owned).collect::<Vec<_>>());
    lines.map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
}

/// The pictures that a page in docs/ shows, from the repository's root.
fn shown(page: &str) -> BTreeSet<String> {
    let links = page.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
    links.filter(|link| link.ends_with(".png")).map(|link| format!("docs/{link}")).collect()
}

#[test]
fn the_gallery_shows_what_is_there_and_its_commands_make_it() {
    let page = fs::read_to_string(root().join("docs/gallery.md")).unwrap();
    let (mut there, mut bytes) = (BTreeSet::new(), 0);
    for entry in fs::read_dir(root().join("docs/gallery")).unwrap().map(Result::unwrap) {
        let size = entry.metadata().unwrap().len();
        let name = format!("docs/gallery/{}", entry.file_name().to_str().unwrap());
        if name.ends_with(".png") {
            assert!(size <= PICTURE, "{name}: {size} bytes");
            there.insert(name);
        } else {
            let file = entry.file_name().into_string().unwrap();
            let implant = fs::read_to_string(root().join("docs/gallery/implant.toml")).unwrap();
            assert!(page.contains(&name) || implant.contains(&file), "{name} is not used");
        }
        bytes += size;
    }
    assert!(bytes <= ALL, "{bytes} bytes");
    let made: Vec<_> = commands(&page)
        .into_iter()
        .map(|words| words.last().unwrap().split(',').next().unwrap().to_owned())
        .collect();
    assert_eq!(made.iter().cloned().collect::<BTreeSet<_>>(), there);
    assert_eq!(made.len(), there.len(), "two commands write one picture");
    assert_eq!(shown(&page), there);
}

/// Each as it stands, but small, into a folder of its own, and of a built-in volume; scenes are of one.
#[test]
fn the_commands_of_the_gallery_run() {
    let folder = Folder::with_device();
    let page = fs::read_to_string(root().join("docs/gallery.md")).unwrap();
    for words in commands(&page) {
        assert_eq!(words[..2], ["cao", "render"]);
        let mut small = words[1..].to_vec();
        let replaced = if small[1].starts_with("builtin:") {
            format!("{}:32", small[1].rsplit_once(':').unwrap().0)
        } else if small[1].ends_with(".toml") {
            let scene = fs::read_to_string(root().join(&small[1])).unwrap();
            // Its volume is small here, or built in instead; its meshes lie beside it.
            let small = scene
                .replace(":128\"", ":32\"")
                .replace("../../data/head", "builtin:skeleton:32")
                .replace("file = \"", &format!("file = \"{}/docs/gallery/", root().display()));
            assert!(small.contains("builtin:") && small != scene, "{words:?}");
            folder.put("scene.toml", small);
            "scene.toml".to_owned()
        } else {
            assert!(small[1].starts_with("data/"), "{words:?}");
            "builtin:skeleton:32".to_owned()
        };
        small[1] = replaced;
        for i in 2..small.len() {
            match small[i - 1].as_str() {
                "--size" => small[i] = "16x16".to_owned(),
                "--samples" => small[i] = "2".to_owned(),
                "-o" => small[i] = "picture.png".to_owned(),
                "--eyes" => small[i] = "left.png,right.png".to_owned(),
                _ if root().join(&small[i]).is_file() => {
                    small[i] = root().join(&small[i]).to_str().unwrap().to_owned();
                }
                _ => {}
            }
        }
        folder.ok(&small.join(" "));
    }
}
