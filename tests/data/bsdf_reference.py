"""Prints the reference values of `tests/contracts_bsdf.rs`.

Needs Mitsuba 3.9.1 (`pip install mitsuba==3.9.1`). Prints Rust constants:

    python tests/data/bsdf_reference.py > tests/data/bsdf_reference.rs

Every row is one `bsdf.eval` or `bsdf.pdf` in `scalar_rgb`: bsdf number, theta and phi in
degrees of our wo (Mitsuba's `si.wi`), theta and phi of our wi (Mitsuba's
`wo`), and the value (f·|cos θi|). Delta rows are `bsdf.sample` with the lobe
sample at 0 and just below 1: the direction and weight·pdf, which does not
depend on how lobes are chosen.
"""

import math
import pathlib

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)

GREY = {"type": "rgb", "value": [0.9, 0.5, 0.1]}

SMOOTH = [
    ("Diffuse", {"type": "diffuse", "reflectance": GREY}),
    ("ConductorBeckmann", {"type": "roughconductor", "material": "Au", "alpha": 0.1}),
    ("ConductorBeckmannRough", {"type": "roughconductor", "material": "Cu", "alpha": 0.6}),
    ("ConductorGgx", {"type": "roughconductor", "material": "Al", "distribution": "ggx",
                      "alpha_u": 0.1, "alpha_v": 0.4, "specular_reflectance": GREY}),
    ("ConductorBeckmannAnisotropic", {"type": "roughconductor", "alpha_u": 0.5, "alpha_v": 0.15}),
    ("DielectricBeckmann", {"type": "roughdielectric", "alpha": 0.3, "int_ior": 1.5, "ext_ior": 1.0}),
    ("DielectricGgx", {"type": "roughdielectric", "distribution": "ggx", "alpha_u": 0.2, "alpha_v": 0.5,
                       "int_ior": 1.33, "ext_ior": 1.0, "specular_transmittance": GREY}),
    ("Plastic", {"type": "plastic", "diffuse_reflectance": GREY}),
    ("PlasticNonlinear", {"type": "plastic", "diffuse_reflectance": GREY, "nonlinear": True,
                          "int_ior": 1.9, "ext_ior": 1.0}),
    ("RoughPlasticBeckmann", {"type": "roughplastic", "diffuse_reflectance": GREY, "alpha": 0.1}),
    ("RoughPlasticGgx", {"type": "roughplastic", "diffuse_reflectance": GREY, "alpha": 0.4,
                         "distribution": "ggx", "int_ior": 1.7, "ext_ior": 1.0, "nonlinear": True}),
    ("RoughPlasticSharp", {"type": "roughplastic", "diffuse_reflectance": GREY, "alpha": 0.02,
                           "specular_reflectance": {"type": "rgb", "value": 0.0},
                           "int_ior": 1.5, "ext_ior": 1.0}),
    ("RoughPlasticRough", {"type": "roughplastic", "diffuse_reflectance": GREY, "alpha": 0.9,
                           "specular_reflectance": {"type": "rgb", "value": 0.0},
                           "int_ior": 1.5, "ext_ior": 1.0}),
]

ALL = {"base_color": {"type": "rgb", "value": [0.8, 0.4, 0.2]}, "roughness": 0.45, "anisotropic": 0.5,
       "spec_trans": 0.4, "spec_tint": 0.3, "sheen": 0.6, "sheen_tint": 0.5, "flatness": 0.5}

PRINCIPLED = [
    ("PrincipledDefault", {"type": "principled"}),
    ("PrincipledMetal", {"type": "principled", "base_color": GREY, "metallic": 1.0, "roughness": 0.3,
                         "anisotropic": 0.8}),
    ("PrincipledCloth", {"type": "principled", "base_color": GREY, "roughness": 0.9, "sheen": 1.0,
                         "sheen_tint": 0.7, "flatness": 0.6}),
    ("PrincipledCoat", {"type": "principled", "base_color": GREY, "specular": 0.7, "spec_tint": 0.8,
                        "clearcoat": 1.0, "clearcoat_gloss": 0.4}),
    ("PrincipledGlass", {"type": "principled", "base_color": GREY, "spec_trans": 1.0, "eta": 1.4,
                         "roughness": 0.5}),
    ("PrincipledBubble", {"type": "principled", "spec_trans": 0.8, "eta": 0.8, "metallic": 0.3,
                          "clearcoat": 0.5}),
    ("PrincipledAll", {"type": "principled", "metallic": 0.3, "clearcoat": 0.5, "clearcoat_gloss": 0.5,
                       **ALL}),
    ("ThinDefault", {"type": "principledthin"}),
    ("ThinPane", {"type": "principledthin", "base_color": GREY, "spec_trans": 1.0, "eta": 1.6,
                  "roughness": 0.3, "spec_tint": 0.5}),
    ("ThinAll", {"type": "principledthin", "diff_trans": 0.7, **ALL}),
]

DATA = pathlib.Path(__file__).resolve().parents[2] / "scenes/features/data"
MEASURED = [
    ("MeasuredIsotropic", {"type": "measured", "filename": str(DATA / "isotropic.bsdf")}),
    ("MeasuredAnisotropic", {"type": "measured", "filename": str(DATA / "anisotropic.bsdf")}),
]

DELTA = [
    ("Dielectric", {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0,
                    "specular_reflectance": {"type": "rgb", "value": 0.8}}),
    ("ThinDielectric", {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}),
    ("Gold", {"type": "conductor", "material": "Au"}),
    ("Mirror", {"type": "conductor"}),
    ("PlasticMirror", {"type": "plastic", "specular_reflectance": GREY}),
    ("Null", {"type": "null"}),
]

PAIRS = [
    ((0, 0), (20, 0)), ((30, 0), (30, 180)), ((30, 40), (35, 200)), ((60, 90), (10, 10)),
    ((75, 20), (80, 210)), ((88, 0), (85, 170)), ((45, 10), (150, 200)), ((20, 0), (165, 190)),
    ((140, 30), (50, 215)), ((130, 30), (120, 215)), ((160, 0), (20, 170)),
]

# More of them, evenly spread, for surfaces with many lobes.
MANY = PAIRS + [
    ((round(i * 61.8 % 177 + 1.5, 1), round(i * 137.5 % 360, 1)),
     (round(i * 38.2 % 177 + 1.5, 1), round(i * 222.5 % 360, 1)))
    for i in range(1, 41)
]

# All above the surface, and none at an azimuth of exactly 0, where Mitsuba
# 3.9.1 takes the far end of anisotropic tables: 1e-5 degrees away it does not.
ABOVE = [
    ((round(i * 61.8 % 88 + 0.7, 1), round(i * 137.5 % 360, 1)),
     (round(i * 38.2 % 88 + 0.7, 1), round(i * 222.5 % 360, 1)))
    for i in range(1, 51)
]


def direction(theta, phi):
    t, p = math.radians(theta), math.radians(phi)
    return mi.Vector3f(math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t))


def interaction(wo):
    si = mi.SurfaceInteraction3f()
    si.wi = wo
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.n = mi.Normal3f(0, 0, 1)
    si.uv = mi.Point2f(0.5, 0.5)
    si.t = 1.0
    return si


def number(v):
    """The shortest decimal that is this f32, as Rust likes it."""
    v = np.float32(v)
    if v == 0 or 1e-3 <= abs(v) < 1e4:
        return np.format_float_positional(v, unique=True, trim="0")
    return np.format_float_scientific(v, unique=True, trim="0", exp_digits=1)


def numbers(values):
    return "[" + ", ".join(number(v) for v in values) + "]"


def main():
    print(f"//! Printed by `tests/data/bsdf_reference.py` from Mitsuba {mi.__version__}.")
    print("//! See there for how; what the numbers are is said below.")
    print()
    print("/// Name, wo theta, wo phi, wi theta, wi phi, f times cos.")
    print("pub type Eval = (&'static str, f32, f32, f32, f32, [f32; 3]);")
    print("/// Name, wo theta, lobe sample, direction, weight times pdf, eta.")
    print("pub type Delta = (&'static str, f32, f32, [f32; 3], [f32; 3], f32);")
    print()
    print("#[rustfmt::skip]")
    print("pub const EVAL: &[Eval] = &[")
    ctx = mi.BSDFContext()
    for name, description in SMOOTH + PRINCIPLED + MEASURED:
        bsdf = mi.load_dict(description)
        pairs = PAIRS if (name, description) in SMOOTH else MANY
        for wo, wi in ABOVE if (name, description) in MEASURED else pairs:
            value = bsdf.eval(ctx, interaction(direction(*wo)), direction(*wi))
            if max(value) > 0:
                print(f'    ("{name}", {float(wo[0])}, {float(wo[1])}, {float(wi[0])}, {float(wi[1])}, {numbers(value)}),')
    print("];")
    print()
    print("#[rustfmt::skip]")
    print("/// Name, wo theta, wo phi, wi theta, wi phi, density of wi.")
    print("pub const DENSITY: &[(&str, f32, f32, f32, f32, f32)] = &[")
    for name, description in MEASURED:
        bsdf = mi.load_dict(description)
        for wo, wi in ABOVE:
            value = bsdf.pdf(ctx, interaction(direction(*wo)), direction(*wi))
            if value > 0:
                print(f'    ("{name}", {float(wo[0])}, {float(wo[1])}, {float(wi[0])}, {float(wi[1])}, {number(value)}),')
    print("];")
    print()
    print("#[rustfmt::skip]")
    print("pub const DELTA: &[Delta] = &[")
    for name, description in DELTA:
        bsdf = mi.load_dict(description)
        for theta in (10, 60, 85, 120, 145):
            for lobe in (0.0, 0.99999):
                sample, weight = bsdf.sample(ctx, interaction(direction(theta, 0)), lobe, mi.Point2f(0.3, 0.6))
                delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
                if not (delta or mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)) or max(weight) == 0:
                    continue
                print(f'    ("{name}", {theta}.0, {lobe}, {numbers(sample.wo)}, '
                      f"{numbers(weight * sample.pdf)}, {number(sample.eta)}),")
    print("];")


if __name__ == "__main__":
    main()
