"""Makes small files of measured materials from a metal that is known in closed form.

    python tools/measured_file.py            # the files of scenes/features/data
    python tools/measured_file.py --kind spectral --out DIR

The two `tiny` ones are the seeds of tests/fuzz.

The container is that of the RGL material database, the contents what Dupuy and
Jakob would have measured on a rough conductor (2018, "An Adaptive
Parameterization for Efficient Material Acquisition and Rendering", ACM TOG
37(6)): GGX normals, separable Smith shadowing, Fresnel's equations. Whatever
the resolution does not hold is lost, as it would be of a real material.

In the paper's notation a point u of the unit square is a direction,
theta = pi/2 u1^2 and phi = pi (2 u2 - 1). With D the density of normals and
sigma(wi) their projected area,

    ndf    D(m)                                     at u(m)
    sigma  sigma(wi)                                at u(wi)
    vndf   D(m) max(0, wi.m) / sigma(wi) |dm/du|    at u(m), for each wi
    rgb    f(wi, wo) cos(theta_o) 4 sigma(wi) / D(m)   at u', for each wi

where u' is what the density `vndf` carries to u(m). `luminance` is that of
`rgb`. Needs numpy alone.
"""

import argparse
import pathlib
import struct

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
# Number of the element type in the container.
DTYPES = {np.dtype(np.uint8): 1, np.dtype(np.float32): 10}
# Refractive indices of gold and copper as linear sRGB, and as spectra at a few wavelengths in nm.
GOLD = ([0.143, 0.375, 1.44], [3.98, 2.39, 1.60])
COPPER = ([0.200, 0.924, 1.102], [3.912, 2.452, 2.142])
GOLD_SPECTRUM = (
    [360.0, 430.0, 500.0, 540.0, 580.0, 640.0, 720.0, 830.0],
    [1.71, 1.50, 0.94, 0.45, 0.31, 0.19, 0.15, 0.18],
    [1.86, 1.88, 1.83, 2.27, 2.88, 3.46, 4.12, 5.00],
)


def write(path, fields):
    """One file: a header, the table of fields, and their data, 8-aligned."""
    table = 18 + sum(2 + len(name) + 11 + 8 * data.ndim for name, data in fields.items())
    offset, header, body = table, struct.pack("<12s2BI", b"tensor_file", 1, 0, len(fields)), b""
    for name, data in fields.items():
        gap = -offset % 8
        body, offset = body + bytes(gap), offset + gap
        header += struct.pack("<H", len(name)) + name.encode()
        header += struct.pack("<HBQ", data.ndim, DTYPES[data.dtype], offset)
        header += struct.pack(f"<{data.ndim}Q", *data.shape)
        raw = np.ascontiguousarray(data).tobytes()
        body, offset = body + raw, offset + len(raw)
    assert len(header) == table
    path.write_bytes(header + body)


def knots(n):
    return np.linspace(0.0, 1.0, n)


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def angles(u1, u2):
    return 0.5 * np.pi * u1**2, np.pi * (2.0 * u2 - 1.0)


class Density:
    """A bilinear function on the unit square as a density: rows by their mass, places in them."""

    def __init__(self, values):
        self.values = values
        self.rows = self.running(values)  # integral along each row
        self.below = self.running(self.rows[:, -1])  # and over the rows
        self.values, self.rows, self.below = (a / self.below[-1] for a in (values, self.rows, self.below))

    @staticmethod
    def running(values):
        """Integral from 0 to each knot of what is linear in between."""
        middle = 0.5 * (values[..., 1:] + values[..., :-1]) / (values.shape[-1] - 1)
        start = np.zeros(values.shape[:-1] + (1,))
        return np.concatenate([start, np.cumsum(middle, -1)], -1)

    @staticmethod
    def place(running, knots_of, goal):
        """Where the integral of a linear interpolant reaches the goal."""
        cells = len(knots_of) - 1
        i = np.clip(np.searchsorted(running, goal, side="right") - 1, 0, cells - 1)
        a, b = knots_of[i], knots_of[i + 1]
        share = (goal - running[i]) * cells
        root = np.sqrt(np.maximum(a * a + 2.0 * share * (b - a), 0.0))
        t = np.where(a + root > 0.0, 2.0 * share / np.maximum(a + root, 1e-300), 0.0)
        return (i + np.clip(t, 0.0, 1.0)) / cells

    def warp(self, u1, u2):
        """The point of the square that (u1, u2) is carried to."""
        y = self.place(self.below, self.rows[:, -1], u2)
        j = min(int(y * (len(self.below) - 1)), len(self.below) - 2)
        t = y * (len(self.below) - 1) - j
        row = (1 - t) * self.values[j] + t * self.values[j + 1]
        running = (1 - t) * self.rows[j] + t * self.rows[j + 1]
        return self.place(running, row, u1 * running[-1]), y


class Metal:
    """A rough conductor with GGX normals."""

    def __init__(self, alpha, eta, k):
        self.alpha, self.eta, self.k = alpha, np.array(eta), np.array(k)

    def d(self, m):
        a, b = self.alpha
        t = (m[..., 0] / a) ** 2 + (m[..., 1] / b) ** 2 + m[..., 2] ** 2
        return 1.0 / (np.pi * a * b * t * t)

    def slope(self, w):
        """alpha sin(theta) in the plane of w."""
        return np.hypot(self.alpha[0] * w[..., 0], self.alpha[1] * w[..., 1])

    def sigma(self, w):
        """Projected area of the normals, cos(theta) / G1."""
        return 0.5 * (w[..., 2] + np.hypot(w[..., 2], self.slope(w)))

    def g1(self, w):
        return np.maximum(w[..., 2], 0.0) / np.maximum(self.sigma(w), 1e-300)

    def fresnel(self, cos):
        cos2 = cos[..., None] ** 2
        sin2 = 1.0 - cos2
        n2, k2 = self.eta**2, self.k**2
        t0 = n2 - k2 - sin2
        ab = np.sqrt(t0 * t0 + 4 * n2 * k2)
        a = np.sqrt(np.maximum(0.5 * (ab + t0), 0.0))
        t1, t2 = ab + cos2, 2 * a * cos[..., None]
        s = (t1 - t2) / (t1 + t2)
        t3, t4 = cos2 * ab + sin2 * sin2, t2 * sin2
        return 0.5 * (s + s * (t3 - t4) / (t3 + t4))


def channels(metal, wi, density, phi, size):
    """f cos(theta_o) 4 sigma / D at the knots of the square that is carried by the density."""
    out = np.zeros((len(metal.eta), size, size), np.float32)
    for j, u2 in enumerate(knots(size)):
        for i, u1 in enumerate(knots(size)):
            theta, turn = angles(*density.warp(u1, u2))
            m = direction(theta, turn + phi)
            cos = np.dot(wi, m)
            wo = 2.0 * cos * m - wi
            if cos > 0.0:
                # f cos(theta_o) = F D G1(wi) G1(wo) / (4 cos(theta_i)), and sigma = cos(theta_i) / G1(wi).
                out[:, j, i] = metal.fresnel(np.array(cos)) * metal.g1(wo)
    return out


def material(metal, thetas, phis, isotropic, sizes, description, wavelengths=None):
    """The fields of a file. `sizes`: of ndf and sigma (rows, columns), of vndf, of the channels."""
    shape, visible, square = sizes
    theta, phi = angles(*np.meshgrid(knots(shape[1]), knots(shape[0])))
    w = direction(theta, phi)
    fields = {
        "theta_i": np.array(thetas, np.float32),
        "phi_i": np.array(phis, np.float32),
        "ndf": metal.d(w).astype(np.float32),
        "sigma": metal.sigma(w).astype(np.float32),
    }
    vndf, rgb = [], []
    u1, u2 = np.meshgrid(knots(visible[1]), knots(visible[0]))
    theta, phi = angles(u1, u2)
    for phi_i in fields["phi_i"].astype(float):
        for theta_i in fields["theta_i"].astype(float):
            wi = direction(theta_i, phi_i)
            # An isotropic file is relative to the azimuth of wi.
            m = direction(theta, phi + (phi_i if isotropic else 0.0))
            seen = metal.d(m) * np.maximum(m @ wi, 0.0) / metal.sigma(wi)
            seen = (seen * 2.0 * np.pi**2 * u1 * np.sin(theta)).astype(np.float32)
            vndf.append(seen)
            density = Density(seen.astype(float))
            rgb.append(channels(metal, wi, density, phi_i if isotropic else 0.0, square))
    grid = (len(phis), len(thetas))
    fields["vndf"] = np.array(vndf).reshape(*grid, *visible)
    values = np.array(rgb).reshape(*grid, len(metal.eta), square, square)
    if wavelengths is None:
        weights = np.array([0.212671, 0.715160, 0.072169])
        fields["rgb"] = values
    else:
        weights = np.full(len(wavelengths), 1.0 / len(wavelengths))
        fields["wavelengths"] = np.array(wavelengths, np.float32)
        fields["spectra"] = values
    fields["luminance"] = np.einsum("abcyx,c->abyx", values, weights).astype(np.float32)
    fields["jacobian"] = np.array([1], np.uint8)
    fields["description"] = np.frombuffer(description.encode(), np.uint8)
    return fields


def made(kind):
    """The fields of one of the files of scenes/features/data."""
    slants = (0.5 * np.pi * knots(8) ** 1.3).tolist()
    if kind == "isotropic":
        metal = Metal((0.3, 0.3), *GOLD)
        return material(metal, slants, [0.0], True, ((2, 64), (24, 48), 16), "GGX 0.3, gold")
    if kind == "anisotropic":
        # A quarter of all turns: the rest mirrors it.
        metal = Metal((0.2, 0.5), *COPPER)
        turns = np.linspace(-np.pi, -0.5 * np.pi, 5).tolist()
        return material(metal, slants[::2] + slants[-1:], turns, False, ((33, 32), (33, 32), 12),
                        "GGX 0.2 and 0.5, copper")
    if kind == "tiny":
        metal = Metal((0.5, 0.5), *GOLD)
        return material(metal, [0.3, 1.2], [0.0], True, ((2, 3), (2, 4), 2), "")
    wavelengths, eta, k = GOLD_SPECTRUM
    if kind == "tiny-spectral":
        metal = Metal((0.3, 0.6), eta[::3], k[::3])
        return material(metal, [0.3], [-3.1, -2.6, -1.6], False, ((2, 3), (2, 3), 2), "", wavelengths[::3])
    metal = Metal((0.3, 0.3), eta, k)
    return material(metal, slants, [0.0], True, ((2, 64), (24, 48), 16), "GGX 0.3, gold", wavelengths)


def main():
    kinds = ["isotropic", "anisotropic", "spectral", "tiny", "tiny-spectral"]
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--kind", choices=kinds, action="append", help="default: isotropic and anisotropic")
    parser.add_argument("--out", type=pathlib.Path, default=HERE.parent / "scenes/features/data")
    options = parser.parse_args()
    for kind in options.kind or kinds[:2]:
        path = options.out / f"{kind}.bsdf"
        write(path, made(kind))
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
