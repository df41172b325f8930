#!/usr/bin/env python3
"""Writes the textures of this scene: Python's standard library alone.

    scenes/tiled-court/make_scene.py

mosaic.png: small square tiles in four glazes with bright joints, 512 x 512.
boards.png: planks with grain, 512 x 256. Both repeat without a seam.
"""
import math
import pathlib
import random
import struct
import zlib

HERE = pathlib.Path(__file__).resolve().parent


def write_png(name, width, height, texel):
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rows += bytes(texel(x, y))

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    (HERE / name).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b"")
    )


def mosaic():
    rng = random.Random(1)
    glazes = [(22, 48, 92), (196, 168, 112), (150, 52, 36), (236, 230, 214)]
    n, size = 32, 16
    tiles = [[0] * n for _ in range(n)]
    for j in range(n):
        for i in range(n):
            ring = int(math.hypot((i + 0.5) % 16 - 8, (j + 0.5) % 16 - 8))
            base = glazes[(ring // 2) % 4] if rng.random() > 0.15 else glazes[rng.randrange(4)]
            shade = rng.choice([0.82, 0.9, 1.0, 1.06])
            tiles[j][i] = tuple(min(255, int(c * shade)) for c in base)

    def texel(x, y):
        joint = x % size == 0 or y % size == 0
        return (214, 210, 200) if joint else tiles[y // size][x // size]

    write_png("mosaic.png", 512, 512, texel)


def boards():
    rng = random.Random(2)
    width, height, count = 512, 256, 8
    tone = [rng.uniform(0.75, 1.1) for _ in range(count)]
    cut = [rng.randrange(width) for _ in range(count)]
    grain = [[rng.choice([0.8, 0.9, 1.0, 1.0, 1.05]) for _ in range(height)] for _ in range(2)]

    def texel(x, y):
        board = y * count // height
        if y % (height // count) == 0 or x == cut[board]:
            return (40, 26, 16)
        wave = int(2.5 * math.sin(2 * math.pi * x / width * (1 + board % 3)))
        shade = tone[board] * grain[0][(y + wave) % height]
        return tuple(min(255, int(c * shade)) for c in (176, 118, 66))

    write_png("boards.png", width, height, texel)


mosaic()
boards()
