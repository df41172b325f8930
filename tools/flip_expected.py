#!/usr/bin/env python3
"""Prints what the authors' FLIP gives for the pictures of tests/metrics.rs.

Needs numpy and flip-evaluator (PyPI). The numbers stand in that test.
"""
import flip_evaluator
import numpy as np


def scene(width, height):
    y, x = np.mgrid[0:height, 0:width]
    u, v = (x + 0.5) / width, (y + 0.5) / height
    checker = np.where((x // 8 + y // 8) % 2 == 0, 0.25, 0.6)
    lamp = np.where(np.hypot(u - 0.7, v - 0.3) < 0.1, 12.0, 0.0)
    base = np.dstack([checker * (0.3 + 0.7 * u) + lamp, checker * (1 - 0.5 * v) + lamp, 0.2 + 0.4 * u * v + lamp])
    ripple = 1 + 0.15 * np.sin(40 * u) * np.cos(31 * v)
    dot = np.where((x * 7 + y * 13) % 97 == 0, 1.5, 0.0)
    test = base * ripple[..., None] + dot[..., None] * np.array([1, 2, 3]) / 3
    return base.astype(np.float32), test.astype(np.float32)


for width, height in [(96, 64), (40, 75)]:
    reference, test = scene(width, height)
    clamp = lambda p: np.clip(p, 0, 1)
    _, ldr, _ = flip_evaluator.evaluate(clamp(reference), clamp(test), "LDR", inputsRGB=False)
    _, hdr, used = flip_evaluator.evaluate(reference, test, "HDR")
    print(f"({width}, {height}, {ldr:.6f}, {hdr:.6f}, {used['startExposure']:.6f}, {used['stopExposure']:.6f}), "
          f"{used['numExposures']} exposures, {used['ppd']} pixels per degree")
