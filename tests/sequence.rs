//! `etendue render --frames`: a picture for every frame, named by its number.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

use std::process::Command;

/// A square that moves to the right over two seconds.
const SCENE: &str = r#"<scene version="3.0.0">
    <integrator type="path"/>
    <sensor type="orthographic">
        <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="8"/>
            <rfilter type="box"/></film>
        <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    </sensor>
    <shape type="rectangle">
        <animation name="to_world">
            <transform time="0"><scale value="0.2"/><translate x="-0.6"/></transform>
            <transform time="2"><scale value="0.2"/><translate x="0.6"/></transform>
        </animation>
        <bsdf type="diffuse"/>
    </shape>
    <emitter type="directional"><vector name="direction" value="0,0,-1"/></emitter>
</scene>"#;

fn render(folder: &std::path::Path, arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_etendue"))
        .current_dir(folder)
        .args(["render", "scene.xml", "--spp", "4", "--quiet"])
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_file_for_every_frame() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.xml"), SCENE).unwrap();
    let output =
        render(folder.path(), &["-o", "out.exr", "--frames", "0..2", "--fps", "1", "--stats", "s.json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "out.0000.exr",
            "out.0001.exr",
            "out.0002.exr",
            "s.0000.json",
            "s.0001.json",
            "s.0002.json",
            "scene.xml"
        ]
    );
    // The square is at the left, in the middle, at the right.
    for (frame, column) in [(0, 3), (1, 7), (2, 12)] {
        let file = folder.path().join(format!("out.000{frame}.exr"));
        let picture = etendue::load::read_image(&file, &etendue::load::LoadOptions::default()).unwrap();
        let etendue::desc::Pixels::F32(pixels) = &picture.pixels else { panic!("floats") };
        let red = |x: usize| pixels[(4 * 16 + x) * picture.channels as usize];
        let lit: Vec<usize> = (0..16).filter(|x| red(*x) > 0.05).collect();
        assert!(lit.contains(&column) && lit.len() <= 5, "frame {frame}: {lit:?}");
    }
    // The same frame alone is the same picture.
    let alone = render(folder.path(), &["-o", "alone.exr", "--frame", "1", "--fps", "1"]);
    assert!(alone.status.success());
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("alone.exr"), bytes("out.0001.exr"));
}

#[test]
fn wrong_use() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.xml"), SCENE).unwrap();
    for arguments in [["--frames", "3..1"], ["--frames", "x"], ["--shutter", "1"], ["--fps", "0"]] {
        let mut all = vec!["-o", "out.exr"];
        all.extend(arguments);
        assert_eq!(render(folder.path(), &all).status.code(), Some(2), "{arguments:?}");
    }
    let output = render(folder.path(), &["-o", "out.exr", "--sun"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: --sun is for glTF files; "));
}
