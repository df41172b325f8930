#!/usr/bin/env python3
"""The test of the self-test: known bugs, put back in, must make named rows fail.

    python tools/check_mutations.py [FOLDER]

Copies the sources to FOLDER (a temporary one by default), puts one bug in at a
time, builds, and runs the rows that are to find it. Fails when a row that should
fail passes, or when the code that a bug replaces is no longer there.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

# (name, file, what is there, what takes its place, rows that must all fail)
MUTATIONS = [
    (
        "a fixed epsilon in place of the error box",
        "src/math/error.rs",
        "    let distance = ng.abs().dot(p_error);\n",
        "    let distance = 1e-4;\n",
        ["B3", "C1", "C2", "D4"],
    ),
    (
        "multiple importance sampling with squared densities",
        "src/sampling/mis.rs",
        "    let ratio = ratio(pdf_a, pdf_b);\n    1.0 / (1.0 + ratio * ratio)\n",
        "    pdf_a * pdf_a / (pdf_a * pdf_a + pdf_b * pdf_b)\n",
        ["A2"],
    ),
    (
        "film sums in plain floats",
        "src/film/tile.rs",
        "    for (sum, value) in group.iter_mut().zip(values) {\n        *sum += weight * value;\n",
        "    for (sum, value) in group.iter_mut().zip(values) {\n"
        "        *sum = f64::from(*sum as f32 + (weight * value) as f32);\n",
        ["F1"],
    ),
]


def failing(folder, rows):
    """The rows of `rows` that fail; the build is that of the folder's sources."""
    command = ["cargo", "run", "--locked", "--quiet", "--", "selftest", "--json", *rows]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if not run.stdout:
        sys.exit(f"it does not build or run:\n{run.stderr[-2000:]}")
    cases = json.loads(run.stdout)["rows"]
    return {case["id"] for case in cases if not case["pass"]}


def main():
    keep = len(sys.argv) > 1
    folder = pathlib.Path(sys.argv[1] if keep else tempfile.mkdtemp(prefix="etendue-mutations-"))
    ok = True
    try:
        for name in ["Cargo.toml", "Cargo.lock", "build.rs"]:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
        shutil.copytree(ROOT / "src", folder / "src", dirs_exist_ok=True)
        everything = sorted({row for mutation in MUTATIONS for row in mutation[4]})
        healthy = failing(folder, everything)
        print(f"without a bug: {', '.join(everything)} {'FAIL ' + str(healthy) if healthy else 'pass'}", flush=True)
        ok &= not healthy
        for name, file, there, instead, rows in MUTATIONS:
            path, text = folder / file, (ROOT / file).read_text()
            if text.count(there) != 1:
                sys.exit(f"{file}: the code that `{name}` replaces is not there")
            path.write_text(text.replace(there, instead))
            found = failing(folder, rows)
            path.write_text(text)
            missed = sorted(set(rows) - found)
            print(f"{name}: found by {', '.join(sorted(found)) or 'nothing'}", end="")
            print(f"; NOT by {', '.join(missed)}" if missed else "", flush=True)
            ok &= not missed
    finally:
        if not keep:
            shutil.rmtree(folder, ignore_errors=True)
    sys.exit(0 if ok else 1)


if __name__ == "__main__":
    main()
