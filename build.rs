//! Compiles xatlas (C++) with the shim of `src/atlas`.
//!
//! The source of xatlas comes from the package `xatlas-rs-v2`, which `Cargo.toml` declares for no platform: cargo
//! pins and fetches it, but never builds it, because its own build script needs libclang. A C++ compiler is enough
//! here. `LIGHTKILN_XATLAS_DIR`, a folder that holds `xatlas.cpp`, replaces the fetched source.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGE: &str = "xatlas-rs-v2";
const SHIM: &str = "src/atlas/xatlas_shim.cpp";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=Cargo.lock");
    println!("cargo::rerun-if-changed={SHIM}");
    println!("cargo::rerun-if-env-changed=LIGHTKILN_XATLAS_DIR");
    let source = match env::var_os("LIGHTKILN_XATLAS_DIR") {
        Some(folder) => PathBuf::from(folder),
        None => fetched_source().unwrap_or_else(|why| fail(&why)),
    };
    let main_file = source.join("xatlas.cpp");
    if !main_file.is_file() {
        fail(&format!("{} does not exist", main_file.display()));
    }
    println!("cargo::rerun-if-changed={}", main_file.display());
    let built = cc::Build::new()
        .cpp(true)
        // Without threads it leans on an aggregate rule of C++14.
        .std("c++14")
        .warnings(false)
        .opt_level(3)
        .debug(false)
        // An assert would abort the whole bake; the shim checks the input instead.
        .define("NDEBUG", None)
        // Its workers spin while they wait. Geometries are unwrapped in parallel instead.
        .define("XA_MULTITHREADED", "0")
        .include(&source)
        .file(SHIM)
        .try_compile("lightkiln_xatlas");
    if let Err(error) = built {
        fail(&format!(
            "xatlas could not be compiled. A C++ compiler is needed: on Debian or Ubuntu `apt install g++`, on \
             Fedora `dnf install gcc-c++`, on macOS `xcode-select --install`, on Windows the C++ build tools of \
             Visual Studio. The compiler said: {error}"
        ));
    }
}

/// Asks cargo where it keeps the package; lets it fetch when it does not have it yet.
fn fetched_source() -> Result<PathBuf, String> {
    let mut said = String::new();
    for fetch in [false, true] {
        match metadata(fetch) {
            Ok(json) => {
                let manifest = manifest_path(&json)
                    .ok_or_else(|| format!("`cargo metadata` does not list the package {PACKAGE}"))?;
                return Ok(manifest.parent().unwrap_or(Path::new(".")).join("vendor/source/xatlas"));
            }
            Err(why) => said = why,
        }
    }
    Err(format!(
        "the source of xatlas (package {PACKAGE}) could not be fetched. The first build needs the network; after \
         that none. cargo said:\n{said}"
    ))
}

fn metadata(fetch: bool) -> Result<String, String> {
    let root = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from).unwrap_or_default();
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(&root).args(["metadata", "--locked", "--format-version", "1", "--manifest-path"]);
    command.arg(root.join("Cargo.toml"));
    if !fetch {
        command.arg("--offline");
    }
    // What cargo tells build scripts is about this build, not about the question.
    for (name, _) in env::vars_os() {
        let text = name.to_string_lossy();
        let ours =
            ["CARGO_PKG_", "CARGO_CFG_", "CARGO_FEATURE_", "CARGO_ENCODED_", "CARGO_MANIFEST_", "DEP_"];
        if ours.iter().any(|prefix| text.starts_with(prefix))
            || text == "RUSTFLAGS"
            || text == "CARGO_MAKEFLAGS"
        {
            command.env_remove(&name);
        }
    }
    let output = command.output().map_err(|error| format!("cargo could not be started: {error}"))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// The `manifest_path` of the package in cargo's JSON. A JSON parser only for this would be one more thing to build.
fn manifest_path(json: &str) -> Option<PathBuf> {
    json.split("\"manifest_path\":\"").skip(1).find_map(|rest| {
        let mut path = String::new();
        let mut letters = rest.chars();
        loop {
            match letters.next()? {
                '"' => break,
                '\\' => path.push(letters.next()?),
                letter => path.push(letter),
            }
        }
        let path = PathBuf::from(path);
        let folder = path.parent()?.file_name()?.to_str()?;
        folder.starts_with(PACKAGE).then_some(path)
    })
}

fn fail(why: &str) -> ! {
    for line in why.lines() {
        println!("cargo::error={line}");
    }
    std::process::exit(1);
}
