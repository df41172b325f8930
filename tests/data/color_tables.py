"""Prints the tables of `src/color/conductors.rs` and `src/color/cie_tables.rs`.

Needs Mitsuba 3.9.1 (`pip install mitsuba==3.9.1`). The numbers of conductors
are what Mitsuba itself uses in its rgb variants: spectra of eta and k
integrated against the CIE 1931 curves and converted to linear sRGB.

    python tests/data/color_tables.py conductors > src/color/conductors.rs
    python tests/data/color_tables.py cie        > src/color/cie_tables.rs
"""

import glob
import os
import sys

import numpy as np
import mitsuba as mi

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)


def short(x):
    return np.format_float_positional(np.float32(x), unique=True, trim="0") if abs(x) >= 1e-4 or x == 0 \
        else np.format_float_scientific(np.float32(x), unique=True, trim="0", exp_digits=1)


def conductors():
    folder = os.path.join(os.path.dirname(mi.__file__), "data", "ior")
    names = sorted(os.path.basename(f)[: -len(".eta.spd")] for f in glob.glob(folder + "/*.eta.spd"))
    print("//! Complex indices of refraction of named conductors, in linear sRGB.")
    print("//!")
    print(f"//! Printed by `tests/data/color_tables.py conductors` from Mitsuba {mi.__version__},")
    print("//! whose spectra come from the Luxpop database (Palik's handbook, CXRO and")
    print("//! LLNL measurements). Negative components are clamped to zero, as there.")
    print()
    print("/// A row: name, η (R, G, B), k (R, G, B).")
    print("type Row = (&'static str, [f32; 3], [f32; 3]);")
    print()
    print("/// Sorted by name in ASCII order.")
    print("#[rustfmt::skip]")
    print(f"pub(super) const CONDUCTORS: [Row; {len(names)}] = [")
    for name in names:
        params = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
        eta, k = (", ".join(short(x) for x in params[p]) for p in ("eta.value", "k.value"))
        print(f'    ("{name}", [{eta}], [{k}]),')
    print("];")


def cie():
    grid = [360.0 + 5.0 * i for i in range(95)]
    print("//! The CIE 1931 2° observer and the D65 illuminant, every 5 nm from 360 to")
    print("//! 830 nm (CIE 15:2004 tables; D65 relative to 100 at 560 nm).")
    print("//!")
    print("//! Printed by `tests/data/color_tables.py cie`.")
    print()
    print("/// A row: x̄, ȳ, z̄, D65.")
    print("#[rustfmt::skip]")
    print("pub(super) const CIE: [[f32; 4]; 95] = [")
    for wavelength in grid:
        x, y, z = mi.cie1931_xyz(wavelength)
        d65 = np.float32(mi.cie_d65(wavelength) / mi.MI_CIE_D65_NORMALIZATION)
        print("    [" + ", ".join(short(v) for v in (x, y, z, round(float(d65), 4))) + "],")
    print("];")


if __name__ == "__main__":
    {"conductors": conductors, "cie": cie}[sys.argv[1]]()
