//! The arrows that must never exist: reads `src` and fails on a name where it does not belong, with file and line.

#[path = "architecture/scan.rs"]
mod scan;

use scan::{Path, Source, Token, paths, read};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

/// What every module may name.
const COMMON: [&str; 6] = ["error", "units", "options", "progress", "sampling", "text"];

/// Which module may name which others, besides [`COMMON`]. A stage never names a later one. A file may have a row of
/// its own, which then counts instead of its module's.
const MAY_NAME: [(&str, &[&str]); 32] = [
    ("error", &[]),
    ("units", &[]),
    ("options", &[]),
    ("progress", &[]),
    ("sampling", &[]),
    ("text", &[]),
    ("scene", &[]),
    ("import", &["scene"]),
    ("plan", &["scene"]),
    ("atlas", &["scene", "plan"]),
    ("transport", &["scene", "plan", "atlas"]),
    ("elements", &["scene", "plan", "atlas", "transport"]),
    ("direct", &["scene", "plan", "atlas", "transport", "elements"]),
    ("solve", &["plan", "transport"]),
    ("solve/assemble.rs", &["plan", "transport", "elements"]),
    ("solve/coarse.rs", &["plan", "transport", "elements", "direct"]),
    ("solve/facets.rs", &["plan", "transport", "elements"]),
    ("solve/pairs.rs", &["plan", "transport", "elements"]),
    ("gather", &["scene", "plan", "atlas", "transport", "elements", "direct", "solve"]),
    ("audit", &["scene", "plan", "atlas", "transport", "elements", "direct", "solve", "gather"]),
    ("resolve", &["scene", "plan", "atlas", "transport", "elements", "direct", "solve", "gather"]),
    ("export", &["scene", "import", "plan", "atlas", "elements", "resolve"]),
    ("baked", &["scene", "import", "export"]),
    ("render", &["scene", "import", "transport", "export", "baked"]),
    ("check", &["scene", "import", "transport", "export", "baked", "render"]),
    ("memory", &["scene", "plan", "atlas"]),
    ("report", &["plan", "audit"]),
    ("bake", &[STAGES, "report"]),
    ("forecast", &[STAGES, "report", "bake"]),
    ("study", &[STAGES, "report", "bake", "forecast"]),
    ("cli", &[STAGES, "report", "bake", "forecast", "study"]),
    ("main", &["cli"]),
];

/// Stands for the world and all stages.
const STAGES: &str = "stages";

/// Where a foreign crate may be named: folders and files of `src`.
const HOMES: [(&str, &[&str]); 20] = [
    ("base64", &["import/", "export/", "study/page.rs"]),
    ("clap", &["cli/", "main.rs"]),
    ("colorous", &["study/accuracy/maps.rs"]),
    ("comfy_table", &["study/sheet.rs"]),
    ("csv", &["study/sheet.rs", "study/accuracy/beside.rs"]),
    ("ctrlc", &["cli/"]),
    ("draco_gltf", &["import/"]),
    ("exr", &["export/exr.rs", "import/sky_image.rs"]),
    ("gltf", &["import/", "export/"]),
    ("image", &["import/", "export/"]),
    ("indicatif", &["cli/"]),
    ("maud", &["study/page.rs"]),
    ("obvhs", &["transport/build.rs"]),
    ("percent_encoding", &["import/", "export/"]),
    ("plotly", &["study/page.rs"]),
    ("sobol_burley", &["sampling.rs"]),
    ("tempfile", &["export/", "study/tests.rs"]),
    ("terminal_size", &["cli/"]),
    ("uvunwrap", &["atlas/"]),
    ("xatlas_rs_v2", &["atlas/"]),
];

/// Foreign crates that are at home everywhere.
const EVERYWHERE: [&str; 7] = ["bytemuck", "glam", "half", "rayon", "serde", "serde_json", "thiserror"];

/// Where `unsafe` may stand: the homes of SIMD and of C++.
const UNSAFE_HOMES: [&str; 2] = ["transport/", "atlas/xatlas.rs"];

/// Where files may be read and written.
const FILE_HOMES: [&str; 5] = ["import/", "export/", "bake.rs", "study/", "cli/"];

/// Where the clock may be read: the unwrapper's last resort against a hang.
const CLOCK_HOMES: [&str; 1] = ["atlas/charting.rs"];

/// Statics of a kind that could change, but that nothing changes.
const UNCHANGING: [(&str, &str); 1] = [("bake.rs", "NEVER")];

/// The program around the library: it has a clock, prints and exits.
const PROGRAM: [&str; 2] = ["cli/", "main.rs"];

/// Macros by name, with the module they are made in: outside of it they are named like items of the crate.
type Macros = BTreeMap<String, String>;

struct File {
    /// Below `src`, with `/`.
    name: String,
    source: Source,
    /// `["atlas", "unwrap"]` for `atlas/unwrap.rs`.
    module: Vec<String>,
}

impl File {
    fn new(name: &str, text: &str) -> Self {
        let stem = name.trim_end_matches(".rs");
        let mut module: Vec<String> = stem.split('/').map(str::to_owned).collect();
        if module.last().is_some_and(|last| last == "mod") || ["lib", "main"].contains(&stem) {
            module.pop();
        }
        Self { name: name.to_owned(), source: read(text), module }
    }

    /// The row of the table; `None` for lib.rs, which names all.
    fn row(&self) -> Option<&str> {
        match self.name.as_str() {
            "lib.rs" => None,
            "main.rs" => Some("main"),
            _ => Some(&self.module[0]),
        }
    }

    fn is_in(&self, homes: &[&str]) -> bool {
        homes.iter().any(|home| self.name == *home || (home.ends_with('/') && self.name.starts_with(home)))
    }

    fn macros(&self) -> Macros {
        let names = self.source.tokens.windows(3).filter(|w| w[0].text == "macro_rules" && w[1].text == "!");
        let row = self.row().unwrap_or("lib");
        names.map(|w| (w[2].text.clone(), row.to_owned())).collect()
    }

    /// What breaks the rules, as `file:line: why`.
    fn violations(&self, macros: &Macros) -> Vec<String> {
        let mut found = Vec::new();
        let mut tell = |line: usize, why: String| found.push(format!("src/{}:{line}: {why}", self.name));
        let paths = paths(&self.source.tokens);
        let local = self.local_names(&paths);
        for path in &paths {
            let root = path.segments[0].as_str();
            let inside = ["crate", "self", "super", "lightkiln"].contains(&root);
            if inside {
                self.check_arrow(path, macros, &mut tell);
            } else if path.absolute || !local.contains(root) {
                self.check_foreign(path, &mut tell);
            }
        }
        self.check_words(&mut tell);
        found.dedup();
        found
    }

    /// Names that mean something inside the crate here, whatever crates are called so too.
    fn local_names<'a>(&'a self, paths: &'a [Path]) -> BTreeSet<&'a str> {
        let tokens = &self.source.tokens;
        let modules = tokens.windows(2).filter(|w| w[0].text == "mod").map(|w| w[1].text.as_str()).collect();
        let inner = paths
            .iter()
            .filter(|path| path.imported && ["crate", "self", "super"].contains(&path.segments[0].as_str()));
        let mut names: BTreeSet<&str> = modules;
        names.extend(inner.filter_map(|path| path.segments.last().map(String::as_str)));
        names
    }

    fn check_arrow(&self, path: &Path, macros: &Macros, tell: &mut impl FnMut(usize, String)) {
        let Some(row) = self.row() else { return };
        let mut module: Vec<&str> = self.module.iter().chain(&path.inside).map(String::as_str).collect();
        for segment in &path.segments {
            match segment.as_str() {
                "crate" | "lightkiln" => module.clear(),
                "self" => {}
                "super" => drop(module.pop()),
                name => module.push(name),
            }
        }
        let Some(mut to) = module.first().copied() else { return };
        if let Some(home) = macros.get(to) {
            to = home;
        } else if to.starts_with(char::is_uppercase) {
            // lib.rs gives the crate's root the types of `error` only.
            to = "error";
        }
        if to == row {
            return;
        }
        let table = |wanted: &str| MAY_NAME.iter().find(|(name, _)| *name == wanted);
        let Some((_, may)) = table(&self.name).or_else(|| table(row)) else {
            return tell(
                path.line,
                format!("the module {row} has no row in the table of tests/architecture.rs"),
            );
        };
        let stage = MAY_NAME.iter().skip_while(|(name, _)| *name != "scene").map(|(name, _)| *name);
        let stage = stage.take_while(|name| *name != "report").any(|name| name == to);
        if !(COMMON.contains(&to) || may.contains(&to) || (stage && may.contains(&STAGES))) {
            tell(path.line, format!("{row} -> {to}"));
        }
    }

    fn check_foreign(&self, path: &Path, tell: &mut impl FnMut(usize, String)) {
        let root = path.segments[0].as_str();
        if let Some((name, homes)) = HOMES.iter().find(|(name, _)| *name == root) {
            if !self.is_in(homes) {
                tell(path.line, format!("{name} is at home in {} only", homes.join(", ")));
            }
            return;
        }
        if !["std", "core", "alloc"].contains(&root) {
            return;
        }
        let rest: Vec<&str> = path.segments[1..].iter().map(String::as_str).collect();
        let program = self.is_in(&PROGRAM);
        match rest.as_slice() {
            ["time", ..] if self.is_in(&CLOCK_HOMES) => {}
            ["fs", ..] if !self.is_in(&FILE_HOMES) => {
                tell(path.line, "names std::fs: no files here".to_owned())
            }
            ["time" | "env" | "process" | "net", ..] if !program => {
                tell(
                    path.line,
                    format!("names std::{}: the library has no clock, environment or exit", rest[0]),
                );
            }
            ["io", "stdout" | "stderr" | "stdin", ..] if !program => {
                tell(path.line, "names a standard stream: the library never prints".to_owned());
            }
            _ => {}
        }
    }

    fn check_words(&self, tell: &mut impl FnMut(usize, String)) {
        let tokens = &self.source.tokens;
        let text = |i: usize| tokens.get(i).map_or("", |token: &Token| token.text.as_str());
        for (i, Token { line, text: word }) in tokens.iter().enumerate() {
            match word.as_str() {
                "unsafe" if !self.is_in(&UNSAFE_HOMES) => {
                    tell(*line, format!("unsafe is at home in {} only", UNSAFE_HOMES.join(", ")));
                }
                "static" if text(i + 1) == "mut" => tell(*line, "static mut".to_owned()),
                "static" if UNCHANGING.contains(&(self.name.as_str(), text(i + 1))) => {}
                "static" => {
                    let declared = tokens[i..].iter().take_while(|t| t.text != "=" && t.text != ";");
                    let mutable = |t: &&Token| {
                        let named =
                            ["Mutex", "RwLock", "Cell", "RefCell", "UnsafeCell"].contains(&t.text.as_str());
                        named || t.text.starts_with("Atomic")
                    };
                    if let Some(kind) = declared.clone().find(mutable).filter(|_| !self.is_in(&PROGRAM)) {
                        tell(*line, format!("a static {} is state that all bakes share", kind.text));
                    }
                }
                "thread_local" if text(i + 1) == "!" => tell(*line, "thread_local!".to_owned()),
                "print" | "println" | "eprint" | "eprintln" | "dbg"
                    if text(i + 1) == "!"
                        && ["(", "[", "{"].contains(&text(i + 2))
                        && !self.is_in(&PROGRAM) =>
                {
                    tell(*line, format!("{word}!: the library never prints"));
                }
                _ => {}
            }
        }
    }
}

/// All files that are not for tests only.
fn source_files() -> Vec<File> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/src");
    let (mut folders, mut files) = (vec![root.to_owned()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path().to_str().unwrap().replace('\\', "/");
            if fs::metadata(&path).unwrap().is_dir() {
                folders.push(path);
            } else if path.ends_with(".rs") {
                files.push(File::new(&path[root.len() + 1..], &fs::read_to_string(&path).unwrap()));
            }
        }
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    let test_modules: Vec<String> = files
        .iter()
        .flat_map(|file| {
            file.source
                .test_modules
                .iter()
                .map(|name| [&file.module[..], std::slice::from_ref(name)].concat().join("/"))
        })
        .collect();
    files.retain(|file| {
        let module = file.module.join("/");
        !test_modules.iter().any(|tests| module == *tests || module.starts_with(&format!("{tests}/")))
    });
    files
}

#[test]
fn no_forbidden_arrow() {
    let files = source_files();
    assert!(files.len() > 20, "src was not found");
    let macros = files.iter().flat_map(File::macros).collect();
    let found: Vec<String> = files.iter().flat_map(|file| file.violations(&macros)).collect();
    assert!(found.is_empty(), "\n{}\n", found.join("\n"));
}

#[test]
fn every_dependency_has_a_home() {
    let manifest = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let dependencies = manifest.split_once("\n[dependencies]\n").unwrap().1;
    let lines = dependencies.lines().take_while(|line| !line.starts_with('['));
    let names = lines.filter_map(|line| Some(line.split_once('=')?.0.trim().replace('-', "_")));
    for name in names.filter(|name| !name.starts_with('#')) {
        let known = EVERYWHERE.contains(&name.as_str()) || HOMES.iter().any(|(home, _)| *home == name);
        assert!(known, "the dependency {name} has no row in HOMES of tests/architecture.rs");
    }
}

fn violations_of(name: &str, text: &str) -> Vec<String> {
    let macros = Macros::from([("with_tracer".to_owned(), "transport".to_owned())]);
    File::new(name, text).violations(&macros)
}

#[test]
fn planted_violations_are_found() {
    let planted = [
        (
            "transport/build.rs",
            "\nuse crate::solve::Solution;",
            "src/transport/build.rs:2: transport -> solve",
        ),
        ("direct/sun.rs", "use crate::{error::Error, export::write};", "direct -> export"),
        ("solve/mod.rs", "fn f(scene: &crate::scene::Scene) {}", "solve -> scene"),
        ("solve/mod.rs", "use super::atlas::Page;", "solve -> atlas"),
        ("solve/progressive.rs", "use super::super::elements::Elements;", "solve -> elements"),
        ("solve/a/b.rs", "use super::{super::{super::{gather::x, plan::y}}};", "solve -> gather"),
        ("solve/mod.rs", "mod inner { fn f() { super::super::scene::g() } }", "solve -> scene"),
        ("solve/assemble.rs", "use crate::atlas::Page;", "solve -> atlas"),
        ("plan/mod.rs", "crate::with_tracer!(world, f)", "plan -> transport"),
        ("scene/mod.rs", "use crate::import::Document;", "scene -> import"),
        ("gather/mod.rs", "use crate::import::Document;", "gather -> import"),
        ("export/mod.rs", "use crate::cli::say;", "export -> cli"),
        ("bake.rs", "use crate::cli::say;", "bake -> cli"),
        ("elements/mod.rs", "use crate::report::Report;", "elements -> report"),
        ("main.rs", "use lightkiln::solve::Solution;", "main -> solve"),
        ("extra/mod.rs", "use crate::solve::Solution;", "no row"),
        ("units.rs", "use crate::scene::Scene;", "units -> scene"),
        ("solve/mod.rs", "use std::time::Instant;", "std::time"),
        ("solve/mod.rs", "use std::{fmt, time::{Duration, Instant}};", "std::time"),
        ("bake.rs", "let t = std::time::Instant::now();", "std::time"),
        ("import/mod.rs", "std::env::var(\"HOME\")", "std::env"),
        ("import/mod.rs", "use std::process; fn f() { process::exit(1) }", "std::process"),
        ("gather/mod.rs", "std::fs::write(path, bytes)", "std::fs"),
        ("resolve/mod.rs", "writeln!(std::io::stderr(), \"x\")", "standard stream"),
        ("resolve/mod.rs", "fn f() { println!(\"{}\", 'a') }", "println!"),
        ("atlas/mod.rs", "eprintln!{\"x\"}", "eprintln!"),
        ("atlas/unwrap.rs", "unsafe { f() }", "unsafe"),
        ("scene/mod.rs", "static mut N: u32 = 0;", "static mut"),
        ("scene/mod.rs", "static N: std::sync::atomic::AtomicU32 = AtomicU32::new(0);", "static AtomicU32"),
        ("scene/mod.rs", "thread_local! { }", "thread_local!"),
        ("import/mod.rs", "use exr::prelude::*;", "exr is at home"),
        ("export/picture.rs", "use ::exr::prelude as e;", "exr is at home"),
        ("elements/mod.rs", "use obvhs as o;", "obvhs is at home"),
        ("report.rs", "extern crate gltf;", "gltf is at home"),
        ("atlas/mod.rs", "fn f(i: image::RgbImage) {}", "image is at home"),
        ("bake.rs", "indicatif::ProgressBar::hidden()", "indicatif is at home"),
    ];
    for (name, text, expected) in planted {
        let found = violations_of(name, text);
        assert!(found.iter().any(|why| why.contains(expected)), "{name}: {text}\nfound {found:?}");
    }
}

#[test]
fn lawful_source_passes() {
    let lawful = [
        ("gather/mod.rs", "use crate::{Error, direct::Direct, solve::{Solution, ledger}, units::*};"),
        ("atlas/unwrap.rs", "use super::{Page, xatlas}; use crate::plan::Plan; use self::inner::x;"),
        ("atlas/a/b.rs", "use super::super::Page;"),
        ("solve/mod.rs", "mod inner { use super::Solution; } // crate::scene::Scene"),
        ("solve/assemble.rs", "use crate::elements::Patches;"),
        (
            "solve/mod.rs",
            "/* std::time /* */ println!() */ const X: &str = \"use std::time::Instant; \\\" unsafe\";",
        ),
        (
            "solve/mod.rs",
            "const X: &str = r#\"\"unsafe\"\"#; const C: char = '\"'; fn f<'a>(x: &'a str) { x }",
        ),
        ("solve/mod.rs", "#[cfg(test)]\nmod tests { use crate::scene::Scene; fn f() { println!(); } }"),
        (
            "solve/mod.rs",
            "#[cfg(test)] use crate::{scene::Scene}; #[cfg(all(test, unix))] #[x] fn f() { dbg!(1) }",
        ),
        ("export/exr.rs", "use ::exr::prelude as e;"),
        ("export/mod.rs", "mod exr; pub use exr::write;"),
        ("export/carrier.rs", "use super::exr; fn f() { exr::write() }"),
        ("transport/lanes.rs", "unsafe { f() }"),
        ("gather/mod.rs", "crate::with_tracer!(world, f)"),
        ("scene/texture.rs", "static TABLE: std::sync::OnceLock<[f32; 256]> = OnceLock::new();"),
        (
            "cli/bake.rs",
            "use lightkiln::{bake::bake, solve::Solution}; use std::time::Instant; use clap::Parser;",
        ),
        ("main.rs", "use cli::args::Cli; fn f() -> std::process::ExitCode { crate::cli::run() }"),
        ("plan/mod.rs", "let print = 1; if print != 2 { x.exr::<u8>() }"),
    ];
    for (name, text) in lawful {
        let found = violations_of(name, text);
        assert!(found.is_empty(), "{text}\nfound {found:?}");
    }
    assert!(!violations_of("solve/mod.rs", "#[cfg(not(test))] use crate::scene::Scene;").is_empty());
    assert_eq!(read("#[cfg(test)]\nmod tests;\nmod kept;").test_modules, ["tests"]);
}
