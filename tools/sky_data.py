#!/usr/bin/env python3
"""Writes src/light/sky_data.bin: the published data of the sky and sun models of Hosek and Wilkie.

They come from the file that Mitsuba 3 ships (data/sunsky/sunsky_datasets.bin of its Python package),
unchanged but for the order and 32-bit floats. All little-endian, one after the other:

  sky radiance    [turbidity 10][albedo 2][control point 6][rgb 3]
  sky parameters  [turbidity 10][albedo 2][control point 6][rgb 3][9]
  solar radiance  [turbidity 10][segment 45][wavelength 11][power of elevation 4]
  limb darkening  [wavelength 11][power of cosine 6]
"""
import pathlib
import re
import subprocess
import sys

import numpy as np

FIELDS = ["sky_rad_rgb", "sky_params_rgb", "sun_rad_spec", "sun_ld_spec"]
SHAPES = [(10, 2, 6, 3), (10, 2, 6, 3, 9), (10, 45, 11, 4), (11, 6)]


def main():
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    path = pathlib.Path(mi.__file__).parent / "data/sunsky/sunsky_datasets.bin"
    listing = str(mi.TensorFile(str(path)))
    out = []
    for name, shape in zip(FIELDS, SHAPES):
        offset = re.search(rf'"{name}" => \[\s*dtype = float64,\s*offset = (\d+)', listing)
        data = np.fromfile(path, dtype="<f8", offset=int(offset.group(1)), count=int(np.prod(shape)))
        out.append(data.astype("<f4").tobytes())
    root = pathlib.Path(subprocess.check_output(["git", "rev-parse", "--show-toplevel"], text=True).strip())
    target = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else root / "src/light/sky_data.bin"
    target.write_bytes(b"".join(out))


if __name__ == "__main__":
    main()
