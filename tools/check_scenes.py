#!/usr/bin/env python3
"""Renders every scene of a folder of Mitsuba render tests and judges it twice.

    tools/check_scenes.py target/release/etendue FOLDER [--only PART] [--csv FILE] [--mitsuba]
    tools/check_scenes.py target/release/etendue SCENE.xml --mitsuba -D resx=96 -D resy=54
    tools/check_scenes.py target/release/etendue FOLDER --mitsuba --scenes [--width 96] [--offset 0.0625 --shadow 0.0625]
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
render tests, each other scene file below FOLDER with --scenes, its picture made
small (what others include is a part, no scene). Those whose media scatter
and those that Mitsuba does not load are listed with the reason; all of the latter
must render here, with --lenient if need be. --spp 256 is for all of them, --spp
NAME=1024 besides for one.

Mitsuba's rays begin (1 + max|p|) 8.9e-5 off the surface. Two options judge again,
with less of that; our own side is the scene as it stands each time, and the same
pictures. --offset SHARE, for a single scene and for --scenes: against Mitsuba's
`path` with this share of the offset everywhere (tools/mitsuba_near.py;
llvm_ad_rgb), and with --shadow SHARE of what its shadow rays end early. With it the
second verdict counts, but for scenes of other integrators, which are told and have
the first one only. --place X,Y,Z --scale K, for a single scene: against Mitsuba's
picture of a copy that is moved so that this place is the origin, and then made K
times as large, a power of two.

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


def render(program, scene, spp, seed, integrator, folder, options=()):
    out = pathlib.Path(folder) / f"{seed}.exr"
    command = [program, "render", str(scene), "-o", str(out), "--spp", str(spp), "--seed", str(seed), "-q", *options]
    if integrator in SAME:
        command += ["--integrator", SAME[integrator]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        return (done.stderr.strip().splitlines() or [f"it ended with {done.returncode}"])[-1]
    return read(out)


def for_mitsuba(scene, size=None, moved=None, offset=None, shadow=1.0):
    """The scene file's text, robust intersections switched on (without, rays of Embree miss edges; with
    curves, they crash), and its picture of that `size` if one is given."""
    root = xml.parse(scene).getroot()
    if size:
        film = root.find("sensor/film")
        film = xml.SubElement(root.find("sensor"), "film", type="hdrfilm") if film is None else film
        for name, value in zip(("width", "height"), size):
            side = film.find(f"integer[@name='{name}']")
            side = xml.SubElement(film, "integer", name=name) if side is None else side
            side.set("value", str(value))
    if not any("curve" in shape.get("type", "") for shape in root.iter("shape")):
        xml.SubElement(root, "boolean", name="embree_use_robust_intersections", value="true")
    if moved:
        move_all(scene, root, *moved)
    if offset is not None:
        integrator = root.find("integrator")
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


def integrator_of(scene):
    found = xml.parse(scene).getroot().find("integrator")
    return "path" if found is None else found.get("type")


def mitsuba():
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "DRJIT_LIBLLVM_PATH" in os.environ else "scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)  # warnings would stand in the table
    return mi


def refused_by_mitsuba(scene):
    """Why it does not load the file as it is, if so."""
    try:
        mitsuba().load_file(str(scene))
    except RuntimeError as error:
        return " ".join(re.sub(r"\[\w+\.cpp:\d+\] ", "", str(error).replace(f"{scene.parent.resolve()}/", "")).split())
    return None


def render_mitsuba(scene, spp, integrator, defines=(), size=None, moved=None, offset=None, shadow=1.0):
    """One picture per seed, as Mitsuba renders them now, or `size`; of a copy elsewhere if `moved` (place,
    scale), with those shares of its ray offset and of its shadow rays' ends if there is an `offset`."""
    mi = mitsuba()
    values = dict(define.split("=", 1) for define in defines)
    if integrator in SAME:
        values["integrator"] = SAME[integrator]
    if offset is not None:
        import mitsuba_near  # noqa: F401: registers the integrator
    mi.file_resolver().prepend(str(scene.resolve().parent))
    loaded = mi.load_string(for_mitsuba(scene, size, moved, offset, shadow), **values)
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


def verdict(p):
    return "pass" if min(p.values()) > 1e-3 else "FAIL"


def single(args):
    ways = {"": {}}
    if args.place:
        place = ", ".join(f"{c:g}" for c in args.place)
        ways[f", {place} at Mitsuba's origin, {args.scale:g} times as large"] = {"moved": (args.place, args.scale)}
    if args.offset is not None:
        if integrator_of(args.folder) != "path":
            sys.exit(f"{args.folder}: --offset is for the integrator path")
        end = f", {args.shadow:g} of its shadow rays' ends" if args.shadow != 1 else ""
        ways[f", {args.offset:g} of Mitsuba's offset{end}"] = {"offset": args.offset, "shadow": args.shadow}
    spp = args.spp.get(args.folder.parent.name, args.spp[""])
    options = [part for define in args.define for part in ("-D", define)]
    with tempfile.TemporaryDirectory() as folder:
        ours = [render(args.program, args.folder, spp, s, "", folder, options) for s in range(SEEDS)]
    if isinstance(ours[0], str):
        sys.exit(ours[0])
    for name, way in ways.items():
        p, off, noise = judge_pair(np.array(ours), render_mitsuba(args.folder, spp, "", args.define, **way))
        print(f"{args.folder}{name}: {SEEDS} x {spp} spp, p mean {p['mean']:.3g}, p blocks {p['blocks']:.3g}, "
              f"mean off by {100 * off:+.3f} % +- {100 * noise:.3f} %: {verdict(p)}", flush=True)
    sys.exit(0 if verdict(p) == "pass" else 1)


def whole_scenes(folder):
    """Scene files below it that are no render tests, with their roots; without what others include, and
    what has no sensor."""
    found, parts = {}, set()
    for file in sorted(folder.rglob("*.xml")):
        root = xml.parse(file).getroot()
        if root.find("sensor") is not None or root.find("include") is not None:
            found[file] = root
            parts |= {(file.parent / part.get("filename")).resolve() for part in root.iter("include")}
    return {f: root for f, root in found.items() if f.resolve() not in parts and not f.name.startswith("test_")}


def small(root, width):
    """The size of a picture as wide as that, as high as its film says (576 x 768 if nothing)."""
    defaults = {d.get("name"): d.get("value") for d in root.iter("default")}
    size = {"width": "768", "height": "576"}
    for number in root.iterfind("sensor/film/integer"):
        size[number.get("name")] = number.get("value")
    w, h = (int(defaults.get(size[side].lstrip("$"), size[side])) for side in ("width", "height"))
    return width, max(width * h // w // 2 * 2, 2)


def judge_scene(args, scene, root):
    """Its row: the samples, a cell for each way of rendering it in Mitsuba, and whether the last one passes;
    or what keeps it from being judged."""
    size = small(root, args.width)
    spp = args.spp.get(scene.parent.name, args.spp[""])
    options = ["--size", f"{size[0]}x{size[1]}"] + [part for define in args.define for part in ("-D", define)]
    with tempfile.TemporaryDirectory() as folder:
        ours = [render(args.program, scene, 4, 0, "", folder, options)]
        lenient = isinstance(ours[0], str) and "scatter" not in ours[0]
        if lenient:
            ours = [render(args.program, scene, 4, 0, "", folder, [*options, "--lenient"])]
        if isinstance(ours[0], str):
            return ours[0]
        why = refused_by_mitsuba(scene)
        if why:
            return {"refused": why, "lenient": lenient}
        if lenient:
            return "rendered with --lenient alone"
        theirs = render_mitsuba(scene, spp, "", args.define, size)
        ours = [render(args.program, scene, spp, s, "", folder, options) for s in range(SEEDS)]
    broken = [picture for picture in ours if isinstance(picture, str)]
    if broken:
        return broken[0]
    ours = np.array(ours)
    found = [judge_pair(ours, theirs)]
    if args.offset is not None and root.find("integrator").get("type") == "path":
        near = render_mitsuba(scene, spp, "", args.define, size, offset=args.offset, shadow=args.shadow)
        found.append(judge_pair(ours, near))
    cells = [f"{p['mean']:.3g} | {p['blocks']:.3g} | {100 * off:+.3f} % +- {100 * noise:.3f} % | {verdict(p)}"
             for p, off, noise in found]
    if args.offset is not None and len(found) == 1:
        cells.append(f"| | | as it stands: integrator {root.find('integrator').get('type')}")
    return {"spp": SEEDS * spp, "cells": cells, "passes": verdict(found[-1][0]) == "pass"}


def scenes(args):
    """Every other scene below the folder, small; how many failed."""
    judged, failed, media, refused = 0, 0, [], []
    columns = "p mean | p blocks | mean off by | verdict |"
    print(f"| scene | spp | {columns}" + (f" {columns}" if args.offset is not None else ""))
    print("|-|-|-|-|-|-|" + ("-|-|-|-|" if args.offset is not None else ""))
    for scene, root in whole_scenes(args.folder).items():
        name = scene.relative_to(args.folder)
        name = str(name.parent if name.name == "scene.xml" else name)
        if args.only not in name:
            continue
        row = judge_scene(args, scene, root)
        if isinstance(row, str) and "scatter" in row:
            media.append(name)
        elif isinstance(row, str):
            print(f"| {name} | | | | | NOT RENDERED: {row} |", flush=True)
            failed += 1
        elif "refused" in row:
            refused.append(f"- {name}: {row['refused']}" + (" (here: with --lenient)" if row["lenient"] else ""))
        else:
            judged, failed = judged + 1, failed + (not row["passes"])
            print(f"| {name} | {row['spp']} | " + " | ".join(row["cells"]) + " |", flush=True)
    print(f"{judged} scenes, {failed} failed; with media, left out: {', '.join(media) or 'none'}")
    if refused:
        print("render, but Mitsuba does not load them:", *refused, sep="\n")
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
    parser.add_argument("--spp", action="append", default=[], metavar="[NAME=]COUNT",
                        help="of each seed, for a single scene and --scenes (256); for the one in the folder NAME")
    parser.add_argument("--scenes", action="store_true")
    parser.add_argument("--width", type=int, default=96, help="in pixels, for --scenes")
    parser.add_argument("-D", dest="define", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--place", type=lambda text: tuple(map(float, text.split(","))), metavar="X,Y,Z",
                        help="what is at the origin of Mitsuba's copy of a single scene")
    parser.add_argument("--scale", type=float, default=16.0, help="of Mitsuba's copy, with --place")
    parser.add_argument("--shadow", type=float, default=1.0, metavar="SHARE", help="of what shadow rays end early, with --offset")
    parser.add_argument("--offset", type=float, metavar="SHARE", help="of Mitsuba's ray offset, for a single scene and --scenes")
    args = parser.parse_args()
    counts = [("=" + count).rsplit("=", 2)[-2:] for count in args.spp]
    args.spp = {"": 256} | {name: int(count) for name, count in counts}
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
