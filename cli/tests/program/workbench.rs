//! What the tests work at: a folder of inputs, a folder of outputs, and the program run between them.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// No run of these tests works for a second on two idle cores; a run that takes this long hangs.
const HANGS: Duration = Duration::from_secs(120);

/// The most address space that a run may take, in KiB. An allocation of more ends the program with a signal, which
/// every test notices; what is needed in earnest is far less.
#[cfg(target_os = "linux")]
const ADDRESS_SPACE: u64 = 4 << 20;

/// A box of grey fog, one metre wide, under a grey sky and a sun.
pub(crate) const FOG: &str = r#"
[camera]
origin = [1.9, 1.3, 2.2]
target = [0.5, 0.5, 0.5]
fov = 40
size = [24, 16]

[medium]
kind = "homogeneous"
bounds = [[0, 0, 0], [1, 1, 1]]
extinction = 3
albedo = 0.9

[environment]
radiance = 0.5

[[light]]
kind = "directional"
to_light = [0.3, 1.0, 0.2]
irradiance = 2

[estimate]
environment = { kind = "records", cells = 6, bands = 2, directions = 48 }
"#;

/// Two folders that go away with it.
pub(crate) struct Workbench {
    folder: TempDir,
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Workbench {
    /// With [`FOG`] as `fog.toml`.
    pub(crate) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        fs::create_dir(bench.out()).unwrap();
        bench.write("fog.toml", FOG);
        bench
    }

    /// The folder that the program runs in and writes to.
    pub(crate) fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// The path of an input.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes an input.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    /// Writes `name`.toml: [`FOG`] with a grid in place of the box.
    pub(crate) fn grid_scene(&self, name: &str, volume: &Path) -> PathBuf {
        let volume = format!("kind = \"grid\"\nfile = '{}'", volume.display());
        let text = FOG.replace("kind = \"homogeneous\"\nbounds = [[0, 0, 0], [1, 1, 1]]", &volume);
        self.write(&format!("{name}.toml"), text)
    }

    /// The program with `arguments`, in the folder of outputs, bound in memory.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Command {
        #[cfg(target_os = "linux")]
        let command = self.shell(&format!("ulimit -v {ADDRESS_SPACE}"), "", arguments);
        #[cfg(not(target_os = "linux"))]
        let command = {
            let mut command = Command::new(env!("CARGO_BIN_EXE_airlight"));
            command.args(arguments).current_dir(self.out()).env_remove("AIRLIGHT_REQUIRE");
            command
        };
        command
    }

    /// The program with `arguments` behind the shell command `first`, with `redirect`ions.
    #[cfg(unix)]
    pub(crate) fn shell<S: AsRef<OsStr>>(
        &self,
        first: &str,
        redirect: &str,
        arguments: impl IntoIterator<Item = S>,
    ) -> Command {
        let mut command = Command::new("sh");
        command.arg("-c").arg(format!("{first} && exec \"$0\" \"$@\" {redirect}"));
        command.arg(env!("CARGO_BIN_EXE_airlight")).args(arguments).current_dir(self.out());
        // Every thread takes address space; a machine of many cores would take it all.
        command.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
        // What is required of this test run is not required of the program.
        command.env_remove("AIRLIGHT_REQUIRE");
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Ended {
        self.end(self.command(arguments))
    }

    /// Runs a command to its end.
    pub(crate) fn end(&self, mut command: Command) -> Ended {
        let sinks = tempfile::tempdir().unwrap();
        let sink = |name: &str| File::create(sinks.path().join(name)).unwrap();
        command.stdin(Stdio::null()).stdout(sink("stdout")).stderr(sink("stderr"));
        let code = wait(command.spawn().unwrap(), &format!("{command:?}"));
        let text = |name: &str| String::from_utf8(fs::read(sinks.path().join(name)).unwrap()).unwrap();
        let ended = Ended { code, stdout: text("stdout"), stderr: text("stderr") };
        assert!(!ended.stderr.contains("panicked"), "{command:?}: {ended:?}");
        assert!(ended.code.is_some(), "{command:?} was ended by a signal: {ended:?}");
        ended
    }

    /// What lies in the folder of outputs, hidden files too.
    pub(crate) fn outputs(&self) -> Vec<String> {
        names(&self.out())
    }

    /// The run must end with `code` and one error that holds each of `words`, and leave no file.
    #[track_caller]
    pub(crate) fn refused<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>, code: i32, words: &[&str]) {
        let ended = self.run(arguments);
        ended.failed(code, words);
        assert_eq!(self.outputs(), Vec::<String>::new(), "{ended:?}");
    }

    /// The run must end well; its standard output as JSON.
    #[track_caller]
    pub(crate) fn json<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Value {
        let ended = self.run(arguments);
        ended.well();
        serde_json::from_str(&ended.stdout).unwrap_or_else(|e| panic!("{e}: {ended:?}"))
    }
}

impl Ended {
    /// It must have ended with `code` and one error that holds each of `words`.
    #[track_caller]
    pub(crate) fn failed(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        let errors = self.stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!(errors, 1, "{self:?}");
        let first = self.stderr.lines().find(|line| !line.starts_with("warning: ")).unwrap_or_default();
        assert!(first.starts_with("error: "), "{self:?}");
        for word in words {
            assert!(self.stderr.contains(word), "{word:?} is not in {self:?}");
        }
        assert_eq!(self.stdout, "", "{self:?}");
    }

    /// It must have ended well.
    #[track_caller]
    pub(crate) fn well(&self) {
        assert_eq!(self.code, Some(0), "{self:?}");
        assert!(!self.stderr.contains("error"), "{self:?}");
    }
}

/// The exit code of a run that ends in time.
pub(crate) fn wait(mut child: Child, what: &str) -> Option<i32> {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if begin.elapsed() > HANGS {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{what} was still running after {HANGS:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// What lies in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A file of the volume and picture readers' own tests.
pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/data").join(name)
}

/// A file of the reference scene.
pub(crate) fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance/data/reference").join(name)
}

/// An attached NRRD of 32-bit floats in the box from 0 to 1.
pub(crate) fn nrrd(dims: [usize; 3], values: &[f32]) -> Vec<u8> {
    let [x, y, z] = dims;
    let (a, b, c) = (1.0 / x as f64, 1.0 / y as f64, 1.0 / z as f64);
    let header = format!(
        "NRRD0004\ntype: float\ndimension: 3\nspace dimension: 3\nsizes: {x} {y} {z}\nspace directions: ({a},0,0) \
         (0,{b},0) (0,0,{c})\nspace origin: ({},{},{})\nendian: little\nencoding: raw\n\n",
        0.5 * a,
        0.5 * b,
        0.5 * c
    );
    let data = values.iter().flat_map(|v| v.to_le_bytes());
    header.into_bytes().into_iter().chain(data).collect()
}

/// A NIfTI-1 file of 32-bit floats, a metre a voxel.
pub(crate) fn nifti(dims: [i16; 3], values: &[f32]) -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    let mut put = |at: usize, data: &[u8]| bytes[at..at + data.len()].copy_from_slice(data);
    put(0, &348i32.to_le_bytes());
    let sizes = [3, dims[0], dims[1], dims[2], 1, 1, 1, 1];
    sizes.iter().enumerate().for_each(|(i, d)| put(40 + 2 * i, &d.to_le_bytes()));
    put(70, &16i16.to_le_bytes()); // 32-bit float
    put(72, &32i16.to_le_bytes());
    (0..4).for_each(|i| put(76 + 4 * i, &1f32.to_le_bytes()));
    put(108, &352f32.to_le_bytes());
    put(123, &[1]); // metres
    put(344, b"n+1\0");
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// A ramp that differs along every axis.
pub(crate) fn ramp([x, y, z]: [usize; 3]) -> Vec<f32> {
    (0..x * y * z).map(|n| 0.1 + (n % x) as f32 + 0.3 * (n / x % y) as f32 + 0.7 * (n / x / y) as f32).collect()
}
