//! Disks that are full, names that cannot be written, programs that are
//! killed: the file that was there stays, nothing half-written has its name,
//! and the message says what happened.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use etendue::load::read_picture;

const SCENE: &str = r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><transform name="to_world"><lookat origin="0,2,4" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="64"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform></shape>
<shape type="sphere"><float name="radius" value="0.5"/></shape>
<emitter type="point"><point name="position" x="1" y="2" z="3"/></emitter></scene>"#;

/// A folder with the scene, and one for temporary files in it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("scene.xml"), SCENE).expect("a scene");
    fs::create_dir(folder.path().join("tmp")).expect("a folder");
    folder
}

fn shell(folder: &Path, line: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_etendue")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let mut command = Command::new("bash");
    command.args(["-c", line]).current_dir(folder);
    command.env("PATH", path).env("TMPDIR", folder.join("tmp")).output().expect("a shell")
}

/// Fails with 1; gives the message.
fn failing(folder: &Path, line: &str) -> String {
    let output = shell(folder, line);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{line}: {said}");
    said
}

fn passing(folder: &Path, line: &str) -> String {
    let output = shell(folder, line);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{line}: {said}");
    said
}

/// Names in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("a folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

const RENDER: &str = "etendue render scene.xml -q --spp 1";

/// More samples than anybody waits for: what fails with them fails at once.
const FOREVER: &str = "etendue render scene.xml -q --spp 1000000000";

#[test]
fn a_full_disk_leaves_the_old_files() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    passing(folder.path(), &format!("{RENDER} -o a.exr --png a.png --stats s.json --seed 1"));
    let before = ["a.exr", "a.png", "s.json"].map(|name| fs::read(at(name)).expect("a file"));
    // Files of 1 KiB at most: a signal that is ignored becomes an error.
    let full = |line: &str| failing(folder.path(), &format!("trap '' XFSZ; ulimit -f 1; exec {line}"));
    let said = full(&format!("{RENDER} -o a.exr --png a.png --stats s.json --seed 2"));
    assert!(said.contains("error: cannot write `a.exr`: File too large (os error 27)"), "{said}");
    assert!(said.contains("`ulimit -f`") && said.contains("nor could it be saved elsewhere"), "{said}");
    for name in ["-o a.png", "-o new.png", "-o new.exr"] {
        let said = full(&format!("{RENDER} {name}"));
        assert!(said.contains("File too large"), "{said}");
    }
    let after = ["a.exr", "a.png", "s.json"].map(|name| fs::read(at(name)).expect("a file"));
    assert!(before == after);
    assert_eq!(names(folder.path()), ["a.exr", "a.png", "s.json", "scene.xml", "tmp"]);
    assert!(names(&at("tmp")).is_empty());

    // A study keeps its finished runs, says so, and goes on when there is room.
    let study = "etendue study scene.xml -o study --spp 1..2 --repeats 3 -q";
    let said = full(study);
    assert!(said.contains("error: cannot write `study/runs/"), "{said}");
    assert!(names(&at("study/runs")).is_empty());
    passing(folder.path(), study);
    let report = fs::read(at("study/index.html")).expect("a report");
    let said = failing(folder.path(), &format!("trap '' XFSZ; ulimit -f 16; exec {study} --report-only"));
    assert!(said.contains("File too large"), "{said}");
    assert!(fs::read(at("study/index.html")).expect("a report") == report);
    assert!(names(&at("study")).iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn a_picture_that_cannot_be_written_is_saved_elsewhere() {
    let folder = folder();
    passing(folder.path(), &format!("{RENDER} -o good.exr"));
    let good = fs::read(folder.path().join("good.exr")).expect("a picture");
    let rescued = |said: &str| -> PathBuf {
        let rest = said.split("the picture is not lost: it is in `").nth(1).expect(said);
        PathBuf::from(rest.split('`').next().expect(said))
    };
    // A device that is always full.
    symlink("/dev/full", folder.path().join("full.exr")).expect("a link");
    let said = failing(folder.path(), &format!("{RENDER} -o full.exr --stats s.json"));
    assert!(
        said.starts_with("error: cannot write `full.exr`: No space left on device (os error 28)"),
        "{said}"
    );
    assert!(said.contains("make room on the disk of"), "{said}");
    assert!(fs::read(rescued(&said)).expect("a picture") == good);
    assert!(folder.path().join("s.json").is_file());

    // A folder that goes away while it is being rendered.
    fs::create_dir(folder.path().join("gone")).expect("a folder");
    let line = "(sleep 0.7; rm -r gone) & etendue render scene.xml -q --time 2 -o gone/a.exr --png";
    let said = failing(folder.path(), line);
    assert!(said.starts_with("error: cannot write `gone/a.exr`: No such file or directory"), "{said}");
    assert!(said.contains("make the folder `gone` first"), "{said}");
    let saved = rescued(&said);
    assert!(read_picture(&saved).is_ok() && saved.starts_with(folder.path().join("tmp")));
    // The preview too.
    assert_eq!(names(&folder.path().join("tmp")).iter().filter(|n| n.ends_with("a.png")).count(), 1);
}

/// Killed at forty moments, from the start to after the end: what is there is
/// a whole file, the old or the new one.
#[test]
fn killed_at_any_moment() {
    let folder = folder();
    let line = |seed: u32| format!("{RENDER} -o a.exr --png a.png --size 256x192 --seed {seed}");
    let read = |name: &str| fs::read(folder.path().join(name)).expect("a file");
    let mut good = Vec::new();
    let mut longest = Duration::ZERO;
    for seed in [1, 0] {
        let clock = Instant::now();
        passing(folder.path(), &line(seed));
        longest = longest.max(clock.elapsed());
        good.push((read("a.exr"), read("a.png")));
    }
    assert!(good[0].0 != good[1].0);
    let (mut new, mut killed) = (0, 0);
    for turn in 0..40u32 {
        let before = read("a.exr");
        let mut child = Command::new(env!("CARGO_BIN_EXE_etendue"))
            .args(line(turn % 2).split(' ').skip(1))
            .current_dir(folder.path())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program runs");
        // Spread over the time that it takes, most of them in its second half.
        let share = (f64::from(turn * 17 % 40) / 40.0).sqrt() * 1.1;
        std::thread::sleep(longest.mul_f64(share));
        killed += u32::from(child.kill().is_ok() && !child.wait().expect("an end").success());
        let picture = read("a.exr");
        assert!(good.iter().any(|(exr, _)| *exr == picture), "turn {turn}: a broken file");
        assert!(good.iter().any(|(_, png)| *png == read("a.png")), "turn {turn}: a broken preview");
        read_picture(&folder.path().join("a.exr")).expect("a picture");
        new += u32::from(picture != before);
    }
    assert!(killed >= 10, "{killed} kills came in time");
    assert!(new >= 1, "no run got to its end");
    // What a kill may leave is written over and gone.
    fs::write(folder.path().join("a.exr.part"), b"half a file").expect("written");
    passing(folder.path(), &line(1));
    assert!(read("a.exr") == good[0].0);
    assert!(!folder.path().join("a.exr.part").exists());
}

#[test]
fn what_cannot_be_written_is_noticed_before_the_work() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), b"x").expect("written");
    fs::create_dir(at("b.exr")).expect("a folder");
    fs::write(at("c.exr"), b"precious").expect("written");
    fs::set_permissions(at("c.exr"), fs::Permissions::from_mode(0o444)).expect("set");
    symlink("loop2.exr", at("loop1.exr")).expect("a link");
    symlink("loop1.exr", at("loop2.exr")).expect("a link");
    symlink("gone/a.exr", at("lost.exr")).expect("a link");
    for (output, expected) in [
        ("-o file/a.exr", "error: cannot write `file/a.exr`: there is no folder `file`\n"),
        (
            "-o /proc/a.exr",
            "error: cannot write `/proc/a.exr`: No such file or directory (os error 2); make the folder `/proc` first\n",
        ),
        (
            "-o b.exr",
            "error: cannot write `b.exr`: there is a folder of that name; give the name of a file\n",
        ),
        (
            "-o c.exr",
            "error: cannot write `c.exr`: the file is write-protected; allow writing (`chmod u+w`), or give another name\n",
        ),
        (
            "-o loop1.exr",
            "error: cannot write `loop1.exr`: too many symbolic links; the folder `.` must be there and writable\n",
        ),
        (
            "-o lost.exr",
            "error: cannot write `lost.exr`: No such file or directory (os error 2); make the folder `.` first\n",
        ),
        (
            "-o a.exr --stats ./a.exr",
            "error: cannot write `./a.exr`: it is the same file as `a.exr`; give each a name of its own\n",
        ),
        (
            "-o a.png --png ../a.png --stats a.png",
            "error: cannot write `a.png`: it is the same file as `a.png`; give each a name of its own\n",
        ),
        (
            "-o a.exr --stats scene.xml",
            "error: cannot write `scene.xml`: it is the same file as `scene.xml`; give each a name of its own\n",
        ),
        (
            "-o a.exr --stats b.exr",
            "error: cannot write `b.exr`: there is a folder of that name; give the name of a file\n",
        ),
        ("-o a.txt", "error: cannot write `a.txt`: unknown format; name it *.exr or *.png\n"),
    ] {
        let clock = Instant::now();
        assert_eq!(failing(folder.path(), &format!("timeout 60 {FOREVER} {output}")), expected, "{output}");
        assert!(clock.elapsed() < Duration::from_secs(50), "{output}");
    }
    assert_eq!(fs::read(at("c.exr")).expect("a file"), b"precious");
    assert!(names(folder.path()).iter().all(|name| !name.ends_with(".part") && name != "a.exr"));
}

#[test]
fn another_program_is_writing_the_same_file() {
    let folder = folder();
    let part = fs::File::create(folder.path().join("a.exr.part")).expect("a file");
    part.lock().expect("a lock");
    let said = failing(folder.path(), &format!("timeout 60 {FOREVER} -o a.exr"));
    assert_eq!(
        said,
        "error: cannot write `a.exr`: another program is writing it; give each program a file of its own\n"
    );
    drop(part);
    passing(folder.path(), &format!("{RENDER} -o a.exr"));
    assert_eq!(names(folder.path()), ["a.exr", "scene.xml", "tmp"]);
}

/// Links are followed, devices stay devices, permissions stay.
#[test]
fn links_devices_and_permissions_stay() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("real")).expect("a folder");
    fs::write(at("real/a.exr"), b"old").expect("written");
    fs::set_permissions(at("real/a.exr"), fs::Permissions::from_mode(0o640)).expect("set");
    symlink("real/a.exr", at("a.exr")).expect("a link");
    symlink("real/new.png", at("a.png")).expect("a link");
    symlink("/dev/null", at("s.json")).expect("a link");
    // A link in place of the unfinished file is not followed.
    fs::write(at("other"), b"not ours").expect("written");
    symlink("../other", at("real/a.exr.part")).expect("a link");
    passing(folder.path(), &format!("{RENDER} -o a.exr --png --stats s.json"));
    assert_eq!(fs::read_link(at("a.exr")).expect("a link"), Path::new("real/a.exr"));
    assert!(read_picture(&at("real/a.exr")).is_ok() && read_picture(&at("real/new.png")).is_ok());
    assert_eq!(fs::metadata(at("real/a.exr")).expect("a file").permissions().mode() & 0o777, 0o640);
    assert_eq!(fs::read(at("other")).expect("a file"), b"not ours");
    assert_eq!(names(&at("real")), ["a.exr", "new.png"]);
    assert!(fs::symlink_metadata("/dev/null").expect("a device").file_type().is_char_device());
    assert!(names(&at("tmp")).is_empty());
    // A pipe takes what a file would.
    let line = format!("mkfifo p.exr; cat p.exr > copy.exr & {RENDER} -o p.exr; wait");
    passing(folder.path(), &line);
    assert!(fs::read(at("copy.exr")).expect("a copy") == fs::read(at("a.exr")).expect("a picture"));
}

/// Terminals that are gone and full outputs.
#[test]
fn nobody_listens() {
    let folder = folder();
    let render = "etendue render scene.xml --spp 4 -o a.exr";
    for closed in ["2>/dev/full", "2>&-", ">&- 2>&-", "2> >(exec true)", "2>&1 | head -c 1"] {
        passing(folder.path(), &format!("set -o pipefail; rm -f a.exr; {render} {closed}"));
        assert!(read_picture(&folder.path().join("a.exr")).is_ok(), "{closed}");
    }
    for command in ["explain scene.xml", "replay scene.xml 30,30", "compare a.exr a.exr --json"] {
        let said = failing(folder.path(), &format!("etendue {command} >/dev/full"));
        assert_eq!(
            said,
            "error: cannot write the results to stdout: No space left on device (os error 28)\n"
        );
        passing(folder.path(), &format!("set -o pipefail; etendue {command} | head -c 1 >/dev/null"));
        passing(folder.path(), &format!("etendue {command} >&-"));
    }
}
