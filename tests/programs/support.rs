//! Running the real program in a folder of its own.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// A folder that is deleted at the end, with the program run in it.
pub struct Folder {
    folder: tempfile::TempDir,
    program: &'static str,
    environment: Vec<(&'static str, &'static str)>,
}

/// What a run of the program gave.
pub struct Run {
    /// Its command line, for messages.
    pub line: String,
    /// Exit code; `None` for a signal.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Folder {
    /// Runs use the device, under validation: the program fails when the layer says anything.
    pub fn with_device() -> Self {
        Self::with(vec![("CAO_VALIDATION", "1")])
    }

    /// Runs find no Vulkan driver: whatever they say, they say before they ask for a device.
    pub fn without_device() -> Self {
        // The older name of the variable is for older loaders.
        let environment = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| (name, "/nonexistent")).to_vec();
        Self::with(environment)
    }

    fn with(environment: Vec<(&'static str, &'static str)>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { folder, program: env!("CARGO_BIN_EXE_cao"), environment }
    }

    /// The same with another program than `cao`.
    pub fn running(self, program: &'static str) -> Self {
        Self { program, ..self }
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn put(&self, name: &str, content: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.path(name), content).unwrap();
        self
    }

    /// Names of everything in the folder, sorted.
    pub fn list(&self) -> Vec<String> {
        let names = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> =
            names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The program with these arguments, not yet started.
    pub fn command<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = self.here(self.program);
        command.args(arguments);
        command
    }

    fn here(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        command.envs(self.environment.iter().copied());
        command
    }

    /// Runs the program; arguments are separated by white space.
    pub fn run(&self, arguments: &str) -> Run {
        self.under("exec \"$@\"", arguments)
    }

    /// The program run by a shell script, for which it is, with its arguments, `"$@"`.
    pub fn shell(&self, script: &str, arguments: &str) -> Command {
        let mut shell = self.here("sh");
        shell.args(["-c", script, "sh", self.program]).args(arguments.split_whitespace());
        shell
    }

    /// Runs such a script.
    pub fn under(&self, script: &str, arguments: &str) -> Run {
        let output = self.shell(script, arguments).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
        let run = Run {
            line: format!("{} {arguments}", self.program),
            code: output.status.code(),
            out: text(output.stdout),
            err: text(output.stderr),
        };
        assert!(!run.err.contains("panicked"), "{}: {}", run.line, run.err);
        assert!(!run.err.contains(['\r', '\u{1b}']), "{}: progress in a pipe: {:?}", run.line, run.err);
        run
    }

    /// Runs the program, which must succeed, and returns what it prints.
    pub fn ok(&self, arguments: &str) -> String {
        let run = self.run(arguments);
        assert_eq!(run.code, Some(0), "{}: {}", run.line, run.err);
        run.out
    }

    /// The same with `--json`: the answer is one JSON object and nothing else.
    pub fn json(&self, arguments: &str) -> serde_json::Value {
        let out = self.ok(&format!("{arguments} --json"));
        let value: serde_json::Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out}"));
        assert!(value.is_object(), "{out}");
        value
    }
}

/// A NRRD of raw little-endian values.
pub fn nrrd(kind: &str, sizes: &str, spacings: &str, data: &[u8]) -> Vec<u8> {
    let header = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nspacings: {spacings}\nendian: little\nencoding: raw\n\n"
    );
    [header.as_bytes(), data].concat()
}

/// A cube of half-edge 1 mm; `faces` of its six sides are there.
pub fn cube_obj(faces: usize) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |bit: u32| if corner >> bit & 1 == 1 { 1 } else { -1 };
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    // Outward, by corner number from 1: x low, x high, y low, y high, z low, z high.
    let sides = ["1 5 7 3", "2 4 8 6", "1 2 6 5", "3 7 8 4", "1 3 4 2", "5 6 8 7"];
    for side in &sides[..faces] {
        text += &format!("f {side}\n");
    }
    text
}
