#!/usr/bin/env python3
"""Renders the references of refs.json with Mitsuba 3 into refs/.

    python refs/make.py [--pilot | --extend] [--variant NAME] [NAME ...]

For each entry: NAME.exr (mean), NAME.var.exr (variance of that mean, per
pixel and channel) and NAME.json (how it was made, and the whole image's mean
with its standard error).

A reference is the float64 mean of passes of at most 1024 samples per pixel
with distinct seeds: Mitsuba's own float32 sums drift beyond that. The passes
are independent and identically distributed, so that the spread of their means
is the variance of the result. The sampler is `independent`, or `stratified`
where a tiny visible lamp would need too many samples (its seed, too, makes
all of a pass's randomness); never `ldsampler`, which is biased.
--pilot renders four passes, writes nothing, and prints their error.
--extend keeps the passes that a written reference has, and adds those that
refs.json asks for beyond them; means and sums of squares are merged exactly
(Chan, Golub, LeVeque 1983), so that the result is that of one run up to the
f32 rounding of the stored pixels. It writes after every 16 passes: what an
interrupted run has done stays.
Set DRJIT_LIBLLVM_PATH if the LLVM of the system is too old.
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
STEP = 16  # passes between two writes of --extend
SAMPLERS = ("independent", "stratified", "multijitter")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def load(entry):
    """The scene as committed, with robust intersections switched on, unless the
    entry says `"robust": false`."""
    path = SCENES / entry["scene"]
    text = path.read_text(encoding="utf-8")
    robust = "true" if entry.get("robust", True) else "false"
    flag = f'<boolean name="embree_use_robust_intersections" value="{robust}" />'
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


class Moments:
    """Count, mean, and sum of squared deviations from it, of one quantity."""

    def __init__(self, count=0, mean=0.0, squares=0.0):
        self.count, self.mean, self.squares = count, mean, squares

    @classmethod
    def stored(cls, count, mean, error):
        """From a mean and its standard error."""
        return cls(count, np.asarray(mean, dtype=np.float64), np.asarray(error, dtype=np.float64) ** 2 * count * (count - 1))

    def merge(self, other):
        """Takes in the values of another (Chan, Golub, LeVeque 1983, eq. 2.1)."""
        count = self.count + other.count
        difference = other.mean - self.mean
        self.squares = self.squares + other.squares + difference**2 * (self.count * other.count / count)
        self.mean = self.mean + difference * (other.count / count)
        self.count = count

    def variance(self):
        """Variance of the mean."""
        return self.squares / (self.count * (self.count - 1))

    def error(self):
        """Standard error of the mean."""
        return np.sqrt(self.variance())


class Passes:
    """What is known of the pixels, the whole mean and its luminance."""

    def __init__(self):
        self.pixels, self.whole, self.luminance = Moments(), Moments(), Moments()

    def render(self, scene, spp, seeds):
        """Adds one pass for each seed."""
        for seed in seeds:
            image = np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]
            assert np.isfinite(image).all(), f"the pass of seed {seed} is not finite"
            mean = image.mean(axis=(0, 1))
            self.pixels.merge(Moments(1, image))
            self.whole.merge(Moments(1, mean))
            self.luminance.merge(Moments(1, mean @ LUMINANCE))

    def relative_error(self):
        """Relative standard error of the mean luminance."""
        return float(self.luminance.error() / self.luminance.mean)


def read_passes(name, expected):
    """The passes of a written reference, and its JSON; refuses one that was
    made in another way."""
    info = json.loads((REFS / f"{name}.json").read_text(encoding="utf-8"))
    for key, value in expected.items():
        assert info[key] == value, f"{name}: {key} was {info[key]}, now {value}: make it anew, without --extend"
    assert info["seeds"] == [FIRST_SEED, FIRST_SEED + info["passes"] - 1], info["seeds"]
    count = info["passes"]
    passes = Passes()
    mean, variance = (oiio.ImageBuf(str(REFS / f"{name}{suffix}.exr")).get_pixels(oiio.FLOAT) for suffix in ("", ".var"))
    passes.pixels = Moments.stored(count, mean, np.sqrt(variance.astype(np.float64)))
    passes.whole = Moments.stored(count, info["mean"], info["mean_standard_error"])
    luminance = info["mean_luminance"]
    passes.luminance = Moments.stored(count, luminance, luminance * info["mean_luminance_relative_error"])
    return passes, info


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


def report(name, passes, spp, seconds):
    """Prints how well a reference is known."""
    mean, variance = passes.pixels.mean, passes.pixels.variance()
    height, width, _ = mean.shape
    value = float(passes.luminance.mean)
    # What the pixels themselves say, as if they and their channels were independent.
    pixel = np.sqrt((variance @ LUMINANCE**2).sum()) / (width * height) / value
    gray = mean @ LUMINANCE
    worst = np.sqrt(variance.max(axis=2)).max() / value
    print(f"{name:24} {width}x{height} {passes.pixels.count} x {spp} spp: mean {value:.6g} +- {100 * passes.relative_error():.4f} % "
          f"(pixels {100 * pixel:.4f} %), worst pixel se {worst:.3g} of mean, range {gray.min():.3g}..{gray.max():.3g}; "
          f"wall {seconds[0]:.1f} s cpu {seconds[1]:.1f} s", flush=True)


def write(name, passes, made, stages, scene):
    """Writes NAME.exr, NAME.var.exr and NAME.json."""
    mean, count = passes.pixels.mean, passes.pixels.count
    write_exr(REFS / f"{name}.exr", mean)
    write_exr(REFS / f"{name}.var.exr", passes.pixels.variance())
    height, width, _ = mean.shape
    info = {
        "renderer": "Mitsuba",
        "version": made["version"],
        "variant": made["variant"],
        "command": f"python refs/make.py --variant {made['variant']} {name}",
    }
    if len(stages) > 1:
        # Passes after each run with --extend; one run of them all gives the same.
        info["stages"] = stages
    info |= {
        **{key: value for key, value in made.items() if key not in ("version", "variant")},
        "passes": count,
        "samples": made["samples_per_pass"] * count,
        "seeds": [FIRST_SEED, FIRST_SEED + count - 1],
        "width": width,
        "height": height,
        "mean": passes.whole.mean.tolist(),
        "mean_standard_error": passes.whole.error().tolist(),
        "mean_luminance": float(passes.luminance.mean),
        "mean_luminance_relative_error": passes.relative_error(),
    }
    info["filter"], info["filter_overlap"] = filter_overlap(scene)
    (REFS / f"{name}.json").write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")


def make(entry, defaults, options):
    name, spp = entry["name"], entry.get("spp", defaults["spp"])
    count = 4 if options.pilot else entry.get("passes", defaults["passes"])
    assert spp <= 1024 and (options.pilot or count >= 16)
    path, scene = load(entry)
    made = {
        "version": mi.__version__,
        "variant": options.variant,
        "scene": f"scenes/{entry['scene']}",
        "scene_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "scene_flags": {"embree_use_robust_intersections": entry.get("robust", True)},
        "defines": entry.get("defines", {}),
        "sampler": entry.get("sampler", "independent"),
        "samples_per_pass": spp,
    }
    if "gltf" in entry:
        # The same scene as glTF, which is what is tested.
        made["gltf"] = f"scenes/{entry['gltf']}"
        made["gltf_sha256"] = hashlib.sha256((SCENES / entry["gltf"]).read_bytes()).hexdigest()
    passes, stages = Passes(), []
    if options.extend:
        passes, info = read_passes(name, made)
        stages = info.get("stages", [info["passes"]])
    mi.render(scene, spp=1, seed=0)
    wall, cpu = time.perf_counter(), time.process_time()
    step = STEP if options.extend else count
    for first in range(passes.pixels.count, count, step):
        last = min(first + step, count)
        passes.render(scene, spp, range(FIRST_SEED + first, FIRST_SEED + last))
        report(name, passes, spp, (time.perf_counter() - wall, time.process_time() - cpu))
        if not options.pilot:
            write(name, passes, made, [*stages, last], scene)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="entries of refs.json; all by default")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--pilot", action="store_true", help="four passes, nothing written")
    how.add_argument("--extend", action="store_true", help="keep the passes of written references, add those missing")
    options = parser.parse_args()
    mi.set_variant(options.variant)
    table = json.loads((REFS / "refs.json").read_text(encoding="utf-8"))
    known = {entry["name"]: entry for entry in table["references"]}
    for name in options.names:
        if name not in known:
            sys.exit(f"no reference named {name}; there are: {', '.join(known)}")
    for name in options.names or known:
        make(known[name], table["defaults"], options)


if __name__ == "__main__":
    main()
