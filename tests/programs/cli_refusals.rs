//! What the program refuses: with which exit code, in which words, and leaving nothing behind. No device is needed, which
//! shows that refusals come before any long work.

use crate::chart::PEERS;
use crate::support::{Folder, cube_obj, nrrd};
use std::io::Write;

/// A file that cannot be used: exit code 1.
const FAILURE: i32 = 1;
/// A command line that cannot be understood or contradicts itself: exit code 2.
const USAGE: i32 = 2;

/// Runs the program, which must refuse with `code` in words that contain all of `parts`, print no answer and leave the
/// folder as it was.
fn refused(folder: &Folder, arguments: &str, code: i32, parts: &[&str]) {
    let before = folder.list();
    let run = folder.run(arguments);
    assert_eq!(run.code, Some(code), "{}: {}", run.line, run.err);
    assert_eq!(run.out, "", "{}: an answer beside a refusal", run.line);
    for part in parts {
        assert!(run.err.contains(part), "{}: {part:?} is not in {:?}", run.line, run.err);
    }
    if code == FAILURE {
        assert!(
            run.err.starts_with("cao: ") && run.err.trim_end().lines().count() == 1,
            "{}: not one line: {:?}",
            run.line,
            run.err
        );
    }
    assert_eq!(folder.list(), before, "{}: left something behind", run.line);
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut stream = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    stream.write_all(data).unwrap();
    stream.finish().unwrap()
}

/// NIfTI-1 header of 4 × 4 × 4 voxels of type `code` with `bits` each, its values expected at byte 352.
fn nifti(code: i16, bits: i16, data: &[u8]) -> Vec<u8> {
    let mut header = vec![0; 352];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    for (i, n) in [3i16, 4, 4, 4, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &n.to_le_bytes());
        put(76 + 4 * i, &1f32.to_le_bytes());
    }
    put(70, &code.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(108, &352f32.to_le_bytes());
    put(344, b"n+1\0");
    [header, data.to_vec()].concat()
}

#[test]
fn malformed_volumes_are_refused_by_file_and_field_whatever_the_command() {
    let folder = Folder::without_device();
    let ones = "1 1 1";
    let with_nan: Vec<u8> =
        (0..64).flat_map(|i| if i == 21 { f32::NAN } else { 0.5 }.to_le_bytes()).collect();
    let whole = nrrd("uchar", "4 4 4", ones, &[0; 64]);
    let compressed = gzip(&[7; 64]);
    let gz = |data: &[u8]| {
        let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nspacings: 1 1 1\nencoding: gzip\n\n";
        [header.as_bytes(), data].concat()
    };
    let meta = "ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\n";
    let bad: &[(&str, Vec<u8>, &[&str])] = &[
        ("short.nrrd", nrrd("uchar", "4 4 4", ones, &[0; 10]), &["data", "10 bytes", "expected exactly 64 bytes"]),
        ("cut.nrrd", whole[..40].to_vec(), &[]),
        ("huge.nrrd", nrrd("uchar", "4000000000 4000000000 4000000000", ones, &[0; 64]), &["sizes", "memory"]),
        ("vast.nrrd", nrrd("double", "100000 100000 1000", ones, &[0; 64]), &["data", "64 bytes", "expected"]),
        ("none.nrrd", nrrd("uchar", "4 0 4", ones, &[]), &["sizes", "expected"]),
        ("flat.nrrd", nrrd("uchar", "-4 4 4", ones, &[0; 64]), &["sizes", "expected"]),
        ("nan.nrrd", nrrd("float", "4 4 4", ones, &with_nan), &["data", "NaN", "voxel (1, 1, 1)", "finite", "--nan VALUE|transparent"]),
        ("type.nrrd", nrrd("quadruple", "4 4 4", ones, &[0; 64]), &["type", "quadruple", "expected"]),
        ("far.nrrd", nrrd("uchar", "4 4 4", "1 nan 1", &[0; 64]), &["spacings", "expected"]),
        (
            "lost.nhdr",
            b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nspacings: 1 1 1\nencoding: raw\ndata file: gone.raw\n"
                .to_vec(),
            &["data file", "gone.raw"],
        ),
        ("torn.nrrd", gz(&compressed[..compressed.len() - 9]), &["data", "truncated", "expected 64 bytes"]),
        ("few.nrrd", gz(&gzip(&[7; 63])), &["data", "63 bytes", "expected exactly 64 bytes"]),
        ("short.nii", nifti(2, 8, &[0; 63]), &["data", "63 bytes", "expected exactly 64 bytes"]),
        ("type.nii", nifti(1792, 128, &[0; 1024]), &["datatype", "1792", "expected"]),
        ("cut.nii.gz", gzip(&nifti(2, 8, &[0; 64])[..200]), &["expected"]),
        ("short.mha", format!("{meta}ElementDataFile = LOCAL\n0123").into_bytes(), &["4 bytes", "64 bytes"]),
        ("lost.mhd", format!("{meta}ElementDataFile = gone.raw\n").into_bytes(), &["ElementDataFile", "gone.raw"]),
        ("words.txt", b"not a volume".to_vec(), &["format", "expected NRRD"]),
        ("empty.nrrd", Vec::new(), &["expected"]),
    ];
    for (name, content, parts) in bad {
        folder.put(name, content);
        let parts = [&[*name][..], parts].concat();
        refused(&folder, &format!("info {name}"), FAILURE, &parts);
    }
    // The other commands read in the same way; a few of each kind show it.
    for name in ["short.nrrd", "nan.nrrd", "lost.nhdr", "cut.nii.gz", "lost.mhd"] {
        refused(&folder, &format!("occlusion {name} -o ao.nrrd --mask-out vm.nrrd"), FAILURE, &[name]);
        refused(&folder, &format!("render {name} -o stereo.png"), FAILURE, &[name]);
        refused(&folder, &format!("verify {name} --json"), FAILURE, &[name]);
    }
    refused(&folder, "info gone.nrrd", FAILURE, &["gone.nrrd", "No such file"]);
    std::fs::create_dir(folder.path("scan")).unwrap();
    refused(&folder, "info scan", FAILURE, &["scan", "0 files", "looked for DICOM", "TIFF"]);
    refused(&folder, "info scan --series 1", FAILURE, &["scan", "series", "no DICOM"]);
    refused(&folder, "info gone.dcm --series 1", FAILURE, &["gone.dcm", "No such file"]);
    folder.put("scene.toml", "volume = \"short.nrrd\"");
    refused(
        &folder,
        "render scene.toml --series 1 -o a.png",
        USAGE,
        &["--series: the scene scene.toml says"],
    );
    refused(
        &folder,
        "info builtin:engine:8 --series 1",
        USAGE,
        &["--series: builtin:engine:8 has no DICOM series"],
    );
    refused(&folder, "info ct.raw --series 1 --dims 4,4,4 --type u8", USAGE, &["--series", "--dims"]);
    refused(&folder, "info builtin:nothing:8 --json", FAILURE, &["nothing", "expected one of engine"]);
    refused(&folder, "occlusion builtin:engine:0 -o ao.nrrd", FAILURE, &["builtin:engine:0", "at least 1"]);
    refused(&folder, "occlusion builtin:engine:99999 -o ao.nrrd", FAILURE, &["99999", "the limit is"]);
}

#[test]
fn raw_values_that_their_description_does_not_fit_are_refused_by_file_and_field() {
    let folder = Folder::without_device();
    folder.put("ct.raw", [0; 64]);
    for (flags, parts) in [
        ("--dims 4,4,5 --type uint8", &["ct.raw", "data", "64 bytes", "expected exactly 80 bytes"][..]),
        ("--dims 4,4,4 --type int16", &["ct.raw", "expected exactly 128 bytes"]),
        ("--dims 4,0,4 --type uint8", &["ct.raw", "dims", "at least 1"]),
        ("--dims 4000000000,4000000000,4000000000 --type uint8", &["ct.raw", "dims", "memory"]),
        ("--dims 4,4,4 --type int12", &["ct.raw", "type", "int12", "expected uint8"]),
        ("--dims 4,4,4 --type uint8 --spacing 1,0,1", &["ct.raw", "spacing", "expected a positive"]),
        ("--dims 4,4,4 --type uint8 --spacing -1,1,1", &["ct.raw", "spacing", "expected a positive"]),
        ("--dims 4,4,4 --type uint8 --spacing nan,1,1", &["ct.raw", "spacing", "expected a positive"]),
    ] {
        refused(&folder, &format!("occlusion ct.raw {flags} -o ao.nrrd"), FAILURE, parts);
        refused(&folder, &format!("info ct.raw {flags}"), FAILURE, parts);
    }
    refused(&folder, "info gone.raw --dims 4,4,4 --type u8", FAILURE, &["gone.raw", "No such file"]);
    for (flags, parts) in [
        ("--dims 4,4 --type uint8", &["--dims", "three whole numbers"][..]),
        ("--dims 4,4,-4 --type uint8", &["--dims", "three whole numbers"]),
        ("--dims 4,4,4", &["--type"]),
        ("--type uint8", &["--dims"]),
        ("--spacing 1,1,1", &["--dims"]),
        ("--dims 4,4,4 --type uint8 --spacing 1,1", &["--spacing", "three numbers"]),
        ("--dims 4,4,4 --type uint8 --endian middle", &["--endian", "little or big"]),
    ] {
        refused(&folder, &format!("info ct.raw {flags}"), USAGE, parts);
    }
    // What says its own dimensions cannot have others.
    refused(
        &folder,
        "info builtin:engine:4 --dims 4,4,4 --type uint8",
        USAGE,
        &["--dims", "builtin:engine:4"],
    );
    refused(&folder, "render s.toml --dims 4,4,4 --type uint8 -o s.png", USAGE, &["--dims", "s.toml"]);
}

#[test]
fn scenes_and_transfer_functions_are_refused_by_file_and_key() {
    let folder = Folder::without_device();
    let volume = "volume = \"builtin:engine:8\"\n";
    folder.put("open.obj", cube_obj(5)).put("bad.toml", "opacity = [[0, 7]]\ncolour = \"#ffffff\"\n");
    folder.put("ct.raw", [0; 8]);
    for (text, parts) in [
        (format!("{volume}colour = 1"), &["unknown field `colour`", "line 2", "expected"][..]),
        (format!("{volume}[occlusion]\nradius = 3"), &["unknown field `radius`", "line 3", "radius_mm"]),
        (format!("{volume}[[clip]]\nshape = \"pyramid\""), &["clip[0].shape", "pyramid", "sphere"]),
        (format!("{volume}[[clip]]\nshape = \"box\"\nscale = -1"), &["clip[0].scale", "-1", "expected"]),
        (format!("{volume}[[clip]]\nshape = \"box\"\nmode = \"hide\""), &["clip[0].mode", "hide", "remove"]),
        (format!("{volume}[[clip]]\nmesh = \"gone.obj\""), &["clip[0].mesh", "gone.obj"]),
        (format!("{volume}[occlusion]\nrays = 27"), &["occlusion.rays", "27", "26"]),
        (format!("{volume}[occlusion]\nradius_mm = -3"), &["occlusion.radius_mm", "-3", "expected"]),
        (format!("{volume}[occlusion]\nlight = \"sun\""), &["occlusion.light", "sun", "sky"]),
        (format!("{volume}[image]\nwidth = 0"), &["image.width", "0", "expected 1"]),
        (format!("{volume}[stereo]\nfov_deg = 200"), &["stereo.fov_deg", "200", "expected"]),
        (format!("{volume}[stereo]\nipd_mm = nan"), &["stereo.ipd_mm", "expected"]),
        (format!("{volume}transfer = \"gone.toml\""), &["transfer", "gone.toml"]),
        ("volume = \"gone.nrrd\"".into(), &["volume", "gone.nrrd"]),
        ("volume = \"builtin:engine\"".into(), &["builtin:engine", "expected"]),
        ("volume = { raw = \"ct.raw\", dims = [2, 2, 2], type = \"u7\" }".into(), &["type", "u7", "uint8"]),
        ("volume = [".into(), &["line 1"]),
        (String::new(), &["missing field `volume`"]),
    ] {
        folder.put("scene.toml", &text);
        let parts = [&["scene.toml"][..], parts].concat();
        refused(&folder, "render scene.toml -o stereo.png --eyes l.png,r.png", FAILURE, &parts);
    }
    // What a method has is known with the method.
    for (text, parts) in [
        ("light = { up = [0, 0, 0] }", &["occlusion.light", "expected a direction"][..]),
        (
            "method = \"spao\"\nlight = \"sky\"",
            &["occlusion.light", "method spao has uniform light only", "lao, cao, rays"],
        ),
    ] {
        folder.put("scene.toml", format!("{volume}[occlusion]\n{text}"));
        refused(&folder, "render scene.toml -o stereo.png", FAILURE, parts);
    }
    for (text, parts) in [
        (format!("{volume}transfer = \"bad.toml\""), &["bad.toml", "opacity[0]", "7"][..]),
        (format!("{volume}[[clip]]\nmesh = \"open.obj\""), &["open.obj", "4 edges are open"]),
        ("volume = { raw = \"ct.raw\", dims = [2, 2, 3], type = \"u8\" }".into(), &["ct.raw", "12 bytes"]),
    ] {
        folder.put("scene.toml", &text);
        refused(&folder, "render scene.toml -o stereo.png", FAILURE, parts);
    }
    folder.put("scene.toml", [0xff, 0xfe, 0x00]);
    refused(&folder, "render scene.toml -o stereo.png", FAILURE, &["scene.toml", "UTF-8"]);
    refused(&folder, "render gone.toml -o stereo.png", FAILURE, &["gone.toml", "No such file"]);
    for command in ["occlusion builtin:engine:8 -o ao.nrrd", "verify builtin:engine:8"] {
        refused(
            &folder,
            &format!("{command} --transfer bad.toml"),
            FAILURE,
            &["bad.toml", "opacity[0]", "7"],
        );
        refused(&folder, &format!("{command} --transfer lead"), FAILURE, &["lead", "ct-bone"]);
    }
}

#[test]
fn a_step_of_too_many_samples_is_refused_by_key_before_the_device_hangs() {
    let folder = Folder::with_device();
    folder
        .put("scene.toml", "volume = \"builtin:engine:8\"\n[image]\nwidth = 8\nheight = 8\nstep_mm = 1e-7\n");
    refused(&folder, "render scene.toml -o s.png", FAILURE, &["image.step_mm", "100000", "at least"]);
}

#[test]
fn meshes_that_enclose_no_solid_are_refused_by_file_and_finding() {
    let folder = Folder::without_device();
    folder.put("open.obj", cube_obj(5)).put("none.obj", "").put("words.obj", "f one two three\n");
    folder.put("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    for (mesh, parts) in [
        ("open.obj", &["does not enclose a solid", "4 edges are open", "the first is at"][..]),
        ("none.obj", &["no faces"]),
        ("words.obj", &["line 1"]),
        ("far.obj", &["names a vertex that is not there"]),
        ("gone.obj", &["No such file"]),
    ] {
        let parts = [&[mesh][..], parts].concat();
        refused(&folder, &format!("occlusion builtin:engine:8 --clip {mesh} -o ao.nrrd"), FAILURE, &parts);
        refused(&folder, &format!("render builtin:engine:8 --clip {mesh} -o s.png"), FAILURE, &parts);
        refused(&folder, &format!("verify builtin:engine:8 --shapes box,{mesh}"), FAILURE, &parts);
    }
}

#[test]
fn wrong_command_lines_are_told_the_flag_and_what_it_takes() {
    let folder = Folder::without_device();
    let occlusion = "occlusion builtin:engine:8 -o ao.nrrd";
    let render = "render builtin:engine:8 -o stereo.png";
    for (flags, parts) in [
        ("--rays 27", &["--rays", "27", "26w"][..]),
        ("--quadrature simpson", &["--quadrature", "segment"]),
        (
            "--method ssao",
            &["--method", "sat, shells, vicinity, histograms, dvao, fdao, spao, cones, lao, cao, rays"],
        ),
        ("--radius-mm -1", &["--radius-mm", "-1", ">= 0 mm"]),
        ("--radius-mm nan", &["--radius-mm", ">= 0 mm"]),
        ("--radius-mm wide", &["--radius-mm", ">= 0 mm"]),
        ("--step-mm 0", &["--step-mm", "> 0 mm"]),
        ("--offset-mm inf", &["--offset-mm", ">= 0 mm"]),
        ("--budget-error 0", &["--budget-error", "> 0"]),
        ("--budget-error nan", &["--budget-error", "> 0"]),
        ("--budget-ms fast", &["--budget-ms", "> 0"]),
        ("--budget-error 0.1 --budget-ms 3", &["--budget-error", "--budget-ms", "cannot be used with"]),
        ("--clip pyramid", &["--clip", "pyramid", "plane, box, sphere"]),
        ("--clip box --clip-mode hide", &["--clip-mode", "remove or keep"]),
        ("--clip box --clip-scale 0", &["--clip-scale", "> 0"]),
        ("--clip box --clip-scale -2", &["--clip-scale", "> 0"]),
        ("--clip box --clip-scale 1,2", &["--clip-scale", "one number or three"]),
        ("--clip box --clip-translate 1,2", &["--clip-translate", "three numbers"]),
        ("--clip box --clip-translate 1,nan,2", &["--clip-translate", "expected"]),
        ("--clip box --clip-rotate 1,2,x", &["--clip-rotate", "three numbers"]),
        ("--clip-translate 1,2,3 --clip box", &["--clip-translate", "before any --clip"]),
        ("--clip-mode keep", &["--clip-mode", "before any --clip"]),
        ("--clip box --clip-scale 2 --clip-scale 3", &["--clip-scale", "twice"]),
        (&"--clip box ".repeat(9), &["--clip", "9 times", "at most 8"]),
        ("--colour red", &["--colour"]),
        ("other.nrrd", &["other.nrrd"]),
    ] {
        refused(&folder, &format!("{occlusion} {flags}"), USAGE, parts);
        refused(&folder, &format!("{render} {flags}"), USAGE, parts);
    }
    for (arguments, parts) in [
        ("", &["Usage"][..]),
        ("draw", &["draw"]),
        ("occlusion builtin:engine:8", &["--output"]),
        ("occlusion -o ao.nrrd", &["<INPUT>"]),
        ("render builtin:engine:8", &["--output"]),
        ("render builtin:engine:8 --eyes l.png", &["--eyes", "LEFT,RIGHT"]),
        ("render builtin:engine:8 -o s.png --size 0x4", &["--size", "WIDTHxHEIGHT"]),
        ("render builtin:engine:8 -o s.png --size 64", &["--size", "WIDTHxHEIGHT"]),
        ("render builtin:engine:8 -o s.png --elevation 100", &["--elevation", "-90 to 90"]),
        ("render builtin:engine:8 -o s.png --azimuth inf", &["--azimuth", "degrees"]),
        ("render builtin:engine:8 -o s.png --fit patient", &["--fit", "visible or box"]),
        ("render builtin:engine:8 -o s.png --distance 0", &["--distance", "> 0 mm"]),
        ("render builtin:engine:8 -o s.png --shading phong --budget-ms 3", &["--shading", "--budget-ms"]),
        ("render builtin:engine:8 -o s.png --ipd -1", &["--ipd", ">= 0 mm"]),
        ("verify builtin:engine:8 --poses 0", &["--poses"]),
        ("verify builtin:engine:8 --poses 4294967295", &["--poses"]),
        ("verify builtin:engine:8 --seed -1", &["--seed"]),
        ("verify builtin:engine:8 --shapes pyramid", &["pyramid"]),
        ("verify builtin:engine:8 --method ssao", &["--method", "all"]),
        ("chart -o out --data scan.obj", &["--data", "--paper or --meshes"]),
        ("info", &["<INPUT>"]),
        ("devices all", &["all"]),
    ] {
        refused(&folder, arguments, USAGE, parts);
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let folder = Folder::without_device();
    folder.put("in.nrrd", nrrd("uchar", "4 4 4", "1 1 1", &[0; 64])).put("file", "");
    std::fs::create_dir(folder.path("out.nrrd")).unwrap();
    std::fs::create_dir(folder.path("out.png")).unwrap();
    for (flags, code, parts) in [
        ("-o none/ao.nrrd", FAILURE, &["none/ao.nrrd", "there is no folder none"][..]),
        ("-o file/ao.nrrd", FAILURE, &["file/ao.nrrd"]),
        ("-o out.nrrd", FAILURE, &["out.nrrd", "is a folder"]),
        ("-o ao.nrrd --mask-out none/vm.nrrd", FAILURE, &["none/vm.nrrd"]),
        ("-o ao.nrrd --opacity-out none/vo.nrrd", FAILURE, &["none/vo.nrrd"]),
        ("-o ..", USAGE, &[".."]),
        ("-o ao.nhdr", USAGE, &["ao.nhdr", ".nrrd"]),
        ("-o in.nrrd", USAGE, &["in.nrrd", "replace an input"]),
        ("-o ao.nrrd --opacity-out ./in.nrrd", USAGE, &["./in.nrrd", "replace an input"]),
        ("-o ao.nrrd --mask-out ./ao.nrrd", USAGE, &["./ao.nrrd", "written twice"]),
    ] {
        refused(&folder, &format!("occlusion in.nrrd {flags}"), code, parts);
    }
    for (flags, code, parts) in [
        ("-o none/s.png", FAILURE, &["none/s.png", "there is no folder none"][..]),
        ("-o out.png", FAILURE, &["out.png", "is a folder"]),
        ("--eyes l.png,none/r.png", FAILURE, &["none/r.png"]),
        ("--eyes l.png,l.png", USAGE, &["l.png", "written twice"]),
        ("-o s.jpg", USAGE, &["s.jpg", ".png"]),
    ] {
        refused(&folder, &format!("render in.nrrd {flags}"), code, parts);
    }
}

#[test]
fn names_that_no_file_can_have_are_refused_before_the_work() {
    let folder = Folder::without_device();
    std::os::unix::fs::symlink("nothing", folder.path("nowhere")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(folder.path("pipe")).status().unwrap();
    assert!(made.success());
    let long = "x".repeat(300);
    // Its own name is one that a file can have, the one that it has until it is whole is not.
    let longest = "x".repeat(255);
    for (name, parts) in [
        (long.as_str(), &["too long"][..]),
        (longest.as_str(), &["too long"]),
        ("pipe", &["pipe: is a device, a pipe or a socket"]),
        ("/dev/null", &["/dev/null: is a device"]),
        ("nowhere", &["nowhere: is a link to a file that is not there"]),
        (".", &[]),
    ] {
        let code = if parts.is_empty() { USAGE } else { FAILURE };
        refused(&folder, &format!("occlusion builtin:engine:8 -o {name}"), code, parts);
        refused(&folder, &format!("occlusion builtin:engine:8 -o ao.nrrd --mask-out {name}"), code, parts);
        refused(&folder, &format!("render builtin:engine:8 --eyes l.png,{name}"), code, parts);
    }
    for command in ["chart builtin:engine:8", "stability"] {
        refused(&folder, &format!("{command} -o {long}"), FAILURE, &["too long"]);
    }
    for eyes in ["a,b,c", "a.png", "1,2,3,4", "a,", ",b", ","] {
        refused(
            &folder,
            &format!("render builtin:engine:8 -o s.png --eyes {eyes}"),
            USAGE,
            &["--eyes", "LEFT,RIGHT"],
        );
    }
}

/// A file that is read on the way, and an argument that makes the program read it.
const READ: [(&str, &str); 17] = [
    ("vox.nrrd", "a.nhdr"),
    ("vox.nrrd", "./././a.nhdr"),
    ("p1.nrrd", "list.nhdr"),
    ("p2.nrrd", "list.nhdr"),
    ("p1.nrrd", "pattern.nhdr"),
    ("p2.nrrd", "pattern.nhdr"),
    ("vox.nrrd", "a.mhd"),
    ("p2.nrrd", "list.mhd"),
    ("a.nhdr", "a.nhdr"),
    ("a.mhd", "a.mhd"),
    ("pair.hdr", "pair.hdr"),
    ("pair.img", "pair.hdr"),
    ("pair.hdr", "pair.img"),
    ("pair.img", "pair.img"),
    ("vox.nrrd", "vox.nrrd --dims 4,4,4 --type uint8"),
    ("cube.obj", "builtin:engine:8 --clip cube.obj"),
    ("tf.toml", "builtin:engine:8 --transfer tf.toml"),
];

/// The same of scenes.
const READ_BY_SCENE: [(&str, &str); 6] = [
    ("scene.toml", "scene.toml"),
    ("a.nhdr", "scene.toml"),
    ("vox.nrrd", "scene.toml"),
    ("cube.obj", "scene.toml"),
    ("tf.toml", "scene.toml"),
    ("vox.nrrd", "raw.toml"),
];

#[test]
fn no_file_that_was_read_is_replaced_whatever_its_name() {
    let folder = Folder::without_device();
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nspacings: 1 1 1\nencoding: raw\n";
    let meta = "ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\n";
    let mut pair = nifti(2, 8, &[]);
    pair[344..348].copy_from_slice(b"ni1\0");
    pair[108..112].copy_from_slice(&0f32.to_le_bytes());
    folder.put("vox.nrrd", [7; 64]).put("p1.nrrd", [7; 32]).put("p2.nrrd", [7; 32]).put("pair.img", [7; 64]);
    folder.put("pair.hdr", &pair[..348]).put("cube.obj", cube_obj(6));
    folder.put("a.nhdr", format!("{header}data file: vox.nrrd\n"));
    folder.put("list.nhdr", format!("{header}data file: LIST 3\np1.nrrd\np2.nrrd\n"));
    folder.put("pattern.nhdr", format!("{header}data file: p%d.nrrd 1 2 1 3\n"));
    folder.put("a.mhd", format!("{meta}ElementDataFile = vox.nrrd\n"));
    folder.put("list.mhd", format!("{meta}ElementDataFile = LIST 3D\np1.nrrd\np2.nrrd\n"));
    folder.put("tf.toml", "opacity = [[0, 0.0], [255, 0.5]]\ncolour = \"#ffffff\"\n");
    let clip = "[[clip]]\nmesh = \"cube.obj\"\n";
    folder.put("scene.toml", format!("volume = \"a.nhdr\"\ntransfer = \"tf.toml\"\n{clip}"));
    folder.put("raw.toml", "volume = { raw = \"vox.nrrd\", dims = [4, 4, 4], type = \"uint8\" }\n");
    std::fs::create_dir(folder.path("links")).unwrap();

    // Another name of the same file, or a link to it, whose own name would do.
    let alias = |name: &str, ending: &str, n: usize| {
        let (hard, soft) = (format!("links/hard{n}.{ending}"), format!("links/soft{n}.{ending}"));
        std::fs::hard_link(folder.path(name), folder.path(&hard)).unwrap();
        std::os::unix::fs::symlink(folder.path(name), folder.path(&soft)).unwrap();
        [hard, soft]
    };
    let spared = |name: &str, line: &str, target: &str| {
        let content = std::fs::read(folder.path(name)).unwrap();
        refused(&folder, line, USAGE, &[target, "would replace an input"]);
        assert_eq!(std::fs::read(folder.path(name)).unwrap(), content, "{line}");
    };
    for (n, (name, reads)) in READ.into_iter().enumerate() {
        for target in alias(name, "nrrd", n) {
            spared(name, &format!("occlusion {reads} -o {target}"), &target);
            spared(name, &format!("occlusion {reads} -o ao.nrrd --mask-out {target}"), &target);
        }
        if name.ends_with(".nrrd") {
            spared(name, &format!("occlusion {reads} --opacity-out {name} -o ao.nrrd"), name);
        }
    }
    let scenes = READ.into_iter().chain(READ_BY_SCENE).enumerate();
    for (n, (name, reads)) in scenes {
        for target in alias(name, "png", n) {
            spared(name, &format!("render {reads} -o {target}"), &target);
            spared(name, &format!("render {reads} --eyes l.png,{target}"), &target);
        }
    }
    for (n, (name, reads)) in READ_BY_SCENE.into_iter().enumerate() {
        for file in ["runs.csv", "chart.svg", "chart.png", "report.html"] {
            let chart = format!("chart{n}-{file}");
            std::fs::create_dir(folder.path(&chart)).unwrap();
            std::fs::hard_link(folder.path(name), folder.path(&format!("{chart}/{file}"))).unwrap();
            spared(name, &format!("chart {reads} -o {chart}"), file);
        }
    }
    folder.put("peers.json", PEERS);
    std::fs::create_dir(folder.path("chart")).unwrap();
    std::fs::hard_link(folder.path("peers.json"), folder.path("chart/chart.svg")).unwrap();
    spared("peers.json", "chart builtin:engine:8 --peers peers.json -o chart", "chart.svg");
    let bench = Folder::without_device().running(env!("CARGO_BIN_EXE_stereo-bench"));
    for (n, (name, reads)) in READ.into_iter().enumerate() {
        let [target, _] = alias(name, "csv", n);
        let words: Vec<_> = reads.split_whitespace().chain(["--csv", &target]).collect();
        let output = bench.command(&words).current_dir(folder.path("")).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(USAGE) && said.contains("would replace an input"),
            "{reads}: {said}"
        );
    }
}

#[cfg(unix)]
#[test]
fn folders_without_permission_are_refused_before_the_work() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::without_device();
    let locked = folder.path("locked");
    std::fs::create_dir(&locked).unwrap();
    std::fs::set_permissions(&locked, PermissionsExt::from_mode(0o555)).unwrap();
    if std::fs::write(locked.join("trial"), "").is_ok() {
        eprintln!("skipped: this user may write everywhere");
        return;
    }
    refused(
        &folder,
        "occlusion builtin:engine:8 -o locked/ao.nrrd",
        FAILURE,
        &["locked/ao.nrrd", "ermission"],
    );
}

#[test]
fn without_a_device_the_user_is_told_how_to_get_one() {
    let folder = Folder::without_device();
    for arguments in
        ["devices", "occlusion builtin:engine:4 -o ao.nrrd", "render builtin:engine:4 -o s.png", "verify"]
    {
        refused(&folder, arguments, FAILURE, &["no Vulkan device answers", "install"]);
    }
}

#[test]
fn examples_ask_for_sources_that_there_are() {
    let folder = Folder::without_device();
    refused(&folder, "examples --count 1 -o out", USAGE, &["--builtin NAME", "--volume FILE"]);
    refused(&folder, "examples --count 1 --builtin colour -o out", USAGE, &["colour", "beetle", "solids"]);
    refused(&folder, "examples --count 0 --builtin fruit -o out", USAGE, &["--count"]);
    refused(&folder, "examples --count 1 --builtin fruit --label max -o out", USAGE, &["mean or end"]);
    refused(&folder, "examples --count 1 --volume absent.nrrd -o out", FAILURE, &["absent.nrrd"]);
}

#[test]
fn stability_asks_for_a_folder_and_for_trials_that_there_are() {
    let folder = Folder::without_device();
    folder.put("taken", "a file");
    refused(&folder, "stability", USAGE, &["--output"]);
    refused(&folder, "stability -o out --only colour", USAGE, &["colour", "stereo, pixels"]);
    refused(&folder, "stability -o taken", FAILURE, &["taken", "it is a file"]);
}
