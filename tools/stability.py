#!/usr/bin/env python3
"""Sweeps of extremes, ours and Mitsuba's, as plots: docs/stability/.

    python tools/stability.py target/release/etendue docs/stability

- scale.svg: a room times 2^k. Its picture does not depend on k.
- distance.svg: the room and its camera moved by 2^k in x, y and z.
- roughness.svg: a lamp in a mirror of GGX roughness alpha, against the integral
  over its microfacets, by quadrature in double precision.

Each with its numbers beside it as CSV. Needs numpy, matplotlib, mitsuba and
OpenImageIO.
"""

import csv
import pathlib
import subprocess
import sys
import tempfile

import matplotlib
import mitsuba as mi
import numpy as np
import OpenImageIO as oiio

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "etendue"
import matplotlib.pyplot as plt  # noqa: E402

SAMPLES = 64
ROOM_SIZE = 64
COLOURS = {"etendue": "#0b6e4f", "mitsuba 3.9.1": "#c8553d"}


def place(scale, at, turn, size, where):
    x, y, z = (at[i] + where[i] * scale for i in range(3))
    return (
        f'<transform name="to_world">{turn}<scale value="{size * scale!r}"/>'
        f'<translate x="{x!r}" y="{y!r}" z="{z!r}"/></transform>'
    )


def scene(body, camera, size, samples, depth):
    return f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
<sensor type="perspective">{camera}
<film type="hdrfilm"><integer name="width" value="{size}"/><integer name="height" value="{size}"/>
<string name="component_format" value="float32"/><rfilter type="box"/></film>
<sampler type="multijitter"><integer name="sample_count" value="{samples}"/></sampler></sensor>
{body}</scene>"""


def room(scale, at):
    """A box with a lamp, a diffuse ball, a glossy block and a glass ball."""

    def thing(kind, turn, size, where, rest):
        return f'<shape type="{kind}">{place(scale, at, turn, size, where)}{rest}</shape>\n'

    def grey(colour):
        return f'<bsdf type="diffuse"><rgb name="reflectance" value="{colour}"/></bsdf>'

    down, up = '<rotate x="1" angle="90"/>', '<rotate x="1" angle="-90"/>'
    body = thing("rectangle", up, 1.0, (0, -1, 0), grey("0.7"))
    body += thing("rectangle", down, 1.0, (0, 1, 0), grey("0.7"))
    body += thing("rectangle", '<rotate y="1" angle="90"/>', 1.0, (-1, 0, 0), grey("0.6,0.1,0.1"))
    body += thing("rectangle", '<rotate y="1" angle="-90"/>', 1.0, (1, 0, 0), grey("0.1,0.5,0.1"))
    body += thing("rectangle", "", 1.0, (0, 0, -1), grey("0.7"))
    lamp = '<emitter type="area"><rgb name="radiance" value="12"/></emitter>'
    body += thing("rectangle", down, 0.25, (0, 0.9375, 0), lamp)
    body += thing("sphere", "", 0.375, (-0.5, -0.625, -0.25), grey("0.5"))
    body += thing("sphere", "", 0.25, (0, -0.75, 0.5), '<bsdf type="dielectric"/>')
    glossy = '<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>'
    body += thing("cube", '<rotate y="1" angle="20"/>', 0.3125, (0.5, -0.6875, -0.375), glossy)
    x, y, z = at
    camera = (
        f'<float name="fov" value="40"/><float name="near_clip" value="{1e-2 * scale!r}"/>'
        f'<float name="far_clip" value="{1e4 * scale!r}"/><transform name="to_world">'
        f'<lookat origin="{x!r},{y!r},{z + 3.5 * scale!r}" target="{x!r},{y!r},{z!r}" up="0,1,0"/></transform>'
    )
    return scene(body, camera, ROOM_SIZE, SAMPLES, 8)


def lamp_in_mirror(alpha, half):
    body = f"""<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>
<bsdf type="roughconductor"><string name="material" value="none"/><string name="distribution" value="ggx"/>
<float name="alpha" value="{alpha!r}"/></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="{half!r}"/><rotate y="1" angle="90"/>
<translate x="-1" y="1"/></transform><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"""
    camera = (
        '<float name="fov" value="0.01"/><float name="near_clip" value="1e-6"/><transform name="to_world">'
        '<lookat origin="1,1,0" target="0,0,0" up="0,1,0"/></transform>'
    )
    return scene(body, camera, 8, 4096, 2)


def mirror_truth(alpha, half, steps=3000):
    """Integral over microfacet normals: tan² θ = α² s / (1 − s) with s uniform."""
    s = (np.arange(steps) + 0.5) / steps
    phi = (np.arange(steps) + 0.5) / steps * 2 * np.pi
    tan = alpha * np.sqrt(s / (1 - s))[:, None]
    cos_m = 1 / np.sqrt(1 + tan**2)
    m = np.stack([tan * cos_m * np.cos(phi), cos_m * np.ones_like(phi), tan * cos_m * np.sin(phi)])
    wo = np.array([1, 1, 0]) / np.sqrt(2)
    dot = np.tensordot(wo, m, 1)
    wi = 2 * dot * m - wo[:, None, None]

    def g1(w, facing):
        tan2 = (1 - w**2) / w**2
        return np.where(facing & (w > 0), 2 / (1 + np.sqrt(1 + alpha**2 * tan2)), 0)

    g = g1(np.full_like(dot, wo[1]), dot > 0) * g1(wi[1], (wi * m).sum(0) > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(wi[0] < 0, -1 / wi[0], np.inf)
        y, z = wi[1] * t, wi[2] * t
    hit = np.isfinite(t) & (np.abs(y - 1) <= half) & (np.abs(z) <= half)
    return float(np.mean(np.where(hit, g * dot / (wo[1] * cos_m), 0)))


class Renderers:
    def __init__(self, binary):
        self.binary = binary
        mi.set_variant("scalar_rgb")
        mi.set_log_level(mi.LogLevel.Error)

    def etendue(self, xml, samples):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder)
            (path / "s.xml").write_text(xml)
            subprocess.run(
                [self.binary, "render", path / "s.xml", "-o", path / "s.exr", "--spp", str(samples), "-q"],
                check=True,
            )
            return oiio.ImageBuf(str(path / "s.exr")).get_pixels()[..., :3].astype(np.float64).mean()

    def mitsuba(self, xml, samples):
        try:
            image = np.array(mi.render(mi.load_string(xml), spp=samples, seed=0), dtype=np.float64)
        except Exception:  # it refuses some of these: no point in the plot
            return float("nan")
        return image[..., :3].mean()

    def both(self, xml, samples):
        return self.etendue(xml, samples), self.mitsuba(xml, samples)


def write(folder, name, header, rows):
    with open(folder / f"{name}.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{x:.6g}" for x in row] for row in rows)


def plot(folder, name, title, label, rows, floor):
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    data = np.array(rows, dtype=float)
    for column, (who, colour) in enumerate(COLOURS.items(), start=1):
        error = np.maximum(np.abs(data[:, column]), floor)
        axes.plot(data[:, 0], error, "o-", ms=3.5, lw=1.2, color=colour, label=who)
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="relative error", title=title)
    axes.axhline(floor, color="#888", lw=0.8, ls=":")
    axes.set_ylim(floor / 2, 2)
    axes.grid(alpha=0.25)
    axes.legend()
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def main():
    binary, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    renderers = Renderers(binary)
    centre = (0.0, 0.0, 0.0)
    one = renderers.both(room(1.0, centre), SAMPLES)

    def against_one(found):
        return [a / b - 1 for a, b in zip(found, one)]

    rows = [[2.0**k, *against_one(renderers.both(room(2.0**k, centre), SAMPLES))] for k in range(-40, 41, 2)]
    write(folder, "scale", ["scale", *COLOURS], rows)
    plot(folder, "scale", "A room times its scale (exact: 1e-9 stands for 0)", "scale", rows, 1e-9)
    rows = [
        [2.0**k, *against_one(renderers.both(room(1.0, (2.0**k,) * 3), SAMPLES))] for k in range(0, 41, 2)
    ]
    write(folder, "distance", ["distance", *COLOURS], rows)
    title = "A room of size 2 and its camera, moved (1e-9 stands for 0)"
    plot(folder, "distance", title, "distance in x, y and z", rows, 1e-9)
    rows = []
    for alpha in 10.0 ** np.arange(0, -8.25, -0.5):
        truth = mirror_truth(alpha, 0.5)
        found = renderers.both(lamp_in_mirror(float(alpha), 0.5), 4096)
        rows.append([alpha, *(value / truth - 1 for value in found)])
    write(folder, "roughness", ["alpha", *COLOURS], rows)
    title = "A lamp in a mirror, 4096 samples in 64 pixels"
    plot(folder, "roughness", title, "roughness alpha", rows, 1e-6)


if __name__ == "__main__":
    main()
