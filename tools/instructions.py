#!/usr/bin/env python3
"""Where a render's instructions go, as Markdown: by room and by function.

    python tools/instructions.py [SCENE ...] [--binary target/release/etendue] [--size 128x128] [--spp 16]

Runs one thread under `valgrind --tool=callgrind`, which counts instructions:
the same on a busy machine. The optimiser inlines across rooms; an instruction
counts for the room of the source line it came from, and for the room of the
function it stands in when that line is the standard library's or a crate's.
Functions are those that are left as such. Loading, building and saving drop
out: it is the difference of two renders, of 8 and 8 + SPP samples per pixel.
"""
import argparse
import collections
import re
import subprocess
import tempfile
from pathlib import Path

FIRST = 8  # samples per pixel of the render that is subtracted
ROOT = Path(__file__).resolve().parent.parent


def callgrind(binary, scene, size, spp):
    """Instructions by (source file, function)."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "callgrind"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={data}", binary, "render", scene]
        command += ["-o", f"{folder}/out.exr", "--size", size, "--spp", str(spp), "--threads", "1", "--quiet"]
        command += ["--reuse", "1"]  # no trial, and the same with all counts
        subprocess.run([str(part) for part in command], check=True, capture_output=True)
        command = ["callgrind_annotate", "--threshold=100", "--auto=no", data]
        text = subprocess.run([str(part) for part in command], check=True, text=True, capture_output=True).stdout
    counts = collections.Counter()
    for line in text.splitlines():
        match = re.match(r"\s*([\d,]+)\s*\(\s*[\d.]+%\)\s+(\S+?):(.+?)(?: \[\S+\])?$", line)
        if match:
            counts[match.group(2), plain(match.group(3))] += int(match.group(1).replace(",", ""))
    assert counts, "callgrind_annotate printed no function"
    return counts


def plain(function):
    """A function's path without hashes, generics' implementations and the crate's name."""
    function = re.sub(r"::h[0-9a-f]{16}$|'\d+$", "", function)
    function = re.sub(r"<impl ([\w:]+)(?:<.*>)?>", lambda m: m.group(1).split("::")[-1], function)
    return re.sub(r"<?etendue::", "", function).split(" [")[0]


def room(file, function):
    match = re.search(r"(?:^|/)src/(\w+)(?:/|\.rs)", file) if not re.search(r"/rustc/|/registry/", file) else None
    if match:
        return match.group(1)
    head = function.split("::")[0]
    if (ROOT / "src" / head).is_dir():
        return head
    libm = re.search(r"ieee754|/math/|libm", file)
    return "libm" if libm else "memory" if re.search(r"string/|malloc", file) else "other"


def table(title, counts, total, most):
    text = f"| {title} | % |\n| - | -: |\n"
    for name, count in counts.most_common(most):
        text += f"| {name} | {100 * count / total:.1f} |\n"
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell-box", "teapot-env", "veach-mis"], metavar="SCENE")
    parser.add_argument("--binary", type=Path, default=ROOT / "target" / "release" / "etendue")
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--spp", type=int, default=16)
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    for name in options.scenes:
        path = ROOT / "scenes" / name / "scene.xml"
        counts = callgrind(options.binary, path, options.size, FIRST + options.spp)
        counts.subtract(callgrind(options.binary, path, options.size, FIRST))
        total = sum(counts.values())
        rooms, functions = collections.Counter(), collections.Counter()
        for (file, function), count in counts.items():
            rooms[room(file, function)] += count
            functions[f"`{function}`"] += count
        print(f"### {name}, {options.size}\n")
        print(f"{total / (width * height * options.spp):.0f} instructions per sample.\n")
        print(table("room", rooms, total, 14))
        print(table("function", functions, total, 16))


if __name__ == "__main__":
    main()
