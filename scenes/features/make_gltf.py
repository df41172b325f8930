#!/usr/bin/env python3
"""Writes gltf-surfaces and gltf-clear: each once as glTF and once as Mitsuba XML.

    python3 make_gltf.py

Each thing below stands beside its two materials, which mean exactly the same:
the one by the glTF specification and its extensions, the other by Mitsuba's
documentation. What has no equal there is not here: dielectrics by Schlick's
approximation (Mitsuba's follow Fresnel), what makes up for the energy that rough
facets lose, coats, sheen, films, diffuse transmission. So dielectrics reflect
nothing (`specularFactor` 0) or the same from all directions (index 0: f0 = f90),
metals are smooth, and what is clear has index 1. Nor does a mixture of a mirror
and something diffuse stand here but by texels that are the one or the other:
Mitsuba 3.9.1 loses light in a `blendbsdf` of both (refs/README.md). The same bytes each time; only the standard library is needed.
"""
import base64
import json
import math
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent
DATA = HERE / "data"
NO_SPECULAR = {"KHR_materials_specular": {"specularFactor": 0}}


def number(x):
    return f"{x:.9g}"


def row(values):
    return ", ".join(map(number, values))


# Meshes, as glTF and as PLY.

def quad():
    """[-1, 1]² in x and y, facing +z; v goes down, the second set is turned and larger."""
    return {
        "POSITION": [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
        "NORMAL": [(0, 0, 1)] * 4,
        "TEXCOORD_0": [(0, 1), (1, 1), (1, 0), (0, 0)],
        "COLOR_0": [(0.9, 0.1, 0.1), (0.1, 0.8, 0.2), (0.2, 0.2, 0.9), (0.8, 0.8, 0.1)],
    }, [(0, 1, 2), (0, 2, 3)]


def cube():
    """[-1, 1]³ with flat normals."""
    points, normals, faces = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            first = len(points)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = [0, 0, 0]
                corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = sign, a * sign, b
                points.append(tuple(corner))
                normals.append(tuple(sign if k == axis else 0 for k in range(3)))
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return {"POSITION": points, "NORMAL": normals}, faces


def ball():
    """An octahedron divided three times, on the unit sphere, with its normals."""
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(3):
        middles, finer = {}, []

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                sum_ = [a + b for a, b in zip(points[i], points[j])]
                length = math.sqrt(sum(c * c for c in sum_))
                middles[key] = len(points)
                points.append(tuple(float(number(c / length)) for c in sum_))
            return middles[key]

        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return {"POSITION": points, "NORMAL": points}, faces


MESHES = {"quad": quad(), "cube": cube(), "ball": ball()}
PLY = {"POSITION": "xyz", "NORMAL": ("nx", "ny", "nz"), "TEXCOORD_0": "uv", "COLOR_0": ("color_0", "color_1", "color_2")}


def write_ply(name):
    attributes, faces = MESHES[name]
    columns = [column for key in attributes for column in PLY[key]]
    rows = [sum(map(tuple, values), ()) for values in zip(*attributes.values())]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(rows)}", *(f"property float {c}" for c in columns),
             f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(number, r)) for r in rows] + [f"3 {a} {b} {c}" for a, b, c in faces]
    (DATA / f"gltf-{name}.ply").write_text("\n".join(lines) + "\n", encoding="ascii")


# Images: a leaf whose alpha is 0, 0.5 or 1, with its colour and its alpha alone; and one whose channels
# are parameters.

def write_png(name, kind, texels):
    channels = {0: 1, 2: 3, 6: 4}[kind]
    rows = b"".join(b"\0" + bytes(c for texel in line for c in texel) for line in texels)
    assert all(len(texel) == channels for line in texels for texel in line)

    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    head = struct.pack(">IIBBBBB", len(texels[0]), len(texels), 8, kind, 0, 0, 0)
    data = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
    (DATA / name).write_bytes(b"\x89PNG\r\n\x1a\n" + data)


LEAF = ["  ####  ", " ###### ", "##++####", "##+ +###", "### ++##", " ##### #", "  ###  #", "   #    "]


def write_images():
    opacity = {" ": 0, "+": 128, "#": 255}
    alpha = [[opacity[c] for c in line] for line in LEAF]
    color = [[(60 + 20 * x, 200 - 18 * y, 40 + 10 * x + 12 * y) for x in range(8)] for y in range(8)]
    cut = [[255 if a >= 128 else 0 for a in line] for line in alpha]
    write_png("gltf-leaf.png", 6, [[(*c, a) for c, a in zip(*lines)] for lines in zip(color, alpha)])
    write_png("gltf-leaf-color.png", 2, color)
    write_png("gltf-leaf-alpha.png", 0, [[(a,) for a in line] for line in alpha])
    write_png("gltf-leaf-cut.png", 0, [[(a,) for a in line] for line in cut])
    # Red: how much is clear. Blue: metal or not. Alpha: shiny or not.
    cells = [(x, y) for y in range(5) for x in range(6)]
    clear = [(40 * x + 9 * y) % 256 for x, y in cells]
    metal = [255 * ((x + 2 * y) % 3 == 0) for x, y in cells]
    shiny = [255 * ((2 * x + y) % 5 < 2) for x, y in cells]
    lines = lambda texels: [texels[6 * y:6 * y + 6] for y in range(5)]
    write_png("gltf-parts.png", 6, lines([(c, 255, m, s) for c, m, s in zip(clear, metal, shiny)]))
    write_png("gltf-parts-opaque.png", 0, lines([(255 - c,) for c in clear]))
    write_png("gltf-parts-metal.png", 0, lines([(m,) for m in metal]))
    write_png("gltf-parts-shiny.png", 0, lines([(s,) for s in shiny]))


IMAGES = ["gltf-leaf.png", "gltf-parts.png", "normal.png", "smooth.jpg", "tiles.png"]


def texture(image, nearest=False, **more):
    """A reference to a texture of glTF: two for each image, the second nearest."""
    return {"index": 2 * IMAGES.index(image) + nearest, **more}


# Mitsuba's side.

def bitmap(name, image, raw=False, nearest=False, wrap="repeat", to_uv=""):
    return f"""<texture name="{name}" type="bitmap">
            <string name="filename" value="data/{image}" />
            <boolean name="raw" value="{str(raw).lower()}" />
            <string name="filter_type" value="{'nearest' if nearest else 'bilinear'}" />
            <string name="wrap_mode" value="{wrap}" />
            {to_uv}
        </texture>"""


def rgb(name, values):
    return f'<rgb name="{name}" value="{row(values)}" />'


def diffuse(color):
    return f'<bsdf type="diffuse">{color if isinstance(color, str) else rgb("reflectance", color)}</bsdf>'


def sided(inner):
    return f'<bsdf type="twosided">{inner}</bsdf>'


def blend(weight, first, second):
    """`weight` of the second."""
    share = weight if isinstance(weight, str) else f'<float name="weight" value="{number(weight)}" />'
    return f'<bsdf type="blendbsdf">{share}{first}{second}</bsdf>'


def see_through(opacity, inner):
    """The rest is not there, for shadow rays neither."""
    share = opacity if isinstance(opacity, str) else f'<float name="opacity" value="{number(opacity)}" />'
    return f'<bsdf type="mask">{share}{inner}</bsdf>'


def clear(color):
    """Lets all through unbent, tinted: a dielectric of index 1 reflects nothing."""
    index = '<float name="int_ior" value="1" /><float name="ext_ior" value="1" />'
    return f'<bsdf type="dielectric">{index}{rgb("specular_transmittance", color)}</bsdf>'


MIRROR = '<bsdf type="conductor"><string name="material" value="none" /></bsdf>'
# Schlick's approximation from its colour, as in glTF, and as smooth as it can be (alpha 0.001):
# lights without a size would show.
METAL = ('<bsdf type="principled"><rgb name="base_color" value="0.9, 0.5, 0.2" />'
         '<float name="metallic" value="1" /><float name="roughness" value="0" /></bsdf>')
BLACK = diffuse((0, 0, 0))


def area(radiance):
    return f'<emitter type="area">{radiance if isinstance(radiance, str) else rgb("radiance", radiance)}</emitter>'


def inside(sigma):
    """Absorbs; colours must not exceed 1."""
    numbers = '<float name="scale" value="8" /><float name="albedo" value="0" />'
    return f'<medium name="interior" type="homogeneous">{rgb("sigma_t", [s / 8 for s in sigma])}{numbers}</medium>'


# Materials of glTF.

def material(color=(1, 1, 1), metal=0, rough=1, alpha=1, pbr=None, extensions=None, **more):
    base = {"baseColorFactor": [*color, alpha], "metallicFactor": metal, "roughnessFactor": rough, **(pbr or {})}
    return {"pbrMetallicRoughness": base, "extensions": extensions or {}, **more}


def matte(color=(1, 1, 1), extensions=None, **more):
    return material(color, extensions={**NO_SPECULAR, **(extensions or {})}, **more)


def transmitting(share, color, rough=0, volume=None, **more):
    extensions = {**NO_SPECULAR, "KHR_materials_transmission": {"transmissionFactor": share, **more}}
    if volume:
        extensions |= {"KHR_materials_volume": volume, "KHR_materials_ior": {"ior": 1}}
    return material(color, rough=rough, extensions=extensions, doubleSided=volume is None)


def place(at, size=1, turn=(1, 0, 0, 0)):
    """Size, then turn about an axis by degrees, then place."""
    return at, (size if isinstance(size, tuple) else (size,) * 3), turn


# Nothing touches the floor: where a body does, rays of Mitsuba leave it beyond its boundary.
FLOOR = place((0, 0, -1), 5, (1, 0, 0, -90))
# Texture coordinates of the floor: turned by 20 degrees (against the clock in glTF's v-down coordinates), scaled.
WALL = ("wall", "quad", place((0, 3, -3.6), 8), matte((0.5, 0.5, 0.55)), diffuse((0.5, 0.5, 0.55)))
TURN = math.radians(20)
TURNED = {"scale": [3, 2], "rotation": TURN, "offset": [0.3, 0.1]}
TO_UV = ('<transform name="to_uv"><scale x="3" y="2" />'
         f'<rotate z="1" angle="{number(-math.degrees(TURN))}" /><translate x="0.3" y="0.1" /></transform>')

SURFACES = [
    ("floor", "quad", FLOOR,
     matte(pbr={"baseColorTexture": texture("tiles.png", extensions={"KHR_texture_transform": TURNED})}),
     diffuse(bitmap("reflectance", "tiles.png", to_uv=TO_UV))),
    WALL,
    ("lamp", "quad", place((0, 4.5, 0.5), 2, (1, 0, 0, 90)),
     matte((0, 0, 0), {"KHR_materials_emissive_strength": {"emissiveStrength": 2.5}}, emissiveFactor=[1, 0.8, 0.6]),
     BLACK + area((2.5, 2, 1.5))),
    ("picture that glows", "quad", place((-2.6, 1.2, -2.4), (0.8, 0.6, 1), (0, 1, 0, 35)),
     matte((0.2, 0.2, 0.2), emissiveFactor=[1, 1, 1], emissiveTexture=texture("smooth.jpg")),
     diffuse((0.2, 0.2, 0.2)) + area(bitmap("radiance", "smooth.jpg"))),
    ("unlit", "quad", place((2.7, 0.65, -2.4), (0.5, 0.6, 1), (0, 1, 0, -30)),
     material((0.4, 0.1, 0.7), extensions={"KHR_materials_unlit": {}}), BLACK + area((0.4, 0.1, 0.7))),
    ("one-sided, from behind: black", "quad", place((-1.5, 0.65, -2.2), (0.35, 0.6, 1), (0, 1, 0, 200)),
     matte((0.8, 0.3, 0.2)), diffuse((0.8, 0.3, 0.2))),
    ("double-sided, from behind", "quad", place((-0.6, 0.65, -2.2), (0.35, 0.6, 1), (0, 1, 0, 160)),
     matte((0.3, 0.8, 0.2), doubleSided=True), sided(diffuse((0.3, 0.8, 0.2)))),
    ("colours of vertices", "quad", place((0.3, 0.65, -2.2), (0.35, 0.6, 1), (0, 1, 0, 20)),
     matte(), diffuse('<texture name="reflectance" type="mesh_attribute"><string name="name" value="vertex_color" /></texture>')),
    ("normal map", "quad", place((1.3, 0.65, -2.2), (0.5, 0.6, 1), (0, 1, 0, -15)),
     matte((0.7, 0.7, 0.7), normalTexture=texture("normal.png", scale=1)),
     f'<bsdf type="normalmap">{bitmap("normalmap", "normal.png", raw=True)}{diffuse((0.7, 0.7, 0.7))}</bsdf>'),
    ("leaf, cut out", "quad", place((-1.9, 0.75, 0.3), (0.5, 0.7, 1), (0, 1, 0, 25)),
     matte(pbr={"baseColorTexture": texture("gltf-leaf.png", True)}, alphaMode="MASK", alphaCutoff=0.4, doubleSided=True),
     see_through(bitmap("opacity", "gltf-leaf-cut.png", True, True),
                 sided(diffuse(bitmap("reflectance", "gltf-leaf-color.png", nearest=True))))),
    ("leaf, blended", "quad", place((1.9, 0.75, 0.4), (0.5, 0.7, 1), (0, 1, 0, -30)),
     matte(pbr={"baseColorTexture": texture("gltf-leaf.png")}, alphaMode="BLEND", doubleSided=True),
     see_through(bitmap("opacity", "gltf-leaf-alpha.png", True),
                 sided(diffuse(bitmap("reflectance", "gltf-leaf-color.png"))))),
    ("veil", "quad", place((0.1, 1.9, -0.8), (0.6, 0.35, 1), (1, 0, 0, -30)),
     matte((0.7, 0.2, 0.3), alpha=0.7, alphaMode="BLEND"),
     see_through(0.7, diffuse((0.7, 0.2, 0.3)))),
    ("mirror", "ball", place((-0.75, 0.65, 0.2), 0.6), material(metal=1, rough=0), MIRROR),
    ("metal where the texture's blue says so", "quad", place((0.75, 0.75, -0.6), (0.6, 0.7, 1), (0, 1, 0, -25)),
     material(rough=0, metal=1, extensions=NO_SPECULAR, pbr={"metallicRoughnessTexture": texture("gltf-parts.png", True)}),
     blend(bitmap("weight", "gltf-parts-metal.png", True, True), diffuse((1, 1, 1)), MIRROR)),
    ("index 0, which reflects all, where the texture's alpha says so; else a colour", "quad",
     place((0.4, 0.5, 0.9), (0.4, 0.4, 1), (1, 0, 0, -40)),
     material((0.9, 0.4, 0.1), rough=0, extensions={"KHR_materials_ior": {"ior": 0}, "KHR_materials_specular": {
         "specularFactor": 1, "specularTexture": texture("gltf-parts.png", True)}}),
     blend(bitmap("weight", "gltf-parts-shiny.png", True, True), diffuse((0.9, 0.4, 0.1)), MIRROR)),
]
BARS = [((-0.9, 0.2, 1.6), (0.15, 0.15, 0.15), 10), ((0.0, 0.25, 1.9), (0.1, 0.2, 0.1), 40), ((1.2, 0.17, 1.6), (0.3, 0.12, 0.1), -20)]
BAR = matte((0.25, 0.35, 0.6))
PUNCTUAL = [({"type": "point", "color": [0.5, 0.7, 1], "intensity": 9}, (-2.2, 2.6, 1.8)),
            ({"type": "directional", "color": [1, 0.9, 0.7], "intensity": 0.8}, None)]
SUN = (-0.3, -0.9, -0.4)

VOLUME = {"thicknessFactor": 1, "attenuationColor": [0.8, 0.4, 0.15], "attenuationDistance": 0.5}
SIGMA = [-math.log(c) / 0.5 for c in VOLUME["attenuationColor"]]
CLEAR = [
    ("floor", "quad", FLOOR,
     matte(pbr={"baseColorTexture": texture("tiles.png", True)}), diffuse(bitmap("reflectance", "tiles.png", nearest=True))),
    WALL,
    ("lamp", "quad", place((0.5, 4.5, -0.5), 4, (1, 0, 0, 90)),
     matte((0, 0, 0), {"KHR_materials_emissive_strength": {"emissiveStrength": 2}}, emissiveFactor=[0.7, 0.8, 1]),
     BLACK + area((1.4, 1.6, 2))),
    ("thin and clear", "quad", place((-1.9, 0.85, 0.2), (0.6, 0.8, 1), (0, 1, 0, 20)),
     transmitting(1, (0.9, 0.5, 0.3)), clear((0.9, 0.5, 0.3))),
    ("thin, 0.6 of it clear", "quad", place((-0.3, 0.75, -0.6), (0.5, 0.7, 1), (0, 1, 0, -20)),
     transmitting(0.6, (1, 1, 1)), see_through(0.4, sided(diffuse((1, 1, 1))))),
    ("thin, as much of it clear as the texture's red", "quad", place((1.2, 0.85, -1.6), (0.8, 0.8, 1), (0, 1, 0, 10)),
     transmitting(1, (1, 1, 1), transmissionTexture=texture("gltf-parts.png")),
     see_through(bitmap("opacity", "gltf-parts-opaque.png", True), sided(diffuse((1, 1, 1))))),
    ("thin, reflects 0.4 from everywhere", "quad", place((-1.7, 1.05, -2.2), (0.8, 1, 1), (0, 1, 0, 15)),
     material((0.9, 0.9, 0.4), rough=0, doubleSided=True, extensions={
         "KHR_materials_ior": {"ior": 0}, "KHR_materials_specular": {"specularFactor": 0.4},
         "KHR_materials_transmission": {"transmissionFactor": 1}}),
     blend(0.4, clear((0.9, 0.9, 0.4)), sided(MIRROR))),
    ("body, by the distance in the world", "ball", place((1.7, 0.75, 0.2), 0.7),
     transmitting(1, (1, 1, 1), volume=VOLUME), clear((1, 1, 1)) + inside(SIGMA)),
    ("rough body of index 1 with a tint", "cube", place((0.2, 0.5, 1.2), (0.3, 0.45, 0.25), (0, 1, 0, 30)),
     transmitting(1, (0.8, 0.9, 0.95), 0.5, VOLUME), clear((0.8, 0.9, 0.95)) + inside(SIGMA)),
    ("body, 0.7 of it clear", "ball", place((-0.9, 0.45, 1.3), 0.4),
     transmitting(0.7, (1, 1, 1), volume={"thicknessFactor": 1}), see_through(0.3, diffuse((1, 1, 1)))),
    ("coloured metal", "ball", place((-1.75, 0.4, 1.2), 0.35), material((0.9, 0.5, 0.2), metal=1, rough=0), METAL),
    ("lamp in a body", "ball", place((1.8, 0.85, 0.1), 0.3),
     matte((0, 0, 0), {"KHR_materials_emissive_strength": {"emissiveStrength": 3}}, emissiveFactor=[1, 1, 1]),
     BLACK + area((3, 3, 3))),
]
CAMERA = ((0.2, 3.2, 6.2), -24.0, 0.72)  # place, turn about x in degrees, vertical field of view in radians


# The two files.

def quaternion(turn):
    x, y, z, degrees = turn
    s = math.sin(math.radians(degrees) / 2)
    return [x * s, y * s, z * s, math.cos(math.radians(degrees) / 2)]


def between(direction):
    """The turn that takes -z, along which lights shine, to a direction."""
    length = math.sqrt(sum(c * c for c in direction))
    x, y, z = (c / length for c in direction)
    w = math.sqrt((1 - z) / 2)
    return [y / (2 * w), -x / (2 * w), 0, w]


class Gltf:
    def __init__(self):
        self.data = bytearray()
        self.root = {
            "asset": {"version": "2.0", "generator": "etendue scenes/features/make_gltf.py"},
            "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [], "accessors": [],
            "bufferViews": [], "images": [{"uri": f"data/{name}"} for name in IMAGES],
            "samplers": [{"magFilter": 9729}, {"magFilter": 9728}],
            "textures": [{"source": i, "sampler": s} for i in range(len(IMAGES)) for s in (0, 1)],
        }
        self.known = {}

    def put(self, array, value):
        self.root.setdefault(array, []).append(value)
        return len(self.root[array]) - 1

    def accessor(self, rows, kind, code="f", component=5126):
        data = b"".join(struct.pack(f"<{len(r)}{code}", *r) for r in rows)
        self.data.extend(b"\0" * (-len(self.data) % 4))
        view = self.put("bufferViews", {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data.extend(data)
        more = {}
        if kind == "VEC3" and code == "f":
            more = {"min": [min(c) for c in zip(*rows)], "max": [max(c) for c in zip(*rows)]}
        return self.put("accessors", {"bufferView": view, "componentType": component, "count": len(rows), "type": kind, **more})

    def geometry(self, name, colored):
        attributes, faces = MESHES[name]
        for key, rows in attributes.items():
            if (name, key) not in self.known:
                self.known[name, key] = self.accessor(rows, f"VEC{len(rows[0])}")
        if (name, "indices") not in self.known:
            self.known[name, "indices"] = self.accessor([(i,) for f in faces for i in f], "SCALAR", "H", 5123)
        wanted = {key: self.known[name, key] for key in attributes if key != "COLOR_0" or colored}
        return {"attributes": wanted, "indices": self.known[name, "indices"]}

    def node(self, value):
        self.root["scenes"][0]["nodes"].append(self.put("nodes", value))

    def thing(self, name, mesh, look, **more):
        index = self.put("materials", {"name": name, **look})
        primitive = self.geometry(mesh, name == "colours of vertices") | {"material": index}
        return {"name": name, "mesh": self.put("meshes", {"name": name, "primitives": [primitive]}), **more}

    def write(self, path):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.root["buffers"] = [{"uri": uri, "byteLength": len(self.data)}]
        used = sorted(set(names(self.root)))
        self.root["extensionsUsed"] = used
        path.write_text(json.dumps(self.root, indent=1) + "\n", encoding="ascii")


def names(value):
    """Extensions that are used somewhere."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from (list(inner) if key == "extensions" else [])
            yield from names(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from names(inner)


def write_gltf(name, things, whole):
    file = Gltf()
    at, tilt, fov = CAMERA
    camera = file.put("cameras", {"type": "perspective", "perspective": {"yfov": fov, "znear": 0.01, "aspectRatio": 1}})
    file.node({"camera": camera, "translation": list(at), "rotation": quaternion((1, 0, 0, tilt))})
    for label, mesh, (where, size, turn), look, _ in things:
        file.node(file.thing(label, mesh, look, translation=list(where), rotation=quaternion(turn), scale=list(size)))
    if whole:
        instances = {"TRANSLATION": file.accessor([b[0] for b in BARS], "VEC3"),
                     "ROTATION": file.accessor([quaternion((0, 1, 0, b[2])) for b in BARS], "VEC4"),
                     "SCALE": file.accessor([b[1] for b in BARS], "VEC3")}
        file.node(file.thing("bars", "cube", BAR, extensions={"EXT_mesh_gpu_instancing": {"attributes": instances}}))
        file.root["extensions"] = {"KHR_lights_punctual": {"lights": [light for light, _ in PUNCTUAL]}}
        for index, (_, where) in enumerate(PUNCTUAL):
            placed = {"translation": list(where)} if where else {"rotation": between(SUN)}
            file.node({"extensions": {"KHR_lights_punctual": {"light": index}}, **placed})
    file.write(HERE / f"{name}.gltf")


def transform(where, size, turn):
    x, y, z, degrees = turn
    return f"""<transform name="to_world">
            <scale value="{row(size)}" />
            <rotate value="{row((x, y, z))}" angle="{number(degrees)}" />
            <translate value="{row(where)}" />
        </transform>"""


def shape(label, mesh, where, inner):
    return f"""    <!-- {label} -->
    <shape type="ply">
        <string name="filename" value="data/gltf-{mesh}.ply" />
        {transform(*where)}
        {inner}
    </shape>
"""


def write_xml(name, things, whole):
    at, tilt, fov = CAMERA
    text = f"""<?xml version="1.0" encoding="utf-8"?>
<!-- {name}.gltf in Mitsuba's words. Written by make_gltf.py. -->
<scene version="3.0.0">
    <integrator type="volpath">
        <integer name="max_depth" value="-1" />
    </integrator>
    <sensor type="perspective">
        <float name="fov" value="{number(math.degrees(fov))}" />
        <string name="fov_axis" value="y" />
        <transform name="to_world">
            <rotate value="0, 1, 0" angle="180" />
            <rotate value="1, 0, 0" angle="{number(tilt)}" />
            <translate value="{row(at)}" />
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="64" />
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="64" />
            <integer name="height" value="64" />
            <string name="pixel_format" value="rgb" />
            <string name="component_format" value="float32" />
            <rfilter type="gaussian" />
        </film>
    </sensor>
"""
    text += "".join(shape(label, mesh, where, inner) for label, mesh, where, _, inner in things)
    if whole:
        text += "".join(shape("a bar", "cube", (where, size, (0, 1, 0, turn)), diffuse((0.25, 0.35, 0.6))) for where, size, turn in BARS)
        (point, where), (sun, _) = PUNCTUAL
        text += f"""    <emitter type="point">
        <point name="position" value="{row(where)}" />
        {rgb("intensity", [point["intensity"] * c for c in point["color"]])}
    </emitter>
    <emitter type="directional">
        <vector name="direction" value="{row(SUN)}" />
        {rgb("irradiance", [sun["intensity"] * c for c in sun["color"]])}
    </emitter>
"""
    (HERE / f"{name}.xml").write_text(text + "</scene>\n", encoding="ascii")


if __name__ == "__main__":
    write_images()
    for mesh in MESHES:
        write_ply(mesh)
    for scene, things, whole in (("gltf-surfaces", SURFACES, True), ("gltf-clear", CLEAR, False)):
        write_gltf(scene, things, whole)
        write_xml(scene, things, whole)
