#!/usr/bin/env python3
"""Mitsuba in the scenes of `etendue selftest`.

    etendue selftest --export FOLDER
    python tools/selftest_mitsuba.py FOLDER src/selftest/peers.json

Renders each scene with sixteen seeds and writes Mitsuba's error beside what is
expected into the list of figures, in place of what was measured before; figures
of other renderers stay. Needs Mitsuba 3 (pip install mitsuba).
"""

import json
import math
import pathlib
import sys

import mitsuba as mi
import numpy as np

SEEDS = 16


def measure(path, samples):
    """Mean of each render, over all pixels and channels."""
    scene = mi.load_file(str(path))
    means = []
    for seed in range(SEEDS):
        # Sobol and others ask for powers of two; so few samples cannot drift.
        image = np.array(mi.render(scene, spp=max(samples, 1), seed=seed), dtype=np.float64)
        means.append(float(image[..., :3].mean()))
    return np.array(means)


def figure(folder, case):
    entry = {"id": case["id"], "case": case["case"], "renderer": "mitsuba"}
    try:
        means = measure(folder / case["file"], case["samples"])
    except Exception as problem:  # what it refuses is a figure too
        text = str(problem).strip().splitlines()
        return entry | {"error": None, "remark": "refused", "why": text[-1][:120] if text else ""}
    expected = case["expected"]
    unit = expected if expected else 1.0
    if not np.isfinite(means).all():
        return entry | {"error": None, "remark": "not finite"}
    error = (means.mean() - expected) / unit
    noise = means.std(ddof=1) / math.sqrt(SEEDS) / abs(unit)
    return entry | {"error": float(f"{error:.3e}"), "noise": float(f"{noise:.1e}")}


def main():
    folder, target = map(pathlib.Path, sys.argv[1:3])
    mi.set_variant("scalar_rgb")
    cases = [case for path in sorted(folder.glob("[A-F]*.json")) for case in json.loads(path.read_text())]
    figures = []
    for case in cases:
        entry = figure(folder, case)
        why = entry.pop("why", "")
        figures.append(entry)
        print(f"{case['id']:<4} {case['case']:<44} {entry.get('error')} {entry.get('remark', '')} {why}", flush=True)
    measured = {(f["id"], f["case"]) for f in figures}
    kept = [
        f
        for f in json.loads(target.read_text())
        if f["renderer"] != "mitsuba" or (f["id"], f["case"]) not in measured
    ]
    lines = ",\n".join("  " + json.dumps(f) for f in figures + kept)
    target.write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    main()
