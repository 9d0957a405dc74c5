//! The command on one file in a folder of its own, short of memory.

use super::mutate::{Parts, join};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Address space that a run may take, KiB: half of it is the program, its threads and what their allocators set aside.
const SPACE_KIB: u32 = 1 << 20;
/// What no refusal may take, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A folder with files in it.
pub struct Place {
    pub folder: TempDir,
}

/// How a run ended.
pub struct Ended {
    pub code: Option<i32>,
    pub said: String,
}

impl Place {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }

    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs `lightkiln` with arguments separated by spaces, in little address space where the system can limit it.
    pub fn run(&self, arguments: &str) -> Ended {
        let program = env!("CARGO_BIN_EXE_lightkiln");
        let mut command = if cfg!(target_os = "linux") {
            let mut shell = Command::new("sh");
            shell.arg("-c").arg(format!("ulimit -v {SPACE_KIB}; exec \"$0\" \"$@\"")).arg(program);
            shell
        } else {
            Command::new(program)
        };
        let started = Instant::now();
        // One arena of the allocator, as threads would each set 64 MiB aside.
        command.env("MALLOC_ARENA_MAX", "1").current_dir(self.folder.path());
        let output = command.args(arguments.split_whitespace()).output().unwrap();
        assert!(started.elapsed() < PATIENCE, "lightkiln {arguments} took {:?}", started.elapsed());
        let said = String::from_utf8(output.stderr).unwrap();
        Ended { code: output.status.code(), said }
    }

    /// Bakes `scene.glb` quickly, with more arguments.
    pub fn bake(&self, more: &str) -> Ended {
        let quick = "bake scene.glb --quality draft --page-size 32 --max-pages 1 --threads 1";
        self.run(&format!("{quick} {more}"))
    }
}

impl Ended {
    /// It said that it could not, and why, in the given words.
    #[track_caller]
    pub fn refused(self, words: &[&str]) {
        assert_eq!(self.code, Some(1), "{}", self.said);
        assert!(self.said.starts_with("error: ") && !self.said.contains("internal"), "{}", self.said);
        for word in words {
            assert!(self.said.contains(word), "no {word:?} in:\n{}", self.said);
        }
    }

    /// It went well, but said something.
    #[track_caller]
    pub fn warned(self, words: &[&str]) {
        assert_eq!(self.code, Some(0), "{}", self.said);
        for word in words {
            assert!(self.said.contains(word), "no {word:?} in:\n{}", self.said);
        }
    }
}

/// A lit square of two triangles as GLB parts; `change` may do what it likes to them.
pub fn square(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0_f32]];
    let mut bin: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bin.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let mut json = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0], "extras": {"lightkiln.sky": [1, 1, 1]}}],
        "nodes": [{"name": "Wall", "mesh": 0}],
        "meshes": [{"name": "Square", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}
        ],
        "buffers": [{"byteLength": 60}]
    });
    change(&mut json, &mut bin);
    if let Some(buffer) = json["buffers"][0].as_object_mut()
        && !buffer.contains_key("uri")
        && buffer["byteLength"] == 60
    {
        buffer["byteLength"] = json!(bin.len());
    }
    join(&Parts { json, bin: Some(bin) })
}

/// Appends bytes as a buffer view and returns its number.
pub fn view(json: &mut Value, bin: &mut Vec<u8>, bytes: &[u8]) -> usize {
    bin.resize(bin.len().next_multiple_of(4), 0);
    let views = json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
    bin.extend(bytes);
    views.len() - 1
}
