//! Files that are traps: pipes, devices, holes without end, a few bytes that promise or name too much, words that command a terminal.

use crate::volume_files::{
    Folder, Nifti, assert_refused, bytes_of, joined, meta_header, nrrd_header, nrrd_values,
};
use cao_model::values::Endian;
use std::error::Error as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

/// What reading a trap says, with the cause; it must say it in seconds.
#[track_caller]
fn said<T: Send + 'static>(
    what: &str,
    read: impl FnOnce() -> cao_formats::Result<T> + Send + 'static,
) -> Result<(), String> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let said = read().map(drop).map_err(|e| match e.source() {
            Some(cause) => format!("{e}: {cause}"),
            None => e.to_string(),
        });
        sender.send(said)
    });
    match receiver.recv_timeout(Duration::from_secs(20)) {
        Ok(said) => said,
        Err(_) => panic!("{what} blocks"),
    }
}

/// Everything that opens a file that a user or a file names.
fn uses(folder: &Folder, trap: &Path) -> Vec<(&'static str, Result<(), String>)> {
    let name = trap.to_str().unwrap().to_owned();
    let put = |header: &str, text: String| folder.put(header, text.as_bytes());
    let nhdr = put("a.nhdr", nrrd_header(&[]) + &format!("data file: {name}\n"));
    let ascii = put("t.nhdr", nrrd_header(&[("encoding", Some("ascii"))]) + &format!("data file: {name}\n"));
    let list = put("l.nhdr", nrrd_header(&[]) + &format!("data file: LIST\n{name}\n{name}\n"));
    let mhd = put("a.mhd", meta_header(&[("ElementDataFile", &name)]));
    let mhz = put("z.mhd", meta_header(&[("ElementDataFile", &name), ("CompressedData", "True")]));
    let scene = put("s.toml", format!("volume = \"builtin:engine:8\"\ntransfer = {name:?}\n"));
    let clip = put("c.toml", format!("volume = \"builtin:engine:8\"\n[[clip]]\nmesh = {name:?}\n"));
    let file = |path: PathBuf| move || cao_formats::read(&path).map(drop);
    let trap = trap.to_path_buf();
    let [own, raw, obj, toml, text] = [0; 5].map(|_| trap.clone());
    vec![
        ("volume", said("volume", file(own))),
        ("NRRD data", said("NRRD data", file(nhdr))),
        ("NRRD text", said("NRRD text", file(ascii))),
        ("NRRD list", said("NRRD list", file(list))),
        ("MetaImage data", said("MetaImage data", file(mhd))),
        ("MetaImage deflated", said("MetaImage deflated", file(mhz))),
        ("raw", said("raw", move || cao_formats::read_raw(&raw, [5, 3, 2], "i16", Endian::Little, [1.0; 3]))),
        ("mesh", said("mesh", move || cao_formats::obj::load(&obj))),
        ("transfer", said("transfer", move || cao_formats::transfer::read(&toml))),
        ("scene", said("scene", move || cao_formats::Scene::load(&text))),
        ("scene's transfer", said("scene's transfer", move || cao_formats::Scene::load(&scene))),
        ("scene's mesh", said("scene's mesh", move || cao_formats::Scene::load(&clip))),
    ]
}

#[test]
fn pipes_devices_sockets_and_folders_are_refused_by_name_without_waiting() {
    let folder = Folder::new();
    let at = |name: &str| folder.0.path().join(name);
    for name in ["pipe.nrrd", "pipe.img"] {
        assert!(std::process::Command::new("mkfifo").arg(at(name)).status().unwrap().success());
    }
    let _listening = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
    std::fs::create_dir(at("folder")).unwrap();
    std::os::unix::fs::symlink(at("pipe.nrrd"), at("link")).unwrap();
    for (trap, says) in [
        (at("pipe.nrrd"), "a pipe"),
        (at("link"), "a pipe"),
        (at("socket"), "a socket"),
        (at("folder"), "a folder"),
        ("/dev/zero".into(), "a device"),
        ("/dev/tty".into(), "a device"),
    ] {
        for (what, said) in uses(&folder, &trap) {
            let said = said.expect_err(what);
            // A volume may be a folder of slices.
            let expected = match (what, says) {
                ("volume", "a folder") => "none of them a slice".to_owned(),
                _ => format!("not a regular file but {says}"),
            };
            let name = trap.file_name().unwrap().to_str().unwrap();
            assert!(said.contains(&expected) && said.contains(name), "{what}: {said}");
        }
    }
    let mut nifti = Nifti::new(1, &nrrd_values(), Endian::Little);
    nifti.header[345] = b'i';
    let header = folder.put("pipe.hdr", &nifti.header);
    let message = said("pair", move || cao_formats::read(&header)).unwrap_err();
    assert!(message.contains("pipe.img") && message.contains("a pipe"), "{message}");
}

#[test]
fn holes_without_end_are_read_to_a_limit_that_the_refusal_states() {
    let folder = Folder::new();
    let trap = folder.0.path().join("holes");
    std::fs::File::create(&trap).unwrap().set_len(1 << 40).unwrap();
    for (what, said) in uses(&folder, &trap) {
        let expected: &[&str] = match what {
            "volume" => &["holes", "format", "not recognised"],
            // The 60 bytes that the header speaks of are there.
            "NRRD data" | "NRRD list" | "MetaImage data" => {
                assert_eq!(said, Ok(()), "{what}");
                continue;
            }
            "NRRD text" => &["holes", "value 0", "expected a number"],
            "MetaImage deflated" => &["holes", "damaged"],
            "raw" => &["holes", "1099511627776 bytes", "exactly 60 bytes"],
            "mesh" | "scene's mesh" => &["holes", "1099511627776 bytes", "at most 268435456"],
            _ => &["holes", "1099511627776 bytes", "at most 4194304"],
        };
        let said = said.expect_err(what);
        assert!(expected.iter().all(|part| said.contains(part)), "{what}: {said}");
    }
    let lines = nrrd_header(&[("line skip", Some("3"))]) + "data file: holes\n";
    let path = folder.put("lines.nhdr", lines.as_bytes());
    let message = said("line skip", move || cao_formats::read(&path)).unwrap_err();
    assert!(message.contains("line skip") && message.contains("16777216 bytes"), "{message}");
    for (name, start) in [("head.nrrd", "NRRD0004\n"), ("head.mha", "NDims = 3\n")] {
        let path = folder.put(name, start.as_bytes());
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(1 << 40).unwrap();
        let message = said(name, move || cao_formats::read(&path)).unwrap_err();
        assert!(message.contains(name) && message.contains("no end within 16777216 bytes"), "{message}");
    }
}

#[test]
fn a_hole_as_large_as_the_header_says_is_refused_where_it_does_not_fit_the_memory() {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap();
    let kilobytes = |name: &str| -> u64 {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.trim().trim_end_matches(" kB").parse().unwrap()
    };
    let slices = ((kilobytes("MemTotal:") + kilobytes("SwapTotal:") + (1 << 20)) << 10) >> 20;
    let folder = Folder::new();
    let sizes = format!("1024 1024 {slices}");
    let header = nrrd_header(&[("sizes", Some(&sizes)), ("type", Some("uint8"))]);
    let path = folder.put("a.nhdr", (header + "data file: holes\n").as_bytes());
    std::fs::File::create(folder.0.path().join("holes")).unwrap().set_len(slices << 20).unwrap();
    assert_refused(cao_formats::read(&path), &path, "data file", &["more memory than the system gives"]);
}

/// Most memory that this process ever had, in bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() << 10
}

#[test]
fn a_header_that_names_a_million_files_costs_no_memory() {
    const MOST: u64 = 1 << 30;
    let folder = Folder::new();
    let before = peak();
    let long = "d/".repeat(5000);
    for (sizes, says) in [
        // They do not make up the sizes, or do and are not there.
        ("5 3 2", "1000000 data files of dimension 2 do not make up the sizes [5, 3, 2]"),
        ("1 1 1000000", "File name too long"),
    ] {
        let header =
            nrrd_header(&[("sizes", Some(sizes))]) + &format!("data file: {long}%d.raw 1 1000000 1\n");
        let path = folder.put("a.nhdr", header.as_bytes());
        assert_refused(cao_formats::read(&path), &path, "data file", &[says]);
        let data = format!("{long}%d.raw 1 1000000 1");
        let header = meta_header(&[("DimSize", sizes), ("ElementDataFile", &data)]);
        let path = folder.put("a.mhd", header.as_bytes());
        assert_refused(cao_formats::read(&path), &path, "ElementDataFile", &[says]);
    }
    let list = nrrd_header(&[]) + "data file: LIST\n" + &"a\n".repeat(3_000_000);
    let path = folder.put("a.nhdr", list.as_bytes());
    assert_refused(cao_formats::read(&path), &path, "header", &["more than 1048576 names"]);
    assert!(peak() - before < MOST, "{} bytes", peak() - before);
}

#[test]
fn messages_are_short_and_command_no_terminal_whatever_the_file_holds() {
    let folder = Folder::new();
    let evil = "\u{1b}]0;pwned\u{7}\u{1b}[2J\r\u{202e}";
    let long = evil.repeat(20_000);
    let plain = "x".repeat(1_000_000);
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let mut said = Vec::new();
    for word in [evil, &long, &plain] {
        let names = [
            "type",
            "endian",
            "encoding",
            "sizes",
            "spacings",
            "space",
            "space origin",
            "kinds",
            "data file",
        ];
        for field in names {
            let header = nrrd_header(&[(field, Some(word)), ("dimension", Some("3"))]);
            let path = folder.put("evil.nrrd", &joined(&(header + "\n"), &data));
            said.extend(cao_formats::read(&path).err().map(|e| e.to_string()));
        }
        for key in
            ["ObjectType", "NDims", "DimSize", "ElementType", "Offset", "BinaryData", "ElementDataFile"]
        {
            let path = folder.put("evil.mha", &joined(&meta_header(&[(key, word)]), &data));
            said.push(cao_formats::read(&path).unwrap_err().to_string());
        }
        let path = folder.put("evil.nrrd", joined(&format!("NRRD0004\n{word}: 3\n\n"), &[]).as_slice());
        said.push(cao_formats::read(&path).unwrap_err().to_string());
        let escaped =
            |c: char| if c.is_alphanumeric() { c.to_string() } else { format!("\\u{:04x}", u32::from(c)) };
        let quoted = format!("\"{}\"", word.chars().map(escaped).collect::<String>());
        for key in ["opacity", "colour", "reference_mm", "nonsense", &quoted] {
            let path = folder.put("evil.toml", format!("{key} = {quoted}\n").as_bytes());
            said.push(cao_formats::transfer::read(&path).unwrap_err().to_string());
        }
        for text in [
            format!("volume = {quoted}"),
            format!("volume = [{quoted}]"),
            format!("volume = \"builtin:engine:8\"\ntransfer = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n{quoted} = 1"),
            format!("volume = \"builtin:engine:8\"\n[[clip]]\nshape = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[[clip]]\nmesh = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[[clip]]\nshape = \"box\"\nmode = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[occlusion]\nmethod = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[occlusion]\nrays = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[occlusion]\nscope = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[occlusion]\nquadrature = {quoted}"),
            format!("volume = \"builtin:engine:8\"\n[image]\nbackground = {quoted}"),
            format!("volume = {{ file = {quoted}, nan = {quoted} }}"),
        ] {
            let path = folder.put("evil.toml", text.as_bytes());
            said.push(cao_formats::Scene::load(&path).unwrap_err().to_string());
        }
        for text in [format!("v {word}\n"), format!("v 0 0 0\nf {word}\n")] {
            let path = folder.put("evil.obj", text.as_bytes());
            said.push(cao_formats::obj::load(&path).unwrap_err().to_string());
        }
    }
    // A name that comes with an archive, say.
    let path = folder.put(&format!("evil{evil}"), b"not a volume");
    said.push(cao_formats::read(&path).unwrap_err().to_string());
    said.push(cao_formats::obj::load(&path).unwrap_err().to_string());
    assert!(said.len() > 90, "{}", said.len());
    for text in said {
        let turned = text.contains('\u{202e}');
        assert!(!text.contains(char::is_control) && !turned, "{text:?}");
        assert!(text.len() < 3000, "{} bytes: {text}", text.len());
        assert!(text.contains("evil"), "the file is not named: {text}");
    }
}
