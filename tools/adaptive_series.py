"""Would adaptive sampling pay? Makes a series for `etendue study --series`.

    adaptive_series.py BINARY SCENE FOLDER [--spp 16,64,256] [--runs 8] [-D NAME=VALUE ...]

A quarter of the samples is a pilot; its error layer says how noisy each pixel
is. The rest is dealt out in proportion to the noise, in powers of two of the
samples per pixel, and the pilot is thrown away, so that the picture is
unbiased: a pixel's count does not depend on the samples that it is made of.
With --keep-pilot the pilot is averaged in by counts, as renderers do, which
is biased where a firefly in the pilot draws samples to itself.

Each pixel is taken from a whole picture rendered with its count. With a filter
wider than a box that lends it neighbours of the same count, which flatters
adaptive sampling. The time is the pilot's and, of each picture, the share of
the pixels that were taken from it. Needs OpenImageIO and numpy.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import OpenImageIO as oiio


def render(arguments, spp, seed):
    """Picture and error layer (rows, columns, 3), and CPU seconds of rendering."""
    with tempfile.TemporaryDirectory() as folder:
        out, stats = pathlib.Path(folder) / "o.exr", pathlib.Path(folder) / "s.json"
        command = [arguments.binary, "render", arguments.scene, "-q", "-o", out, "--stats", stats]
        command += ["--spp", str(spp), "--seed", str(seed)]
        for define in arguments.define:
            command += ["-D", define]
        subprocess.run([str(c) for c in command], check=True)
        image = oiio.ImageBuf(str(out))
        names = list(image.spec().channelnames)
        pixels = np.asarray(image.get_pixels(oiio.FLOAT), dtype=np.float64)
        layer = lambda prefix: pixels[..., [names.index(prefix + c) for c in "RGB"]]
        return layer(""), layer("error."), json.loads(stats.read_text())["render_cpu_seconds"]


def counts(error, mean, spp):
    """Samples of each pixel: powers of two near `spp` · noise / mean noise."""
    # Relative noise with the floor of relMSE, smoothed over 3 × 3 pixels.
    floor = 1e-2 * mean.mean() ** 2
    noise = np.sqrt((error**2 / (mean**2 + floor)).mean(axis=-1))
    padded = np.pad(noise, 1, mode="edge")
    height, width = noise.shape
    noise = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3)) / 9
    scale = 1.0
    for _ in range(60):
        wanted = np.clip(scale * spp * noise / noise.mean(), 1, 16 * spp)
        dealt = 2.0 ** np.round(np.log2(wanted))
        scale *= spp / dealt.mean()
    return dealt.astype(int)


def adaptive(arguments, spp, seed):
    """An adaptively sampled picture and its CPU seconds."""
    pilot_spp = max(spp // 4, 2)
    pilot, error, seconds = render(arguments, pilot_spp, seed)
    dealt = counts(error, pilot, spp - pilot_spp)
    picture = np.zeros_like(pilot)
    for level, count in enumerate(np.unique(dealt)):
        chosen = dealt == count
        whole, _, cost = render(arguments, int(count), seed + 1 + level)
        picture[chosen] = whole[chosen]
        seconds += cost * chosen.mean()
    if arguments.keep_pilot:
        weight = (pilot_spp / (pilot_spp + dealt))[..., None]
        picture = weight * pilot + (1 - weight) * picture
    return picture, seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("scene")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--spp", default="16,64,256")
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--keep-pilot", action="store_true")
    parser.add_argument("-D", dest="define", action="append", default=[])
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    with open(arguments.folder / "list.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["file", "seconds", "spp"])
        for spp in map(int, arguments.spp.split(",")):
            for run in range(arguments.runs):
                # Seeds far apart: no picture shares its random numbers.
                picture, seconds = adaptive(arguments, spp, 1_000_000 + 10_000 * spp + 100 * run)
                name = f"adaptive-{spp}-{run}.exr"
                spec = oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, oiio.FLOAT)
                image = oiio.ImageBuf(spec)
                image.set_pixels(spec.roi, np.ascontiguousarray(picture, dtype=np.float32))
                if image.has_error or not image.write(str(arguments.folder / name)):
                    raise SystemExit(f"cannot write {name}: {image.geterror()}")
                rows.writerow([name, seconds, spp])


if __name__ == "__main__":
    main()
