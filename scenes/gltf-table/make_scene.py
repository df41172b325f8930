#!/usr/bin/env python3
"""Writes table.glb beside this file: a table full of what glTF can say.

A row of spheres shows the material extensions; around them are textures with
transforms, a second set of texture coordinates, vertex colours, alpha cut-outs,
instances, an animated mobile, a skinned blade of grass and a morphing lump,
two lights, two cameras and two variants. The same bytes each time. Only the
standard library is needed: python3 make_scene.py [FILE]
"""

import json
import math
import struct
import sys
import zlib
from pathlib import Path

ROOT = {"asset": {"version": "2.0", "generator": "etendue scenes/gltf-table/make_scene.py",
                  "copyright": "CC0 1.0"}}
BIN = bytearray()
FLOAT, SHORT, USHORT, BYTE, UBYTE = 5126, 5122, 5123, 5120, 5121
CODES = {FLOAT: "f", SHORT: "h", USHORT: "H", BYTE: "b", UBYTE: "B"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def put(array, value):
    """Appends to an array of the root and gives the index."""
    ROOT.setdefault(array, []).append(value)
    return len(ROOT[array]) - 1


def view(data, **more):
    BIN.extend(b"\0" * (-len(BIN) % 4))
    BIN.extend(data)
    return put("bufferViews", {"buffer": 0, "byteOffset": len(BIN) - len(data), "byteLength": len(data), **more})


def accessor(rows, kind, code=FLOAT, bounds=False, **more):
    """An accessor of rows of numbers; rows of bytes and shorts are padded to four bytes."""
    width = WIDTHS[kind]
    rows = [row if isinstance(row, (list, tuple)) else [row] for row in rows]
    size = struct.calcsize(CODES[code]) * width
    pad = -size % 4 if kind != "SCALAR" else 0
    data = b"".join(struct.pack(f"<{width}{CODES[code]}", *row) + b"\0" * pad for row in rows)
    stride = {"byteStride": size + pad} if pad else {}
    if bounds:
        columns = list(zip(*[struct.unpack(f"<{width}{CODES[code]}", struct.pack(f"<{width}{CODES[code]}", *r)) for r in rows]))
        more |= {"min": [min(c) for c in columns], "max": [max(c) for c in columns]}
    return put("accessors", {"bufferView": view(data, **stride), "componentType": code, "type": kind,
                             "count": len(rows), **more})


def png(width, height, texel):
    """A PNG of RGBA bytes."""
    rows = b"".join(b"\0" + bytes(c for x in range(width) for c in texel(x, y)) for y in range(height))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def texture(name, width, height, texel, sampler=None):
    image = put("images", {"name": name, "mimeType": "image/png", "bufferView": view(png(width, height, texel))})
    found = {"source": image}
    if sampler is not None:
        found["sampler"] = sampler
    return put("textures", found)


def material(name, color=(1, 1, 1, 1), metal=0.0, rough=0.5, extensions=None, **more):
    pbr = {"baseColorFactor": list(color), "metallicFactor": metal, "roughnessFactor": rough} | more.pop("pbr", {})
    found = {"name": name, "pbrMetallicRoughness": pbr, **more}
    if extensions:
        found["extensions"] = {f"KHR_materials_{key}": value for key, value in extensions.items()}
    return put("materials", found)


def mesh(name, primitive, material, **more):
    return put("meshes", {"name": name, "primitives": [primitive | {"material": material}], **more})


def node(name, parent=None, **more):
    index = put("nodes", {"name": name, **more})
    if parent is None:
        ROOT["scenes"][0]["nodes"].append(index)
    else:
        ROOT["nodes"][parent].setdefault("children", []).append(index)
    return index


def turn(axis, degrees):
    s, c = math.sin(math.radians(degrees) / 2), math.cos(math.radians(degrees) / 2)
    return [axis[0] * s, axis[1] * s, axis[2] * s, c]


def sphere(columns=36, rows=18):
    points, uvs, indices = [], [], []
    for j in range(rows + 1):
        for i in range(columns + 1):
            a, b = 2 * math.pi * i / columns, math.pi * j / rows
            points.append((math.sin(b) * math.sin(a), math.cos(b), math.sin(b) * math.cos(a)))
            uvs.append((i / columns, j / rows))
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            b = a + columns + 1
            indices += ([a, b, a + 1] if j else []) + ([a + 1, b, b + 1] if j < rows - 1 else [])
    # Quantised: sixteen bits for places, eight for directions.
    position = accessor([[round(c * 32767) for c in p] for p in points], "VEC3", SHORT, True, normalized=True)
    normal = accessor([[round(c * 127) for c in p] for p in points], "VEC3", BYTE, normalized=True)
    uv = accessor([[round(c * 65535) for c in t] for t in uvs], "VEC2", USHORT, normalized=True)
    return {"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv},
            "indices": accessor(indices, "SCALAR", USHORT)}


def quad(second_set=False, colors=None):
    """The square [-1, 1]² in x and z, facing up; v goes down the image."""
    attributes = {
        "POSITION": accessor([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], "VEC3", bounds=True),
        "NORMAL": accessor([(0, 1, 0)] * 4, "VEC3"),
        "TEXCOORD_0": accessor([(0, 1), (1, 1), (1, 0), (0, 0)], "VEC2"),
    }
    if second_set:
        attributes["TEXCOORD_1"] = accessor([(0, 6), (6, 6), (6, 0), (0, 0)], "VEC2")
    if colors:
        attributes["COLOR_0"] = accessor(colors, "VEC3", UBYTE, normalized=True)
    return {"attributes": attributes, "indices": accessor([0, 1, 2, 0, 2, 3], "SCALAR", USHORT)}


def rock():
    """An icosahedron without normals: flat, as the specification has it."""
    g = (1 + 5 ** 0.5) / 2
    points = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g),
              (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8,
             3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1]
    return {"attributes": {"POSITION": accessor([[c / 2 for c in p] for p in points], "VEC3", bounds=True)},
            "indices": accessor(faces, "SCALAR", UBYTE)}


def materials_row(ball):
    """Spheres with the material extensions, from left to right."""
    bumps = texture("bumps", 32, 32, lambda x, y: (
        round(127.5 + 60 * math.sin(2 * math.pi * x / 8)), round(127.5 + 60 * math.sin(2 * math.pi * y / 8)), 235, 255))
    row = [
        material("gold", (1, 0.77, 0.34, 1), 1, 0.2),
        material("car paint", (0.6, 0.02, 0.05, 1), 0.4, 0.6,
                 {"clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.03}}),
        material("velvet", (0.1, 0.02, 0.2, 1), 0, 0.9,
                 {"sheen": {"sheenColorFactor": [0.6, 0.4, 0.9], "sheenRoughnessFactor": 0.4}}),
        material("glass", (1, 1, 1, 1), 0, 0, {"transmission": {"transmissionFactor": 1}, "ior": {"ior": 1.5},
                                               "volume": {"thicknessFactor": 1}}),
        material("bubble", (0.05, 0.05, 0.05, 1), 0, 0.05,
                 {"iridescence": {"iridescenceFactor": 1, "iridescenceIor": 1.4, "iridescenceThicknessMaximum": 480},
                  "specular": {"specularFactor": 1, "specularColorFactor": [1, 1, 1]}}),
        material("brushed steel", (0.7, 0.7, 0.72, 1), 1, 0.35,
                 {"anisotropy": {"anisotropyStrength": 0.8, "anisotropyRotation": 0.6}}),
        material("leather", (0.25, 0.12, 0.06, 1), 0, 0.6, normalTexture={"index": bumps, "scale": 0.8, "extensions": {
            "KHR_texture_transform": {"scale": [6, 3]}}}),
        material("wax", (0.9, 0.85, 0.7, 1), 0, 0.5,
                 {"diffuse_transmission": {"diffuseTransmissionFactor": 0.5,
                                           "diffuseTransmissionColorFactor": [1, 0.7, 0.4]}}),
    ]
    for i, look in enumerate(row):
        x = (i - (len(row) - 1) / 2) * 1.05
        name = ROOT["materials"][look]["name"]
        node(name, mesh=mesh(name, ball, look), translation=[x, 0.45, 0], scale=[0.45] * 3)


def table():
    """The table top, with wood stripes on one set of coordinates and wear on another."""
    stripes = texture("stripes", 64, 8, lambda x, y: (
        *(round(c * (0.75 + 0.25 * math.sin(x * 0.7 + math.sin(x * 0.2)))) for c in (190, 140, 95)), 255))
    wear = texture("wear", 16, 16, lambda x, y: (255, 90 + (x * 37 + y * 59) % 100, 0, 255))
    oak = material("oak", pbr={"baseColorTexture": {"index": stripes},
                               "metallicRoughnessTexture": {"index": wear, "texCoord": 1}, "roughnessFactor": 1.0})
    slate = material("slate", (0.06, 0.07, 0.08, 1), 0, 0.4)
    top = mesh("table top", quad(second_set=True), oak)
    ROOT["meshes"][top]["primitives"][0]["extensions"] = {
        "KHR_materials_variants": {"mappings": [{"material": oak, "variants": [0]}, {"material": slate, "variants": [1]}]}}
    node("table", mesh=top, scale=[6, 1, 4])


def cards():
    """Upright cards: vertex colours, a cut-out, a blend, something unlit and something that glows."""
    clamp = put("samplers", {"magFilter": 9728, "wrapS": 33071, "wrapT": 33071})
    dots = texture("dots", 32, 32, lambda x, y: (
        40, 150, 60, 255 if (x % 8 - 3.5) ** 2 + (y % 8 - 3.5) ** 2 < 9 else 0), clamp)
    fade = texture("fade", 32, 1, lambda x, y: (230, 60, 40, 8 * x))
    looks = [
        (material("colors"), quad(colors=[(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)])),
        (material("dots", alphaMode="MASK", doubleSided=True, pbr={"baseColorTexture": {"index": dots}}), quad()),
        (material("fade", alphaMode="BLEND", doubleSided=True, pbr={"baseColorTexture": {"index": fade}}), quad()),
        (material("sign", (0.2, 0.5, 0.9, 1), extensions={"unlit": {}}), quad()),
        (material("panel", (0, 0, 0, 1), emissiveFactor=[1, 0.8, 0.5],
                  extensions={"emissive_strength": {"emissiveStrength": 6}}), quad()),
    ]
    for i, (look, square) in enumerate(looks):
        name = ROOT["materials"][look]["name"]
        node(f"card {name}", mesh=mesh(name, square, look), translation=[(i - 2) * 1.6, 0.7, -2],
             rotation=turn((1, 0, 0), 80), scale=[0.6, 1, 0.6])


def pebbles():
    """Forty instances of one rock."""
    places, turns, sizes = [], [], []
    for i in range(40):
        a = i * 2.399963
        r = 2.0 + 0.35 * math.sin(3 * a)
        places.append((1.6 * r * math.sin(a), 0.06, 0.2 + r * math.cos(a) * 0.7))
        turns.append(turn((0.6, 0.64, 0.48), 77 * i))
        sizes.append([0.05 + 0.04 * (i * 7 % 10) / 10] * 3)
    look = material("pebble", (0.35, 0.33, 0.3, 1), 0, 0.8)
    node("pebbles", mesh=mesh("pebble", rock(), look), extensions={"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": accessor(places, "VEC3"), "ROTATION": accessor(turns, "VEC4"), "SCALE": accessor(sizes, "VEC3")}}})


def mobile(ball, times):
    """Three balls that turn about a stem, and each other, once in two seconds."""
    look = material("coral", (0.9, 0.3, 0.25, 1), 0, 0.3)
    stem = node("mobile", translation=[3.2, 1.1, 1.0])
    shared = mesh("mobile ball", ball, look)
    for i in range(3):
        arm = node(f"arm {i}", stem, rotation=turn((0, 1, 0), 120 * i))
        node(f"ball {i}", arm, mesh=shared, translation=[0.5, 0, 0], scale=[0.16] * 3)
    output = accessor([turn((0, 1, 0), 90 * i) for i in range(5)], "VEC4")
    return {"target": (stem, "rotation"), "input": times, "output": output}


def grass(times):
    """A blade on a chain of three joints that sways."""
    points, normals, joints, weights, indices = [], [], [], [], []
    for j in range(7):
        y, w = j / 6, 0.12 * (1 - j / 7)
        for x in (-w, w):
            points.append((x, y, 0))
            normals.append((0, 0, 1))
            at = min(y * 2, 1.999)
            joints.append((int(at), int(at) + 1, 0, 0))
            weights.append((1 - at % 1, at % 1, 0, 0))
    for j in range(6):
        indices += [2 * j, 2 * j + 1, 2 * j + 2, 2 * j + 2, 2 * j + 1, 2 * j + 3]
    look = material("grass", (0.15, 0.5, 0.1, 1), 0, 0.6, doubleSided=True)
    blade = mesh("blade", {"attributes": {
        "POSITION": accessor(points, "VEC3", bounds=True), "NORMAL": accessor(normals, "VEC3"),
        "JOINTS_0": accessor(joints, "VEC4", UBYTE), "WEIGHTS_0": accessor(weights, "VEC4")},
        "indices": accessor(indices, "SCALAR", USHORT)}, look)
    root = node("grass root", translation=[-3.2, 0, 1.0])
    middle = node("grass middle", root, translation=[0, 0.5, 0])
    tip = node("grass tip", middle, translation=[0, 0.5, 0])
    inverse = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.5 * i, 0, 1] for i in range(3)]
    skin = put("skins", {"joints": [root, middle, tip], "inverseBindMatrices": accessor(inverse, "MAT4")})
    node("grass", mesh=blade, skin=skin)
    output = accessor([turn((0, 0, 1), a) for a in (0, 35, 0, -35, 0)], "VEC4")
    return [{"target": (part, "rotation"), "input": times, "output": output} for part in (root, middle)]


def lump(times):
    """An icosahedron that becomes a spindle and back, on a spline."""
    primitive = rock()
    count = ROOT["accessors"][primitive["attributes"]["POSITION"]]["count"]
    stretch = accessor([(0, 0.6 if i in (0, 1, 5, 7) else -0.3, 0) for i in range(count)], "VEC3", bounds=True)
    primitive["targets"] = [{"POSITION": stretch}]
    look = material("clay", (0.7, 0.4, 0.25, 1), 0, 0.9)
    at = node("lump", mesh=mesh("lump", primitive, look, weights=[0]), translation=[0, 0.3, 1.5], scale=[0.35] * 3)
    keys = [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0]
    return {"target": (at, "weights"), "input": times, "output": accessor(keys, "SCALAR"), "interpolation": "CUBICSPLINE"}


def animate(tracks):
    channels, samplers = [], []
    for track in tracks:
        target, path = track.pop("target")
        channels.append({"sampler": len(samplers), "target": {"node": target, "path": path}})
        samplers.append(track)
    put("animations", {"name": "sway", "channels": channels, "samplers": samplers})


def lights_and_cameras():
    ROOT["extensions"] = {
        "KHR_lights_punctual": {"lights": [
            {"type": "directional", "name": "sun", "color": [1, 0.95, 0.85], "intensity": 2.5},
            {"type": "spot", "name": "lamp", "color": [0.6, 0.8, 1], "intensity": 30,
             "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}]},
        "KHR_materials_variants": {"variants": [{"name": "oak"}, {"name": "slate"}]}}
    node("sun", rotation=turn((1, 0, 0), -55), extensions={"KHR_lights_punctual": {"light": 0}})
    node("lamp", translation=[-3, 3.5, 2.5], rotation=turn((0.82, 0.57, 0.04), -62),
         extensions={"KHR_lights_punctual": {"light": 1}})
    wide = put("cameras", {"name": "wide", "type": "perspective",
                           "perspective": {"yfov": 0.62, "aspectRatio": 16 / 9, "znear": 0.05}})
    plan = put("cameras", {"name": "plan", "type": "orthographic",
                           "orthographic": {"xmag": 5.6, "ymag": 3.15, "znear": 0, "zfar": 30}})
    node("front", camera=wide, translation=[0, 3.4, 8.6], rotation=turn((1, 0, 0), -19))
    node("above", camera=plan, translation=[0, 10, 0], rotation=turn((1, 0, 0), -90))


def main():
    ROOT["scene"], ROOT["scenes"] = 0, [{"name": "table", "nodes": []}]
    ball = sphere()
    table()
    materials_row(ball)
    cards()
    pebbles()
    times = accessor([0, 0.5, 1, 1.5, 2], "SCALAR", bounds=True)
    animate([mobile(ball, times), *grass(times), lump(times)])
    lights_and_cameras()
    names = set()

    def extensions(value):
        if isinstance(value, dict):
            names.update(value.get("extensions", {}))
            for inner in value.values():
                extensions(inner)
        elif isinstance(value, list):
            for inner in value:
                extensions(inner)

    extensions(ROOT)
    ROOT["extensionsUsed"] = sorted(names | {"KHR_mesh_quantization"})
    ROOT["extensionsRequired"] = ["EXT_mesh_gpu_instancing", "KHR_mesh_quantization"]
    BIN.extend(b"\0" * (-len(BIN) % 4))
    ROOT["buffers"] = [{"byteLength": len(BIN)}]
    text = json.dumps(ROOT, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(BIN)
    out = sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("table.glb")
    with open(out, "wb") as file:
        file.write(b"glTF" + struct.pack("<II", 2, total))
        file.write(struct.pack("<I", len(text)) + b"JSON" + text)
        file.write(struct.pack("<I", len(BIN)) + b"BIN\0" + BIN)
    print(f"{out}: {total} bytes")


main()
