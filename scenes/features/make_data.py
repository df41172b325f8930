#!/usr/bin/env python3
"""Writes data/: the tiny images and meshes that the feature scenes read.

Needs numpy and OpenImageIO. The same versions write the same bytes.
"""
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

DATA = Path(__file__).resolve().parent / "data"


def write_image(name, pixels, kind=oiio.FLOAT, **attributes):
    pixels = np.atleast_3d(pixels).astype(np.float32)
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("DateTime", "2000:01:01 00:00:00")  # else the clock's
    for key, value in attributes.items():
        spec.attribute(key.replace("_", ":"), value)
    output = oiio.ImageOutput.create(str(DATA / name))
    assert output, oiio.geterror()
    assert output.open(str(DATA / name), spec), output.geterror()
    assert output.write_image(pixels), output.geterror()
    output.close()


def grid(width, height):
    """Texel centres as (u to the right, v downwards), each in (0, 1)."""
    v, u = np.mgrid[0:height, 0:width]
    return (u + 0.5) / width, (v + 0.5) / height


def images():
    rng = np.random.default_rng(7)
    # Every texel another colour, nothing symmetric: a flipped, shifted or
    # transposed texture cannot look right.
    u, v = grid(8, 6)
    noise = rng.random((6, 8, 3))
    tiles = np.clip(np.dstack([u, v, 1 - u * v]) * 0.5 + 0.4 * noise, 0.05, 0.95)
    write_image("tiles.png", tiles, oiio.UINT8)
    write_image("tiles.exr", tiles.astype(np.float16), oiio.HALF, compression="zip")
    write_image("tiles.hdr", tiles)
    write_image("tiles.tga", tiles[::-1, :, ::-1], oiio.UINT8)
    write_image("tiles.bmp", tiles[:, ::-1], oiio.UINT8)
    u, v = grid(32, 32)
    smooth = np.dstack([0.2 + 0.6 * u, 0.7 - 0.4 * v, 0.3 + 0.3 * np.sin(5 * u + 3 * v)])
    write_image("smooth.jpg", smooth, oiio.UINT8, jpeg_subsampling="4:4:4", compression="jpeg:97")
    # Opacity and blend weight: one channel.
    write_image("weight.png", 0.1 + 0.8 * rng.random((5, 7)), oiio.UINT8)
    holes = np.ones((8, 8))
    holes[1:4, 2:6] = 0
    holes[5:7, 1:3] = 0.5
    write_image("holes.png", holes, oiio.UINT8)
    # Height of the bump map, periodic; tangent-space normals of the normal map.
    u, v = grid(32, 32)
    height = 0.5 + 0.2 * np.sin(2 * np.pi * u) * np.cos(4 * np.pi * v) + 0.1 * np.sin(6 * np.pi * u)
    write_image("height.png", height, oiio.UINT8)
    normal = np.dstack([0.35 * np.sin(4 * np.pi * u), 0.35 * np.cos(2 * np.pi * v), np.ones_like(u)])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    write_image("normal.png", 0.5 + 0.5 * normal, oiio.UINT8)
    # An environment: dim gradient, one warm and one cold lamp a few texels wide.
    u, v = grid(32, 16)
    sky = np.dstack([0.3 + 0.2 * v, 0.4 + 0 * v, 0.6 - 0.3 * v]) * (1 + 0.5 * np.sin(2 * np.pi * u))[..., None]
    sky[3:5, 5:8] += (12, 9, 5)
    sky[6:8, 22:24] += (2, 5, 9)
    write_image("sky.exr", sky.astype(np.float16), oiio.HALF, compression="zip")
    # A lamp with a pattern: above 1, so only a float file can hold it.
    write_image("lamp.exr", 1 + 6 * rng.random((4, 6, 3)), compression="zip")
    # A lamp with a bright spot of a few texels, a faint one, and dark all around.
    spot = np.zeros((16, 24, 3))
    spot[:, :] = (0.02, 0.03, 0.05)
    spot[:4] = 0
    spot[5:7, 15:17] = (160, 120, 70)
    spot[11, 4] = (10, 40, 60)
    write_image("spot.exr", spot.astype(np.float16), oiio.HALF, compression="zip")


def torus(rings, sides, major, minor):
    """A torus around z as quads, with texture coordinates and a seam."""
    i, j = np.mgrid[0:rings + 1, 0:sides + 1]
    a, b = 2 * np.pi * i / rings, 2 * np.pi * j / sides
    ring = major + minor * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), minor * np.sin(b)], -1).reshape(-1, 3)
    normals = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], -1).reshape(-1, 3)
    uvs = np.stack([i / rings, j / sides], -1).reshape(-1, 2)
    at = lambda r, s: r * (sides + 1) + s
    quads = [(at(r, s), at(r + 1, s), at(r + 1, s + 1), at(r, s + 1)) for r in range(rings) for s in range(sides)]
    return points, normals, uvs, quads


def triangles(quads):
    return [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def ply():
    # ASCII, triangles, texture coordinates, no normals: the loader makes them.
    points, _, uvs, quads = torus(12, 8, 0.7, 0.3)
    with open(DATA / "torus.ply", "w", encoding="ascii") as file:
        file.write(f"ply\nformat ascii 1.0\ncomment 12 x 8 torus\nelement vertex {len(points)}\n")
        file.write("property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n")
        file.write(f"element face {2 * len(quads)}\nproperty list uchar int vertex_indices\nend_header\n")
        for p, t in zip(points, uvs):
            file.write(" ".join(f"{x:.6g}" for x in (*p, *t)) + "\n")
        for t in triangles(quads):
            file.write("3 " + " ".join(map(str, t)) + "\n")
    # Big-endian binary, triangles, normals: an octahedron of radius 1.
    corners = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], np.float64)
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (1, 0, 5), (2, 1, 5), (3, 2, 5), (0, 3, 5)]
    with open(DATA / "octahedron.ply", "wb") as file:
        file.write(b"ply\nformat binary_big_endian 1.0\nelement vertex 6\n")
        file.write(b"".join(f"property float {n}\n".encode() for n in ("x", "y", "z", "nx", "ny", "nz")))
        file.write(b"element face 8\nproperty list uchar uint vertex_indices\nend_header\n")
        for p in corners:
            file.write(struct.pack(">6f", *p, *p))
        for f in faces:
            file.write(struct.pack(">B3I", 3, *f))


def obj():
    # Three groups, quads and a triangle, smooth and flat vertex normals. All
    # corners have v/vt/vn: Mitsuba leaves the others' values undefined.
    with open(DATA / "groups.obj", "w", encoding="ascii") as file:
        file.write("# A roof, a wall and a step.\no house\ng roof\n")
        file.write("v -1 0.2 0\nv 1 0.2 0\nv 1 1 -0.8\nv -1 1 -0.8\n")
        file.write("vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0.70710678 0.70710678\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")
        file.write("g wall\nusemtl stone\nv -1 -1 0.2\nv 0.2 -1 0.2\nv -1 0.2 0.2\n")
        file.write("vn -0.3 0 1\nvn 0.3 0 1\nvn 0 0.4 1\nf 5/1/2 6/2/3 7/4/4\n")
        file.write("g step\ns off\nv 0.4 -1 0.4\nv 1 -1 0.4\nv 1 -0.6 0\nv 0.4 -0.6 0\nvn 0 0.6 0.8\n")
        file.write("f 8/1/5 9/2/5 10/3/5 11/4/5\n")


def pane():
    # A fan of triangles whose texture follows the place, bent in the middle.
    with open(DATA / "pane.obj", "w", encoding="ascii") as file:
        corners = [(-1, -0.8), (0, -0.8), (1, -0.8), (1, 0.8), (0, 0.8), (-1, 0.8), (0.1, 0.05)]
        for i, (x, y) in enumerate(corners):
            file.write(f"v {x} {y} {-0.3 if i in (1, 4, 6) else 0}\nvt {0.5 * (x + 1):.6g} {0.5 * (y / 0.8 + 1):.6g}\n")
        file.write("vn 0 0 1\n")
        for i in range(6):
            a, b = i + 1, (i + 1) % 6 + 1
            file.write(f"f {a}/{a}/1 {b}/{b}/1 7/7/1\n")


def serialized():
    """Version 4: two meshes, single and double precision, with a dictionary."""
    def mesh(name, points, normals, uvs, faces, double):
        flags = (0x2000 if double else 0x1000) | (0x1 if normals is not None else 0) | (0x2 if uvs is not None else 0)
        kind = "<f8" if double else "<f4"
        body = struct.pack("<I", flags) + name.encode() + b"\0" + struct.pack("<QQ", len(points), len(faces))
        for array in (points, normals, uvs):
            if array is not None:
                body += np.asarray(array, kind).tobytes()
        body += np.asarray(faces, "<u4").tobytes()
        return struct.pack("<HH", 0x041C, 4) + zlib.compress(body, 9)

    points, normals, uvs, quads = torus(10, 6, 0.65, 0.35)
    first = mesh("ring", points, normals, uvs, triangles(quads), False)
    pyramid = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1.2)]
    sides = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (2, 1, 0), (3, 2, 0)]
    second = mesh("pyramid", pyramid, None, None, sides, True)
    dictionary = struct.pack("<QQI", 0, len(first), 2)
    (DATA / "two.serialized").write_bytes(first + second + dictionary)


def curves():
    """Control points and radii: two locks, and a few thick ones with bends."""
    rng = np.random.default_rng(11)

    def write(name, strands):
        blocks = ["".join(" ".join(f"{x:.6g}" for x in p) + "\n" for p in strand) for strand in strands]
        (DATA / name).write_text("\n".join(blocks), encoding="ascii")

    def lock(count, points, width, radius):
        # Strands that rise from a spot on the floor, bend over and thin out.
        s = np.linspace(0, 1, points)
        for _ in range(count):
            x, z = width * rng.uniform(-1, 1, 2)
            bend, twist, height = rng.uniform(0.3, 0.9), rng.uniform(-0.4, 0.4), rng.uniform(0.9, 1.3)
            wave = 0.05 * np.sin(7 * s + rng.uniform(0, 6))
            rise = height * s * (1.3 - 0.6 * s)
            yield np.stack([x + bend * s**2 + wave, rise, z + twist * s**2 - wave, radius * (1.1 - s)], -1)

    write("strands.txt", lock(14, 6, 0.25, 0.045))
    write("lock.txt", lock(18, 9, 0.25, 0.035))
    a = np.linspace(0, 2 * np.pi, 9)
    ring = np.stack([0.6 * np.cos(a), 0.25 * a / np.pi, 0.6 * np.sin(a), 0.1 + 0.06 * np.sin(2 * a)], -1)
    zigzag = [(-0.6, 0.1, 0, 0.1), (-0.3, 0.6, 0.1, 0.16), (0.1, 0.2, 0, 0.07), (0.5, 0.7, -0.1, 0.2)]
    write("loops.txt", [ring, np.array(zigzag) + (0, 0.6, 0, 0)])
    write("zigzag.txt", [zigzag, [(0.1, 0.9, 0.3, 0.05), (0.6, 1.1, 0.4, 0.15)]])


if __name__ == "__main__":
    DATA.mkdir(exist_ok=True)
    images()
    ply()
    obj()
    pane()
    serialized()
    curves()
