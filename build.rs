//! With the feature `embree`: checks that the linker finds Embree 3, so that
//! its absence is told here and not by a page of linker arguments. Without the
//! feature there is nothing to do.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    if env::var_os("CARGO_FEATURE_EMBREE").is_none() {
        return;
    }
    let folder = env::var_os("EMBREE_DIR").map(|dir| PathBuf::from(dir).join("lib"));
    // The crate `embree3` tells the linker where to look; the program must
    // find the library there too when it runs.
    if let Some(folder) = &folder
        && env::var_os("CARGO_CFG_UNIX").is_some()
    {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", folder.display());
    }
    if links(folder.as_deref()) == Some(false) {
        let place = match &folder {
            Some(folder) => format!("neither in `{}` (from EMBREE_DIR) nor ", folder.display()),
            None => "not ".to_owned(),
        };
        println!(
            "cargo::error=the feature `embree` needs Embree 3, and libembree3 is {place}where the linker looks"
        );
        println!(
            "cargo::error=install it (Debian 12: `apt-get install libembree-dev`), or set EMBREE_DIR to the folder that has lib/libembree3.so in it, or build without `--features embree`"
        );
    }
}

/// Whether a C program links with Embree; `None` when that cannot be tried:
/// no C compiler, or a build for another machine.
fn links(folder: Option<&Path>) -> Option<bool> {
    if env::var("HOST") != env::var("TARGET") || env::var_os("CARGO_CFG_UNIX").is_none() {
        return None;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR")?);
    let source = out.join("links.c");
    std::fs::write(&source, "int rtcNewDevice(const char*);\nint main(void) { return rtcNewDevice(0); }\n")
        .ok()?;
    let compiler = env::var_os("CC").unwrap_or_else(|| "cc".into());
    let mut command = Command::new(compiler);
    command.arg(&source).arg("-o").arg(out.join("links"));
    if let Some(folder) = folder {
        command.arg("-L").arg(folder);
    }
    Some(command.arg("-lembree3").output().ok()?.status.success())
}
