#!/usr/bin/env python3
"""Holds the figures of `etendue compare --json` against independent programs.

    python tools/check_metrics.py target/debug/etendue

MSE and relMSE against OpenImageIO (`ImageBufAlgo.compare` of the pictures as
they are, and divided by the root of relMSE's denominator), FLIP (LDR and HDR)
against flip-evaluator, the authors' program, on the same EXR files: all to
1e-4 relative, FLIP to 1e-4 absolute (it lies in [0, 1]). The pictures are
references that stand for renders of each other, one of them with noise of a
fixed seed. Needs OpenImageIO, numpy and flip-evaluator (PyPI).
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import flip_evaluator
import numpy as np
import OpenImageIO as oiio

REFS = Path(__file__).resolve().parent.parent / "refs"
LIMIT = 1e-4
# Picture and reference of one size; None: the reference with noise.
PAIRS = [
    ("cornell-box", "cornell-original"),
    ("filters-box", "filters-gaussian"),
    ("features-layers", "features-emitters"),
    ("cornell-box", None),
]


def noisy(reference, path):
    values = read(reference)
    noise = np.random.default_rng(7).gamma(4, 0.25, values.shape).astype(np.float32)
    picture = oiio.ImageBuf(oiio.ImageSpec(values.shape[1], values.shape[0], 3, "float"))
    picture.set_pixels(oiio.ROI(), values * noise)
    assert picture.write(str(path)), picture.geterror()
    return path


def read(path):
    picture = oiio.ImageBuf(str(path))
    assert tuple(picture.spec().channelnames) == ("R", "G", "B"), picture.spec().channelnames
    return np.ascontiguousarray(picture.get_pixels(oiio.FLOAT))


def mean_square(a, b):
    """By OpenImageIO: the root mean square over all pixels and channels, squared."""
    return oiio.ImageBufAlgo.compare(a, b, 0.0, 0.0).rms_error ** 2


def expected(picture, reference):
    a, b = (oiio.ImageBuf(str(path)) for path in (picture, reference))
    stats = oiio.ImageBufAlgo.computePixelStats(b)
    floor = 1e-2 * (sum(stats.avg) / 3) ** 2
    scale = oiio.ImageBufAlgo.pow(oiio.ImageBufAlgo.add(oiio.ImageBufAlgo.mul(b, b), floor), 0.5)
    relative = mean_square(oiio.ImageBufAlgo.div(a, scale), oiio.ImageBufAlgo.div(b, scale))
    a_values, b_values = (np.maximum(read(path), 0) for path in (picture, reference))
    ldr = flip_evaluator.evaluate(np.clip(b_values, 0, 1), np.clip(a_values, 0, 1), "LDR", inputsRGB=False)[1]
    hdr = flip_evaluator.evaluate(b_values, a_values, "HDR")[1]
    return {"mse": mean_square(a, b), "rel_mse": relative, "flip_ldr": ldr, "flip": hdr}


def main(binary):
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for image, reference in PAIRS:
            picture = REFS / f"{image}.exr"
            base = REFS / f"{reference}.exr" if reference else picture
            if reference is None:
                picture = noisy(base, Path(folder) / "noisy.exr")
            command = [binary, "compare", picture, base, "--json"]
            done = subprocess.run([str(part) for part in command], text=True, capture_output=True)
            assert done.returncode == 0, f"{command}: {done.stderr}"
            ours = json.loads(done.stdout)
            for name, value in expected(picture, base).items():
                error = abs(ours[name] - value) / (1 if name.startswith("flip") else value)
                failed += not error <= LIMIT
                print(f"{'ok' if error <= LIMIT else 'WRONG':5} {picture.stem} / {base.stem} {name}: "
                      f"{ours[name]:.7g}, independently {value:.7g} ({error:.1e})")
    assert not failed, f"{failed} figures differ by more than {LIMIT}"


if __name__ == "__main__":
    main(*sys.argv[1:])
