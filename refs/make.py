#!/usr/bin/env python3
"""Renders the references of refs.json with Mitsuba 3 into refs/.

    python refs/make.py [--pilot] [--variant NAME] [NAME ...]

For each entry: NAME.exr (mean), NAME.var.exr (variance of that mean, per
pixel and channel) and NAME.json (how it was made, and the whole image's mean
with its standard error).

A reference is the float64 mean of passes of at most 1024 samples per pixel
with distinct seeds: Mitsuba's own float32 sums drift beyond that. The passes
are independent and identically distributed, so that the spread of their means
is the variance of the result. The sampler is `independent`, or `stratified`
where a tiny visible lamp would need too many samples (its seed, too, makes
all of a pass's randomness); never `ldsampler`, which is biased.
--pilot renders four passes, writes nothing, and prints what 4, 64, … passes
would give. Set DRJIT_LIBLLVM_PATH if the LLVM of the system is too old.
"""
import argparse
import hashlib
import json
import re
import sys
import time
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenImageIO as oiio

REFS = Path(__file__).resolve().parent
SCENES = REFS.parent / "scenes"
FIRST_SEED = 1000
SAMPLERS = ("independent", "stratified", "multijitter")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def load(entry):
    """The scene as committed, with robust intersections switched on."""
    path = SCENES / entry["scene"]
    text = path.read_text(encoding="utf-8")
    flag = '<boolean name="embree_use_robust_intersections" value="true" />'
    text, found = re.subn(r"(<scene\b[^>]*>)", lambda m: m.group(1) + flag, text, count=1)
    assert found == 1, path
    sampler = entry.get("sampler", "independent")
    assert sampler in SAMPLERS, sampler
    text, found = re.subn(r'(<sampler type=)"\w+"', rf'\1"{sampler}"', text)
    assert found == 1, path
    mi.file_resolver().prepend(str(path.parent))
    defines = {key: str(value) for key, value in entry.get("defines", {}).items()}
    scene = mi.load_string(text, **defines)
    return path, scene


def accumulate(scene, spp, passes):
    """Mean image, variance of that mean, and the image mean of each pass."""
    total, squares, means = 0.0, 0.0, []
    for index in range(passes):
        image = np.array(mi.render(scene, spp=spp, seed=FIRST_SEED + index), dtype=np.float64)[..., :3]
        assert np.isfinite(image).all(), f"pass {index} is not finite"
        # Offset by the first pass: the sum of squares then loses no digits.
        if index == 0:
            origin = image
        total = total + (image - origin)
        squares = squares + (image - origin) ** 2
        means.append(image.mean(axis=(0, 1)))
    shift = total / passes
    variance = np.maximum(squares / passes - shift**2, 0) / (passes - 1)
    return origin + shift, variance, np.array(means)


def write_exr(path, pixels):
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT)
    spec.channelnames = ("R", "G", "B")
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", "2000:01:01 00:00:00")  # else the clock's: equal input, equal bytes
    output = oiio.ImageOutput.create(str(path))
    assert output and output.open(str(path), spec), oiio.geterror()
    assert output.write_image(np.ascontiguousarray(pixels, dtype=np.float32)), output.geterror()
    output.close()


def filter_overlap(scene):
    """Name of the film's filter, and 1 / integral of its square in pixels^-2:
    by how much neighbours that share samples raise the variance of a mean of
    many pixels over the sum of theirs."""
    kernel = scene.sensors()[0].film().rfilter()
    x = (np.arange(4000) + 0.5) / 4000 * kernel.radius()
    weights = np.array(kernel.eval(mi.Float(x)) if "llvm" in mi.variant() or "cuda" in mi.variant() else [kernel.eval(v) for v in x], dtype=np.float64)
    step = 2 * kernel.radius() / len(x)
    overlap = (weights.sum() * step) ** 2 / ((weights**2).sum() * step)
    name = str(kernel).split("[")[0].removesuffix("Filter").lower()
    return {"mitchellnetravali": "mitchell", "lanczossinc": "lanczos"}.get(name, name), round(float(overlap**2), 4)


def relative_error(means):
    """Mean luminance of the image and its relative standard error, from passes."""
    values = means @ LUMINANCE
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values)) / values.mean()


def make(entry, defaults, variant, pilot):
    spp = entry.get("spp", defaults["spp"])
    passes = 4 if pilot else entry.get("passes", defaults["passes"])
    assert spp <= 1024 and (pilot or passes >= 16)
    path, scene = load(entry)
    mi.render(scene, spp=1, seed=0)
    wall, cpu = time.perf_counter(), time.process_time()
    mean, variance, means = accumulate(scene, spp, passes)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    value, relative = relative_error(means)
    height, width, _ = mean.shape
    # What the pixels themselves say, as if they and their channels were independent.
    pixel = np.sqrt(((variance @ LUMINANCE**2).sum())) / (width * height) / value
    gray = mean @ LUMINANCE
    worst = np.sqrt(variance.max(axis=2)).max() / value
    print(f"{entry['name']:24} {width}x{height} {passes} x {spp} spp: mean {value:.6g} +- {100 * relative:.4f} % "
          f"(pixels {100 * pixel:.4f} %), worst pixel se {worst:.3g} of mean, range {gray.min():.3g}..{gray.max():.3g}; "
          f"wall {wall:.1f} s cpu {cpu:.1f} s", flush=True)
    if pilot:
        return
    write_exr(REFS / f"{entry['name']}.exr", mean)
    write_exr(REFS / f"{entry['name']}.var.exr", variance)
    info = {
        "renderer": "Mitsuba",
        "version": mi.__version__,
        "variant": variant,
        "command": f"python refs/make.py --variant {variant} {entry['name']}",
        "scene": f"scenes/{entry['scene']}",
        "scene_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "scene_flags": {"embree_use_robust_intersections": True},
        "defines": entry.get("defines", {}),
        "sampler": entry.get("sampler", "independent"),
        "samples_per_pass": spp,
        "passes": passes,
        "samples": spp * passes,
        "seeds": [FIRST_SEED, FIRST_SEED + passes - 1],
        "width": width,
        "height": height,
        "mean": means.mean(axis=0).tolist(),
        "mean_standard_error": (means.std(axis=0, ddof=1) / np.sqrt(passes)).tolist(),
        "mean_luminance": value,
        "mean_luminance_relative_error": relative,
    }
    info["filter"], info["filter_overlap"] = filter_overlap(scene)
    (REFS / f"{entry['name']}.json").write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="entries of refs.json; all by default")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--pilot", action="store_true", help="four passes, nothing written")
    options = parser.parse_args()
    mi.set_variant(options.variant)
    table = json.loads((REFS / "refs.json").read_text(encoding="utf-8"))
    known = {entry["name"]: entry for entry in table["references"]}
    for name in options.names:
        if name not in known:
            sys.exit(f"no reference named {name}; there are: {', '.join(known)}")
    for name in options.names or known:
        make(known[name], table["defaults"], options.variant, options.pilot)


if __name__ == "__main__":
    main()
