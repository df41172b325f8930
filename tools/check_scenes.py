#!/usr/bin/env python3
"""Renders every scene of a folder of Mitsuba render tests and judges it twice.

    tools/check_scenes.py target/release/etendue FOLDER [--only PART] [--csv FILE] [--mitsuba]
    tools/check_scenes.py target/release/etendue SCENE.xml --mitsuba -D resx=96 -D resy=54
    tools/check_scenes.py target/release/etendue FOLDER --mitsuba --scenes [--width 96]
    tools/check_scenes.py target/release/etendue SCENE.xml --mitsuba [--place=1,0,0 --scale 16] [--offset 0.0625]

FOLDER holds scenes `…/test_NAME_INTEGRATOR.xml` and beside them
`refs/test_NAME_ref_rgb.exr` with `…_var.exr`, as Mitsuba's own test data does.
Scenes with participating media are left out, and listed.

Mitsuba's rule (its test_renders.py): 2e6 samples a scene;
z = |x - ref| sqrt(spp / max(var, 1e-4)) in XYZ; a value passes when its
two-sided p exceeds 1 - (1 - 0.01)^(1/pixels); the scene when 99.75 % do.

Ours: 16 seeds, Welch's t on the means of the whole picture and of 8 x 8
blocks, the reference's own noise included (its variance is that of one
sample; how many it had is not in the file: --ref-spp, 32000). A level fails
when its least p, corrected for how many values it has (Sidak), is below 1e-3
and the difference is above 6e-4: as much as Mitsuba's float film drifts in
32,000 samples of a constant pixel.

With --mitsuba the second judgement is against pictures that Mitsuba renders
then and there, 16 seeds of as many samples (pip install mitsuba; scalar_rgb, or
llvm_ad_rgb where DRJIT_LIBLLVM_PATH is set): Welch's t of two means with the
scatter of both, and differences count from 1e-4 on. References in a folder may
be of another Mitsuba: these have a tint of 0.1 % in red, and their film is a
float one. One scene file alone is judged in this way only, and so is, after the
render tests, each `scene.xml` below FOLDER with --scenes, with its parameters
`resx` and `resy` made small. Those whose media scatter are left out, and listed.

Mitsuba's rays begin (1 + max|p|) 8.9e-5 off the surface. Two options judge a
single scene again, with less of that; our own side is the scene as it stands each
time. --place X,Y,Z --scale K: against Mitsuba's picture of a copy that is moved so
that this place is the origin, and then made K times as large, a power of two.
--offset SHARE: against Mitsuba's `path` with this share of the offset everywhere
(tools/mitsuba_near.py; llvm_ad_rgb), and with --shadow SHARE of what its shadow rays
end early.

Prints one line per scene and exits 1 when one fails.
"""
import argparse
import csv
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

import numpy as np
import OpenImageIO as oiio
from scipy import stats

SEEDS = 16
DRIFT = 6e-4
TO_XYZ = np.array([[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]])
# Integrators of Mitsuba that estimate what ours does.
SAME = {"ptracer": "path"}


def read(path):
    image = oiio.ImageInput.open(str(path))
    if image is None:
        sys.exit(f"{path}: {oiio.geterror()}")
    pixels = image.read_image("float")
    names = list(image.spec().channelnames)
    image.close()
    wanted = [next(i for i, n in enumerate(names) if n.split(".")[-1] == c) for c in "RGB"]
    return np.asarray(pixels, np.float64)[:, :, wanted]


def render(program, scene, spp, seed, integrator, folder, defines=()):
    out = pathlib.Path(folder) / f"{seed}.exr"
    command = [program, "render", str(scene), "-o", str(out), "--spp", str(spp), "--seed", str(seed), "-q"]
    for define in defines:
        command += ["-D", define]
    if integrator in SAME:
        command += ["--integrator", SAME[integrator]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr.strip().splitlines()[-1]
    return read(out)


def for_mitsuba(scene, moved=None, offset=None, shadow=1.0):
    """The scene file's text, robust intersections switched on (without, rays of Embree miss edges; with
    curves, they crash)."""
    root = xml.parse(scene).getroot()
    if not any("curve" in shape.get("type", "") for shape in root.iter("shape")):
        xml.SubElement(root, "boolean", name="embree_use_robust_intersections", value="true")
    if moved:
        move_all(scene, root, *moved)
    if offset is not None:
        integrator = root.find("integrator")
        if integrator.get("type") != "path":
            sys.exit(f"{scene}: --offset is for the integrator path")
        integrator.set("type", "near")
        xml.SubElement(integrator, "float", name="share", value=repr(offset))
        xml.SubElement(integrator, "float", name="shadow_share", value=repr(shadow))
    return xml.tostring(root, encoding="unicode")


def move_all(scene, root, place, scale):
    """Puts `place` at the origin and makes everything `scale` times as large."""
    lengths = {"near_clip", "far_clip", "focus_distance"}

    def move(thing):
        transform = thing.find("transform[@name='to_world']")
        if transform is None:
            transform = xml.SubElement(thing, "transform", name="to_world")
        if thing.tag == "sensor":  # which refuses to be scaled: its axes keep their length
            transform.insert(0, xml.Element("scale", value=repr(1 / scale)))
        xml.SubElement(transform, "translate", **{axis: repr(-p) for axis, p in zip("xyz", place)})
        xml.SubElement(transform, "scale", value=repr(scale))

    for thing in root:
        kind = thing.get("type")
        if thing.tag == "sensor" or (thing.tag == "shape" and kind != "shapegroup"):
            move(thing)
        elif thing.tag == "emitter" and kind not in ("constant", "directional"):
            sys.exit(f"{scene}: emitter {kind} cannot be moved")
    if root.find(".//animation") is not None or root.find(".//bsdf[@type='bumpmap']") is not None:
        sys.exit(f"{scene}: animations and bump maps cannot be moved")
    for medium in root.iter("medium"):
        density = medium.find("*[@name='scale']")
        if density is None:
            density = xml.SubElement(medium, "float", name="scale", value="1")
        density.set("value", repr(float(density.get("value")) / scale))
    for number in root.find("sensor").iter("float"):
        if number.get("name") in lengths:
            number.set("value", repr(float(number.get("value")) * scale))


def render_mitsuba(scene, spp, integrator, defines=(), moved=None, offset=None, shadow=1.0):
    """One picture per seed, as Mitsuba renders them now; of a copy elsewhere if `moved` (place, scale),
    with those shares of its ray offset and of its shadow rays' ends if there is an `offset`."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "DRJIT_LIBLLVM_PATH" in os.environ else "scalar_rgb")
    values = dict(define.split("=", 1) for define in defines)
    if integrator in SAME:
        values["integrator"] = SAME[integrator]
    if offset is not None:
        import mitsuba_near  # noqa: F401: registers the integrator
    mi.file_resolver().prepend(str(scene.resolve().parent))
    loaded = mi.load_string(for_mitsuba(scene, moved, offset, shadow), **values)
    # The first three channels are the colour, also of `moment`.
    render = lambda seed: np.array(mi.render(loaded, spp=spp, seed=1000 + seed), np.float64)[:, :, :3]
    return np.array([render(seed) for seed in range(SEEDS)])


def judge_pair(ours, theirs):
    """p by level of two sets of pictures, and how far the means are apart."""
    levels = {}
    for name, reduce in (("mean", lambda i: i.reshape(-1, 3).mean(axis=0)), ("blocks", blocks)):
        a, b = (np.array([reduce(p) for p in pictures]) for pictures in (ours, theirs))
        va, vb = (x.var(axis=0, ddof=1) / SEEDS for x in (a, b))
        difference, variance = a.mean(axis=0) - b.mean(axis=0), va + vb
        freedom = np.divide(variance**2 * (SEEDS - 1), va**2 + vb**2, out=np.ones_like(va), where=variance > 0)
        t = np.divide(np.abs(difference), np.sqrt(variance), out=np.zeros_like(va), where=variance > 0)
        significant = np.abs(difference) > 1e-4 * np.maximum(np.abs(b.mean(axis=0)), theirs.mean())
        p = np.where(significant, 2 * stats.t.sf(t, freedom), 1.0)
        levels[name] = sidak(p.min(), len(p))
    noise = np.hypot(*(x.mean(axis=(1, 2, 3)).std(ddof=1) / np.sqrt(SEEDS) for x in (ours, theirs)))
    return levels, ours.mean() / theirs.mean() - 1, noise / theirs.mean()


def sidak(p, count):
    return -np.expm1(count * np.log1p(-min(p, 1 - 1e-16)))


def blocks(image):
    h, w = (image.shape[0] // 8 * 8, image.shape[1] // 8 * 8)
    part = image[:h, :w].reshape(h // 8, 8, w // 8, 8, -1)
    return part.mean(axis=(1, 3)).reshape(-1)


def judge(pictures, reference, variance, ref_spp, spp):
    """Share of values that pass Mitsuba's rule, and our p by level."""
    mean = np.mean(pictures, axis=0)
    pixels = mean.shape[0] * mean.shape[1]
    xyz = lambda image: image @ TO_XYZ.T
    # Mitsuba's script takes the variances, too, through the matrix.
    z = np.abs(xyz(mean) - xyz(reference)) * np.sqrt(spp * len(pictures) / np.maximum(xyz(variance), 1e-4))
    alpha = 1 - (1 - 0.01) ** (1 / pixels)
    accepted = np.mean(2 * stats.norm.sf(z) > alpha)
    levels = {}
    for name, reduce in (("mean", lambda i: i.reshape(-1, 3).mean(axis=0)), ("blocks", blocks)):
        values = np.array([reduce(p) for p in pictures])
        truth = reduce(reference)
        own = values.var(axis=0, ddof=1) / len(pictures)
        per_value = pixels if name == "mean" else 64
        theirs = reduce(np.maximum(variance, 0.0)) / per_value / ref_spp
        difference = values.mean(axis=0) - truth
        spread = np.sqrt(own + theirs)
        t = np.divide(difference, spread, out=np.zeros_like(difference), where=spread > 0)
        significant = np.abs(difference) > DRIFT * np.maximum(np.abs(truth), reference.mean())
        p = np.where(significant, 2 * stats.t.sf(np.abs(t), len(pictures) - 1), 1.0)
        levels[name] = sidak(p.min(), len(p))
    relative = (mean.mean() - reference.mean()) / reference.mean()
    return accepted, levels, relative


def against_mitsuba(program, scene, spp, defines, ways=({},)):
    """One scene file against Mitsuba: for each way to render it there, levels, what the mean is off by, its
    noise; or a message."""
    with tempfile.TemporaryDirectory() as folder:
        ours = [render(program, scene, spp, s, "", folder, defines) for s in range(SEEDS)]
    if isinstance(ours[0], str):
        return ours[0]
    return [judge_pair(np.array(ours), render_mitsuba(scene, spp, "", defines, **way)) for way in ways]


def single(args):
    ways = {"": {}}
    if args.place:
        place = ", ".join(f"{c:g}" for c in args.place)
        ways[f", {place} at Mitsuba's origin, {args.scale:g} times as large"] = {"moved": (args.place, args.scale)}
    if args.offset is not None:
        end = f", {args.shadow:g} of its shadow rays' ends" if args.shadow != 1 else ""
        ways[f", {args.offset:g} of Mitsuba's offset{end}"] = {"offset": args.offset, "shadow": args.shadow}
    found = against_mitsuba(args.program, args.folder, args.spp, args.define, ways.values())
    if isinstance(found, str):
        sys.exit(found)
    for way, (p, off, noise) in zip(ways, found):
        fine = min(p.values()) > 1e-3
        print(f"{args.folder}{way}: {SEEDS} x {args.spp} spp, p mean {p['mean']:.3g}, p blocks {p['blocks']:.3g}, "
              f"mean off by {100 * off:+.3f} % +- {100 * noise:.3f} %: {'pass' if fine else 'FAIL'}")
    sys.exit(0 if fine else 1)


def scenes(args):
    """Every `scene.xml` below the folder, small; how many there were and failed, and those with media."""
    rows, failed, media = 0, 0, []
    print("| scene | spp | p mean | p blocks | mean off by | verdict |\n|-|-|-|-|-|-|")
    for scene in sorted(args.folder.rglob("scene.xml")):
        name = scene.parent.name
        if args.only not in name:
            continue
        text = scene.read_text()
        size = [re.search(rf'<default name="{axis}" value="(\d+)"', text) for axis in ("resx", "resy")]
        if not all(size):
            continue
        width, height = (int(found[1]) for found in size)
        small = [f"resx={args.width}", f"resy={max(args.width * height // width // 2 * 2, 2)}"]
        found = against_mitsuba(args.program, scene, args.spp, small + args.define)
        if isinstance(found, str):
            if "scatter" in found:
                media.append(name)
            else:
                print(f"| {name} | | | | | NOT RENDERED: {found} |", flush=True)
                failed += 1
            continue
        (p, off, noise), = found
        fine = min(p.values()) > 1e-3
        rows, failed = rows + 1, failed + (not fine)
        print(f"| {name} | {SEEDS * args.spp} | {p['mean']:.3g} | {p['blocks']:.3g} | "
              f"{100 * off:+.3f} % +- {100 * noise:.3f} % | {'pass' if fine else 'FAIL'} |", flush=True)
    print(f"{rows} scenes, {failed} failed; with media, left out: {', '.join(media) or 'none'}")
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--ref-spp", type=int, default=32000)
    parser.add_argument("--samples", type=float, default=2e6)
    parser.add_argument("--mitsuba", action="store_true")
    parser.add_argument("--spp", type=int, default=256, help="of each seed, for a single scene and --scenes")
    parser.add_argument("--scenes", action="store_true")
    parser.add_argument("--width", type=int, default=96, help="in pixels, for --scenes")
    parser.add_argument("-D", dest="define", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--place", type=lambda text: tuple(map(float, text.split(","))), metavar="X,Y,Z",
                        help="what is at the origin of Mitsuba's copy of a single scene")
    parser.add_argument("--scale", type=float, default=16.0, help="of Mitsuba's copy, with --place")
    parser.add_argument("--shadow", type=float, default=1.0, metavar="SHARE", help="of what shadow rays end early, with --offset")
    parser.add_argument("--offset", type=float, metavar="SHARE", help="of Mitsuba's ray offset, for a single scene")
    args = parser.parse_args()
    if args.folder.is_file():
        single(args)
    rows, failed, media = [], 0, []
    print("| scene | spp | Mitsuba's rule | p mean | p blocks | mean off by | verdict |\n|-|-|-|-|-|-|-|")
    for scene in sorted(args.folder.rglob("test_*_*.xml")):
        name = "_".join(scene.stem.split("_")[:-1])
        integrator = scene.stem.split("_")[-1]
        reference = scene.parent / "refs" / f"{name}_ref_rgb.exr"
        if args.only not in scene.stem or not reference.exists():
            continue
        if "volpath" in integrator:
            media.append(scene.stem)
            continue
        truth, variance = read(reference), read(str(reference).replace("_rgb.exr", "_rgb_var.exr"))
        pixels = truth.shape[0] * truth.shape[1]
        spp = max(int(args.samples / pixels / SEEDS) // 8 * 8, 8)
        with tempfile.TemporaryDirectory() as folder:
            pictures = [render(args.program, scene, spp, seed, integrator, folder) for seed in range(SEEDS)]
        broken = [p for p in pictures if isinstance(p, str)]
        if broken or pictures[0].shape != truth.shape:
            why = broken[0] if broken else f"has size {pictures[0].shape}, not {truth.shape}"
            print(f"| {scene.stem} | | | | | | NOT RENDERED: {why} |", flush=True)
            failed += 1
            continue
        accepted, p, relative = judge(np.array(pictures), truth, variance, args.ref_spp, spp)
        if args.mitsuba:
            p, relative, _ = judge_pair(np.array(pictures), render_mitsuba(scene, spp, integrator))
        verdict = accepted >= 0.9975 and min(p.values()) > 1e-3
        failed += not verdict
        row = [scene.stem, spp * SEEDS, f"{100 * accepted:.3f} %", f"{p['mean']:.3g}", f"{p['blocks']:.3g}"]
        row += [f"{100 * relative:+.3f} %", "pass" if verdict else "FAIL"]
        rows.append(row)
        print("| " + " | ".join(map(str, row)) + " |", flush=True)
    print(f"{len(rows)} scenes, {failed} failed; with media, left out: {', '.join(media) or 'none'}")
    if args.csv:
        with open(args.csv, "w", newline="") as file:
            csv.writer(file).writerows([["scene", "spp", "accepted", "p_mean", "p_blocks", "off", "verdict"]] + rows)
    if args.scenes:
        failed += scenes(args)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
