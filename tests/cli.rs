//! The command as a user meets it: exit codes, what is said and where, and what is left on the disk.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Duration;
use tempfile::TempDir;

/// No run here may take longer.
const PATIENCE: Duration = Duration::from_secs(300);

/// A folder of its own with a copy of `fixtures/cornell.glb` in it.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell.glb");
        fs::copy(&fixture, folder.path().join("cornell.glb")).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs `lightkiln` here with arguments separated by spaces.
    fn run(&self, arguments: &str) -> Run {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("lightkiln"));
        command.current_dir(self.folder.path()).args(arguments.split_whitespace()).timeout(PATIENCE);
        Run::new(arguments, command.output().unwrap())
    }
}

/// How a run ended.
struct Run {
    arguments: String,
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Run {
    fn new(arguments: &str, output: Output) -> Self {
        Self {
            arguments: arguments.to_owned(),
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    #[track_caller]
    fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "lightkiln {}\n{}{}", self.arguments, self.stdout, self.stderr);
        self
    }

    #[track_caller]
    fn says(self, parts: &[&str]) -> Self {
        for part in parts {
            assert!(
                self.stderr.contains(part),
                "lightkiln {}\nno {part:?} in:\n{}",
                self.arguments,
                self.stderr
            );
        }
        self
    }

    #[track_caller]
    fn prints_nothing_to_stdout(self) -> Self {
        assert_eq!(self.stdout, "", "lightkiln {}", self.arguments);
        self
    }
}

/// Small and quick, but all stages run.
const QUICK: &str = "bake cornell.glb --quality draft --page-size 64 --max-pages 1";

#[test]
fn help_is_what_was_asked_for_so_it_goes_to_stdout() {
    let place = Place::new();
    for arguments in ["--help", "-h", "bake --help", "bake -h", "--version"] {
        let run = place.run(arguments).exits(0);
        assert_eq!(run.stderr, "", "{arguments}");
        assert!(run.stdout.contains("lightkiln"), "{arguments}");
    }
    let help = place.run("bake --help").stdout;
    for part in ["--quality", "Texture space:", "[default: 1024]", "Examples:", "Exit codes:", "Ctrl-C"] {
        assert!(help.contains(part), "{part}");
    }
}

#[test]
fn wrong_usage_exits_with_two() {
    let place = Place::new();
    let bake = |arguments: &str| place.run(&format!("bake cornell.glb {arguments}")).exits(2);
    place.run("").exits(2).prints_nothing_to_stdout();
    place.run("bake").exits(2).prints_nothing_to_stdout();
    place.run("bakes cornell.glb").exits(2).says(&["bakes", "tip", "bake"]);
    bake("--no-such-thing").says(&["--no-such-thing"]);
    bake("--quality best").says(&["draft", "reference"]);
    bake("--page-size 8").says(&["from 16 to 16384"]);
    bake("--page-size 32768").says(&["from 16 to 16384"]);
    bake("--max-pages 0").says(&["--max-pages"]);
    bake("--density -3").says(&["above 0"]);
    bake("--sky 1,2").says(&["0.35,0.55,1.0"]);
    bake("--sky -1,0,0").says(&["not negative"]);
    bake("--sky noon.png").says(&[".exr or .hdr"]);
    bake("--sun-angle 400").says(&["0 to 180"]);
    bake("--memory 4").says(&["4GiB"]);
    bake("--threads 0").says(&["--threads"]);
    bake("-q -v").says(&["--quiet", "--verbose"]);
    bake("--report cornell.glb").says(&["same name", "cornell.glb"]).prints_nothing_to_stdout();
    assert_eq!(place.names(), ["cornell.glb"]);
}

#[test]
fn a_missing_scene_is_named_with_a_hint() {
    let place = Place::new();
    place.run("bake attic.glb").exits(1).says(&["error: attic.glb: ", "hint: "]).prints_nothing_to_stdout();
    place.run("bake attic.glb -q").exits(1).says(&["error: attic.glb: "]);
    assert_eq!(place.names(), ["cornell.glb"]);
}

#[test]
fn a_broken_scene_is_an_error_that_names_it_and_leaves_nothing() {
    let place = Place::new();
    let whole = fs::read(place.path("cornell.glb")).unwrap();
    place.write("cut.glb", &whole[..whole.len() / 2]);
    place.write("text.gltf", b"not JSON");
    place.write("empty.glb", b"");
    place.write("house.blend", b"BLENDER-v405");
    let before = place.names();
    for name in ["cut.glb", "text.gltf", "empty.glb"] {
        place.run(&format!("bake {name}")).exits(1).says(&["error: ", name]).prints_nothing_to_stdout();
    }
    place.run("bake house.blend").exits(1).says(&["error: ", "house.blend", "hint: ", "glTF"]);
    place.run("bake .").exits(1).says(&["error: "]);
    assert_eq!(place.names(), before);
}

#[test]
fn outputs_never_replace_the_input_and_need_a_folder() {
    let place = Place::new();
    let before = fs::read(place.path("cornell.glb")).unwrap();
    place.run(&format!("{QUICK} -o cornell.glb")).exits(1).says(&["error: cornell.glb: ", "input"]);
    place.run(&format!("{QUICK} -o ./cornell.glb")).exits(1).says(&["input"]);
    place.run(&format!("{QUICK} --preview cornell.glb")).exits(1).says(&["cornell.glb"]);
    place.run(&format!("{QUICK} -o attic/lit.glb")).exits(1).says(&["error: ", "attic", "hint: "]);
    place.run(&format!("{QUICK} -o cornell.glb/lit.glb")).exits(1).says(&["error: ", "cornell.glb"]);
    place.run(&format!("{QUICK} --report attic/lit.json")).exits(1).says(&["error: ", "attic", "hint: "]);
    place.run(&format!("{QUICK} -o lit.png")).exits(1).says(&["lit.png", ".glb"]);
    assert_eq!(place.names(), ["cornell.glb"]);
    assert_eq!(fs::read(place.path("cornell.glb")).unwrap(), before);
}

#[test]
fn a_bake_writes_its_files_and_a_report() {
    let place = Place::new();
    let run = place.run(&format!("{QUICK} --report report.json")).exits(0).prints_nothing_to_stdout();
    let run = run.says(&["wrote cornell.baked.glb", "lamps read as blender", "baked in "]);
    assert!(!run.stderr.contains(['\r', '\u{1b}']), "a bar or colours in a pipe:\n{}", run.stderr);

    let report: Value = serde_json::from_slice(&fs::read(place.path("report.json")).unwrap()).unwrap();
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["interrupted"], false);
    assert_eq!(report["lamp_units"], "blender");
    assert_eq!(report["settings"]["atlas"]["page_size"], 64);
    let outputs: Vec<&str> = list(&report["outputs"]).iter().map(|path| path.as_str().unwrap()).collect();
    assert_eq!(outputs[0], "cornell.baked.glb");
    assert!(outputs.iter().any(|path| path.ends_with(".exr")), "{outputs:?}");
    for output in &outputs {
        assert!(fs::metadata(place.path(output)).unwrap().len() > 0, "{output}");
    }
    let expected = [&outputs[..], &["cornell.glb", "report.json"]].concat();
    assert!(place.names().iter().all(|name| expected.contains(&name.as_str())), "{:?}", place.names());

    let stages = list(&report["stages"]);
    let names: Vec<&str> = stages.iter().map(|stage| stage["stage"].as_str().unwrap()).collect();
    assert_eq!(names.first(), Some(&"import"));
    assert_eq!(names.last(), Some(&"export"));
    let seconds: f64 = stages.iter().map(|stage| number(&stage["seconds"])).sum();
    assert!(seconds > 0.0 && seconds <= number(&report["seconds_total"]) + 1e-6);
    let rays: f64 = stages.iter().map(|stage| number(&stage["rays"])).sum();
    assert!(rays > 0.0 && rays == number(&report["light"]["rays"]));

    let (atlas, light) = (&report["atlas"], &report["light"]);
    assert_eq!((number(&atlas["pages"]), number(&atlas["page_size_texels"])), (1.0, 64.0));
    assert!((0.1..=1.0).contains(&number(&atlas["fill"])));
    assert!((number(&atlas["texels"]) - number(&atlas["fill"]) * 64.0 * 64.0).abs() < 1.0);
    assert!(number(&light["patches"]) > 0.0 && number(&light["shots"]) > 0.0);
    let ledger = &light["ledger"];
    for channel in 0..3 {
        let power = |name: &str| number(&ledger[name][channel]);
        let spent = power("absorbed") + power("escaped") + power("unshot") + power("sampling");
        // The solver keeps its books in f64; what it is given is f32.
        assert!(
            power("emitted") > 0.0 && (power("emitted") - spent).abs() <= 1e-5 * power("emitted"),
            "{ledger}"
        );
    }
}

#[test]
fn a_quiet_bake_is_silent_and_a_report_can_go_to_stdout() {
    let place = Place::new();
    let run = place.run(&format!("{QUICK} -q -o a.glb")).exits(0).prints_nothing_to_stdout();
    assert_eq!(run.stderr, "");
    let run = place.run(&format!("{QUICK} -q -o b.glb --report -")).exits(0);
    assert_eq!(run.stderr, "");
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report["input"], "cornell.glb");
    assert!(place.names().contains(&"a.glb".to_owned()) && place.names().contains(&"b.glb".to_owned()));
}

#[test]
fn a_verbose_bake_tells_every_stage() {
    let place = Place::new();
    place.run(&format!("{QUICK} -v")).exits(0).prints_nothing_to_stdout().says(&[
        " s  import",
        " s  gather",
        " s  export",
        "peak memory",
        "effects",
        "emitted",
        "absorbed",
    ]);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let place = Place::new();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("lightkiln"));
    command.current_dir(place.folder.path()).args(QUICK.split_whitespace()).stderr(writer);
    assert_eq!(command.status().unwrap().code(), Some(0));
}

#[cfg(unix)]
mod interrupted {
    use super::*;
    use std::io::{BufRead as _, BufReader, Read as _};
    use std::process::{Child, Stdio};
    use std::time::Instant;

    /// Minutes of work, if nobody stops it.
    const LONG: &str = "bake cornell.glb --quality reference --page-size 1024 --report report.json -v";

    /// A bake that has come to `stage`.
    fn bake_until(place: &Place, stage: &str) -> (Child, BufReader<std::process::ChildStderr>) {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("lightkiln"));
        command.current_dir(place.folder.path()).args(LONG.split_whitespace());
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        while !said.ends_with(&format!("  {stage}\n")) {
            assert!(stderr.read_line(&mut said).unwrap() > 0, "it ended before {stage}:\n{said}");
        }
        (child, stderr)
    }

    fn signal(child: &Child, name: &str) {
        let id = child.id().to_string();
        assert!(std::process::Command::new("kill").args([name, &id]).status().unwrap().success());
    }

    /// Exit code and the rest of what it said; kills what does not end.
    fn end(mut child: Child, mut stderr: BufReader<std::process::ChildStderr>) -> (Option<i32>, String) {
        let begin = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if begin.elapsed() > PATIENCE {
                child.kill().unwrap();
                panic!("it does not stop");
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let mut said = String::new();
        stderr.read_to_string(&mut said).unwrap();
        (status.code(), said)
    }

    #[test]
    fn one_signal_writes_the_solution_so_far() {
        for name in ["-INT", "-TERM"] {
            let place = Place::new();
            let (child, stderr) = bake_until(&place, "gather");
            signal(&child, name);
            let (code, said) = end(child, stderr);
            assert_eq!(code, Some(130), "{said}");
            assert!(said.contains("interrupted: ") && said.contains("interrupted after "), "{said}");
            let report: Value =
                serde_json::from_slice(&fs::read(place.path("report.json")).unwrap()).unwrap();
            assert_eq!(report["interrupted"], true);
            for output in list(&report["outputs"]) {
                assert!(fs::metadata(place.path(output.as_str().unwrap())).unwrap().len() > 0);
            }
            assert!(place.path("cornell.baked.glb").exists());
            assert!(!place.names().iter().any(|name| name.ends_with(".tmp")), "{:?}", place.names());
        }
    }

    #[test]
    fn a_second_signal_ends_it_at_once() {
        let place = Place::new();
        let (child, mut stderr) = bake_until(&place, "gather");
        signal(&child, "-INT");
        // Two signals at the same time are one: wait until the first was heard.
        let mut said = String::new();
        while !said.contains("interrupted: ") {
            assert!(stderr.read_line(&mut said).unwrap() > 0, "{said}");
        }
        signal(&child, "-INT");
        let (code, said) = end(child, stderr);
        assert_eq!(code, Some(130), "{said}");
        assert!(!place.names().iter().any(|name| name.ends_with(".tmp")), "{:?}", place.names());
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}
