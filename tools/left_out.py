#!/usr/bin/env python3
"""What an effect costs in scenes that do not have it.

    python tools/left_out.py [FOLDER] [--only PART ...] [--scene SCENE.xml ...] [--size 64x64] [--spp 32]

Copies the sources to FOLDER (a temporary one by default), takes one effect out at
a time by small changes of the source, builds with the release profile, and counts
instructions per path (callgrind, one thread; loading drops out, since it is the
difference of two renders) beside the unchanged program. Prints Markdown; exits 1
when some effect costs more than 1 %, or when the code that a change replaces is
no longer there. Each build takes minutes.
"""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIRST = 8  # samples per pixel of the render that is subtracted

PATH, INTEGRATOR, SCENE = "src/integrator/path.rs", "src/integrator/mod.rs", "src/scene/mod.rs"

# effect: (file, what is there, what takes its place)
WITHOUT = {
    "media": [
        (PATH, "if self.medium != Medium::NONE {", "if false {"),
        (PATH, "medium: if self.see_through { scene.camera_medium() } else { Medium::NONE },", "medium: Medium::NONE,"),
        (PATH, "            medium: self.medium,\n", "            medium: Medium::NONE,\n"),
        (PATH, "        if self.see_through {\n            state.from", "        if false {\n            state.from"),
        (INTEGRATOR, "(scene.plan.alpha || scene.has_media())", "scene.plan.alpha"),
    ],
    "surfaces to see through (volpath)": [
        (PATH, "let free = sample.null && self.see_through;", "let free = false;"),
        (INTEGRATOR, "if see_through && (scene.plan.alpha || scene.has_media()) {", "if false && see_through {"),
    ],
    "dispersion": [
        (PATH, "if scene.plan.dispersion && self.wavelength == 0.0 &&", "if false &&"),
        (PATH, "if let Some(colour) = hit.split(sample.wi) {", "if let Some(colour) = None::<Rgb> {"),
        (PATH, "            wavelength: self.wavelength,\n", "            wavelength: 0.0,\n"),
    ],
    "motion blur": [
        (INTEGRATOR, "if scene.plan.motion { sampler.get_1d(dimension::TIME) } else { 0.0 }", "0.0"),
        (INTEGRATOR, "    if scene.plan.motion {\n", "    if false {\n"),
        (SCENE, "        match &self.camera_motion {\n", "        match &None::<CameraMotion> {\n"),
        ("src/shape/surface.rs", "            time: self.time,\n", "            time: 0.0,\n"),
    ],
    "instances": [
        ("src/shape/geometry.rs", "        if hit.instance != Hit::NO_INSTANCE {\n", "        if false {\n"),
        ("src/shape/surface.rs", "skip_instance: self.instance,", "skip_instance: Ray::NO_SKIP,"),
        (
            "src/shape/probe.rs",
            "skip: if ray.skip_instance == Ray::NO_SKIP { ray.skip } else { Ray::NO_SKIP },",
            "skip: ray.skip,",
        ),
    ],
    "lens": [
        (INTEGRATOR, "if scene.plan.lens { sampler.get_2d(dimension::LENS) } else { Vec2::splat(0.5) }", "Vec2::splat(0.5)"),
    ],
    "texture filter": [
        (INTEGRATOR, "        if scene.plan.pyramid_bytes == 0 {\n", "        if true {\n"),
        (SCENE, "let Traits { tangents, two_sided, attributes, filtered, .. } = self.traits[index];",
         "let (Traits { tangents, two_sided, attributes, .. }, filtered) = (self.traits[index], false);"),
    ],
    "mesh attributes": [
        (SCENE, "let Traits { tangents, two_sided, attributes, filtered, .. } = self.traits[index];",
         "let (Traits { tangents, two_sided, filtered, .. }, attributes) = (self.traits[index], false);"),
    ],
    "lamps that move or are instanced": [
        (SCENE, "            None => self.emitted_by_placed(index, surface, wo),\n", "            None => Rgb::ZERO,\n"),
        (SCENE, "        if index as usize >= self.lights.len() {\n", "        if false {\n"),
    ],
}


def build(folder):
    command = ["cargo", "build", "--locked", "--quiet", "--release"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"it does not build:\n{run.stderr[-3000:]}")
    return folder / "target/release/etendue"


def instructions(program, scene, size, spp):
    """Per path."""
    def total(samples):
        with tempfile.TemporaryDirectory() as out:
            command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, "render", scene]
            command += ["-o", f"{out}/out.exr", "--size", size, "--spp", str(samples), "--threads", "1", "--quiet", "--reuse", "1"]
            run = subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True)
        return int(re.search(r"Collected : (\d+)", run.stderr)[1])

    width, height = map(int, size.split("x"))
    return (total(FIRST + spp) - total(FIRST)) / (spp * width * height)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--only", action="append", metavar="PART", help="effects whose name contains it; repeatable")
    parser.add_argument("--scene", action="append", type=pathlib.Path)
    parser.add_argument("--size", default="64x64")
    parser.add_argument("--spp", type=int, default=32)
    args = parser.parse_args()
    scenes = args.scene or [ROOT / f"scenes/{name}/scene.xml" for name in ("cornell-box", "teapot-env")]
    folder = args.folder or pathlib.Path(tempfile.mkdtemp(prefix="etendue-left-out-"))
    for part in ("src", "benches", "Cargo.toml", "Cargo.lock", "build.rs", "rust-toolchain.toml"):
        source, target = ROOT / part, folder / part
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        elif source.exists():
            shutil.copy(source, target)
    count = lambda: [instructions(build(folder), scene, args.size, args.spp) for scene in scenes]
    whole, worst = count(), 0.0
    print("| without | " + " | ".join(scene.parent.name for scene in scenes) + " |\n|-|" + "-|" * len(scenes))
    print("| nothing | " + " | ".join(f"{n:.0f}" for n in whole) + " |", flush=True)
    for effect, changes in WITHOUT.items():
        if args.only and not any(part in effect for part in args.only):
            continue
        originals = {}
        for name, there, instead in changes:
            text = (folder / name).read_text()
            originals.setdefault(name, text)
            if there not in text:
                sys.exit(f"{effect}: {name} no longer has: {there.strip()}")
            (folder / name).write_text(text.replace(there, instead))
        costs = [a / b - 1 for a, b in zip(whole, count())]
        worst = max(worst, *costs)
        print(f"| {effect} | " + " | ".join(f"{100 * c:+.2f} %" for c in costs) + " |", flush=True)
        for name, text in originals.items():
            (folder / name).write_text(text)
    if not args.folder:
        shutil.rmtree(folder)
    sys.exit(1 if worst > 0.01 else 0)


if __name__ == "__main__":
    main()
