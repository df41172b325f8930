"""Writes scene.xml: a hall of pillars under 1,000 small lamps, each a rectangle that shines from one side.

python make_scene.py            scene.xml, every lamp chosen alike by a renderer that chooses uniformly
python make_scene.py weighted   scene-weighted.xml, the same with sampling_weight = power (for races only)
"""
import math
import random
import sys

WIDTH, HEIGHT, SPACING, LAMPS = 48.0, 5.0, 6.0, 1000

HEAD = """<?xml version='1.0' encoding='utf-8'?>
<scene version="3.0.0">
    <default name="spp" value="64" />
    <default name="resx" value="512" />
    <default name="resy" value="288" />
    <default name="max_depth" value="4" />
    <integrator type="path">
        <integer name="max_depth" value="$max_depth" />
    </integrator>
    <sensor type="perspective">
        <float name="fov" value="60" />
        <transform name="to_world">
            <lookat origin="-22, 3.2, -21" target="0, 1.2, 2" up="0, 1, 0" />
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="$spp" />
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="$resx" />
            <integer name="height" value="$resy" />
            <string name="pixel_format" value="rgb" />
            <rfilter type="box" />
        </film>
    </sensor>
    <bsdf type="twosided" id="Stone"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.48, 0.45" /></bsdf></bsdf>
    <bsdf type="twosided" id="Pillar"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.35, 0.25" /></bsdf></bsdf>
    <bsdf type="twosided" id="Floor"><bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.3, 0.33, 0.38" /><float name="alpha" value="0.2" /></bsdf></bsdf>
    <bsdf type="twosided" id="Lamp"><bsdf type="diffuse"><rgb name="reflectance" value="0, 0, 0" /></bsdf></bsdf>
"""


def shape(kind, material, matrix, inside=""):
    value = " ".join(f"{x:.5g}" for row in matrix for x in row) + " 0 0 0 1"
    return (
        f'    <shape type="{kind}"><transform name="to_world"><matrix value="{value}" /></transform>'
        f'<ref id="{material}" />{inside}</shape>\n'
    )


def box(material, centre, half):
    rows = [[half[i] if i == j else 0.0 for j in range(3)] + [centre[i]] for i in range(3)]
    return shape("cube", material, rows)


def lamp(rng, weighted):
    p = [rng.uniform(-23.5, 23.5), rng.uniform(0.6, 4.6), rng.uniform(-23.5, 23.5)]
    half = rng.uniform(0.03, 0.08)
    # Two of three shine down, the others anywhere.
    while True:
        n = [rng.uniform(-1, 1) for _ in range(3)]
        length = math.sqrt(sum(x * x for x in n))
        if 0.1 < length < 1:
            break
    n = [x / length for x in n]
    if rng.random() < 2 / 3:
        n = [0.2 * n[0], -1.0, 0.2 * n[2]]
        length = math.sqrt(sum(x * x for x in n))
        n = [x / length for x in n]
    helper = [1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 0.0, 1.0]
    x = [n[1] * helper[2] - n[2] * helper[1], n[2] * helper[0] - n[0] * helper[2], n[0] * helper[1] - n[1] * helper[0]]
    length = math.sqrt(sum(v * v for v in x))
    x = [v / length for v in x]
    y = [n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2], n[0] * x[1] - n[1] * x[0]]
    rows = [[half * x[i], half * y[i], n[i], p[i]] for i in range(3)]
    # Powers spread over two decades.
    watts = math.exp(rng.gauss(0.0, 1.0))
    hue = rng.random()
    tint = [1.0, 0.55 + 0.4 * hue, 0.25 + 0.7 * hue]
    radiance = [watts / (math.pi * 4 * half * half) * t for t in tint]
    weight = f'<float name="sampling_weight" value="{watts * sum(tint):.4g}" />' if weighted else ""
    colour = ", ".join(f"{r:.4g}" for r in radiance)
    inside = f'<emitter type="area"><rgb name="radiance" value="{colour}" />{weight}</emitter>'
    return shape("rectangle", "Lamp", rows, inside)


def pillars():
    at = -WIDTH / 2 + SPACING / 2
    while at < WIDTH / 2:
        yield at
        at += SPACING


def main(weighted):
    rng = random.Random(1)
    name = "scene-weighted.xml" if weighted else "scene.xml"
    half, middle = WIDTH / 2, HEIGHT / 2
    with open(name, "w") as out:
        out.write(HEAD)
        out.write(box("Floor", [0, -0.1, 0], [half, 0.1, half]))
        out.write(box("Stone", [0, HEIGHT + 0.1, 0], [half, 0.1, half]))
        for sign in (-1, 1):
            out.write(box("Stone", [sign * (half + 0.1), middle, 0], [0.1, middle, half]))
            out.write(box("Stone", [0, middle, sign * (half + 0.1)], [half, middle, 0.1]))
        for x in pillars():
            for z in pillars():
                out.write(box("Pillar", [x, middle, z], [0.35, middle, 0.35]))
                out.write(box("Stone", [x + 1.6, 0.35, z + 0.7], [0.6, 0.35, 0.3]))
        for _ in range(LAMPS):
            out.write(lamp(rng, weighted))
        out.write("</scene>\n")


main("weighted" in sys.argv[1:])
