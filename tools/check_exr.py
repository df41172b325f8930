#!/usr/bin/env python3
"""Renders a small scene and looks at the EXR as other programs will.

    python tools/check_exr.py target/debug/etendue

Runs `oiiotool --info -v` and `idiff` on real output, and asserts names and
metadata of the output conventions: one part without a name, scan lines in
increasing order, ZIP, 32-bit float, channel names, windows, camera matrices,
chromaticities and the `etendue/...` attributes. Renders twice with different
numbers of threads: the files must be equal byte for byte. Needs OpenImageIO
(PyPI) with its command line tools beside the Python that runs this.
"""
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

ROOT = Path(__file__).resolve().parent.parent
TOOLS = Path(sys.executable).parent
SCENE = ROOT / "scenes" / "cornell-box" / "scene.xml"
SIZE = 64
LAYERS = ["R G B A", "Z", "P.X P.Y P.Z", "N.X N.Y N.Z", "albedo.R albedo.G albedo.B", "error.R error.G error.B"]
ATTRIBUTES = ["version", "sceneHash", "seed", "samples", "plan", "bias", "badSamples"]


def run(*command, fails=False):
    print("+", " ".join(str(part) for part in command), flush=True)
    done = subprocess.run([str(part) for part in command], text=True, capture_output=True)
    output = done.stdout + done.stderr
    assert (done.returncode != 0) == fails, f"exit code {done.returncode}:\n{output}"
    return done.stdout


def render(binary, out, *more):
    size = ("-D", f"resx={SIZE}", "-D", f"resy={SIZE}")
    run(binary, "render", SCENE, "-o", out, "--spp", 4, *size, "--aov", "albedo,N,P,Z", *more)
    assert not out.with_name(out.name + ".part").exists()


def check(condition, what):
    assert condition, what
    print("ok:", what)


def matrix(spec, name):
    values = spec.getattribute(name)
    check(values is not None and len(values) == 16 and all(map(math.isfinite, values)), f"{name} is a matrix")
    return np.array(values).reshape(4, 4)


def check_header(path, window):
    source = oiio.ImageInput.open(str(path))
    spec = source.spec()
    check(not source.seek_subimage(1, 0), "one part")
    source.seek_subimage(0, 0)
    text = {name: spec.get_string_attribute(name) for name in ("compression", "openexr:lineOrder", "name", "oiio:subimagename")}
    check(text["compression"] == "zip", "compression is ZIP of 16 lines")
    check(text["openexr:lineOrder"] == "increasingY", "lines in increasing order")
    check(not text["name"] and not text["oiio:subimagename"], "the part has no name")
    check(spec.tile_width == 0, "scan lines, not tiles")
    expected = sorted(name for layer in LAYERS for name in layer.split())
    check(sorted(spec.channelnames) == expected, f"channels are {', '.join(expected)}")
    check(spec.format == oiio.FLOAT and not spec.channelformats, "all channels are 32-bit float")
    check((spec.x, spec.y, spec.width, spec.height) == window, f"data window is {window}")
    full = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    check(full == (0, 0, SIZE, SIZE), "display window is the whole film")
    check(spec.get_float_attribute("PixelAspectRatio") == 1.0, "pixels are square")
    rec709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    found = spec.getattribute("chromaticities")
    check(found is not None and np.allclose(found, rec709, atol=1e-4), "chromaticities are Rec. 709")
    check_camera(spec)
    for name in ATTRIBUTES:
        value = spec.getattribute(f"etendue/{name}")
        check(value not in (None, ""), f"etendue/{name} = {value}")
    check(spec.getattribute("DateTime") is None and spec.getattribute("capDate") is None, "no date by default")


def check_camera(spec):
    """Row vectors, translation in the last row; left-handed, view along +z."""
    camera = np.array([0, 1, 6.8])
    world_to_camera, world_to_ndc = matrix(spec, "worldToCamera"), matrix(spec, "worldToNDC")
    at = np.append(camera, 1) @ world_to_camera
    check(np.allclose(at, (0, 0, 0, 1), atol=1e-4), "the camera is at the origin of its space")
    ahead = np.append(camera - (0, 0, 3), 1) @ world_to_camera
    check(np.allclose(ahead, (0, 0, 3, 1), atol=1e-4), "what is ahead is at +z")
    seen = np.append(camera - (0, 0, 3), 1) @ world_to_ndc
    check(np.allclose(seen[:2] / seen[3], 0.5, atol=1e-3), "what is ahead is in the middle of the picture")
    above = np.append(camera + (0, 0.2, -3), 1) @ world_to_ndc
    check(above[1] / above[3] < 0.49, "up is towards row 0")


def pixels(path):
    buffer = oiio.ImageBuf(str(path))
    names = list(buffer.spec().channelnames)
    values = np.asarray(buffer.get_pixels(oiio.FLOAT))
    return lambda layer: values[..., [names.index(name) for name in layer.split()]]


def check_pixels(path):
    layer = pixels(path)
    for name in LAYERS:
        if name != "Z":
            check(np.isfinite(layer(name)).all(), f"{name} is finite")
    rgb = layer("R G B")
    check(0.05 < rgb.mean() < 0.5, f"the picture is lit ({rgb.mean():.4f})")
    check(rgb[32, 4, 0] > 2 * rgb[32, 4, 1], "the left wall is red")
    check(rgb[32, 59, 1] > 2 * rgb[32, 59, 0], "the right wall is green")
    depth = layer("Z")[..., 0]
    check(5.5 < depth[32, 32] < 8.2 and depth.min() > 5, f"Z is the distance to the camera ({depth[32, 32]:.3f})")
    position = layer("P.X P.Y P.Z")
    check(abs(position[60:, 20, 1]).max() < 0.01, "P of the floor has y = 0")
    check(np.allclose(layer("N.X N.Y N.Z")[60, 20], (0, 1, 0), atol=0.02), "N of the floor points up")
    check(layer("error.R error.G error.B").max() > 0, "the error is not zero")


def main():
    binary = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        one, two, other, crop = (Path(folder) / f"{name}.exr" for name in ("one", "two", "other", "crop"))
        render(binary, one, "--threads", 1)
        render(binary, two, "--threads", 2)
        print(run(TOOLS / "oiiotool", "--info", "-v", one))
        check("PASS" in run(TOOLS / "idiff", one, two), "idiff: one thread and two agree")
        check(one.read_bytes() == two.read_bytes(), "one thread and two: the same bytes")
        check_header(one, (0, 0, SIZE, SIZE))
        check_pixels(one)
        render(binary, other, "--seed", 1)
        run(TOOLS / "idiff", one, other, fails=True)
        render(binary, crop, "--crop", "10,20,30,16")
        check_header(crop, (10, 20, 30, 16))
        whole, part = (pixels(path)("R G B A") for path in (one, crop))
        check((whole[20:36, 10:40] == part).all(), "a crop is the same region of the whole")
    print("the EXR is as it should be")


if __name__ == "__main__":
    main()
