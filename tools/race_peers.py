"""The renderers that race.py sets against each other.

A peer renders one scene at a count of samples and a seed, and says how many
CPU and wall seconds rendering alone took: without loading, building,
compiling or writing. `etendue` is started anew for each picture and reads its
own clock (`--stats`); Mitsuba stays up in a process of its own for one scene
and one variant, since its vectorised variants compile first, and its clock is
the process's around `mi.render` with the film developed.

Run as a program, this file is such a Mitsuba process:

    python race_peers.py VARIANT SAMPLER THREADS SCENE [NAME=VALUE ...]

reads one JSON request a line, {"spp", "seed", "out"}, and answers each by one.
"""
import importlib.metadata
import importlib.util
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# Peers that cannot be raced here yet: they read scenes of their own formats.
# Name, how to see that it is there, how to get it.
OTHERS = [
    ("Cycles", lambda: importlib.util.find_spec("bpy"), "pip install bpy==5.0.1 (Python 3.11)"),
    ("LuxCore", lambda: importlib.util.find_spec("pyluxcore"), "pip install pyluxcore"),
    ("pbrt-v4", lambda: shutil.which("pbrt"), "build github.com/mmp/pbrt-v4, put pbrt on PATH"),
]


@dataclass(frozen=True)
class Scene:
    """A scene file and the size of its picture."""

    name: str
    path: Path
    width: int
    height: int

    def defines(self):
        return {"resx": str(self.width), "resy": str(self.height)}


@dataclass(frozen=True)
class Run:
    """One picture: RGB in float64, what it cost, what preceded it."""

    pixels: np.ndarray
    spp: int
    cpu: float
    wall: float
    setup: float


def read_scene(path, width):
    """The scene at `path` in its own aspect ratio, `width` pixels wide."""
    text = path.read_text(encoding="utf-8")
    size = [re.search(rf'<default name="{name}" value="(\d+)"', text) for name in ("resx", "resy")]
    if not all(size):
        sys.exit(f"{path}: no <default> named resx and resy, by which its size could be set")
    resx, resy = (int(match.group(1)) for match in size)
    name = path.parent.name if path.name == "scene.xml" else f"{path.parent.name}-{path.stem}"
    return Scene(name, path, width, max(1, round(width * resy / resx)))


class Etendue:
    """Ours, or an older build of it."""

    def __init__(self, name, binary, threads):
        self.name, self.binary, self.threads = name, Path(binary), threads

    def missing(self):
        return None if self.binary.is_file() else f"no file {self.binary}: cargo build --release"

    def version(self):
        return subprocess.run([self.binary, "--version"], check=True, text=True, capture_output=True).stdout.strip()

    def open(self, scene, counts, folder):
        self.scene, self.folder = scene, folder

    def render(self, spp, seed):
        import OpenImageIO as oiio

        out, stats = self.folder / "picture.exr", self.folder / "stats.json"
        command = [self.binary, "render", self.scene.path, "-o", out, "--spp", spp, "--seed", seed, "--stats", stats]
        command += ["--threads", self.threads, "--quiet"]
        for name, value in self.scene.defines().items():
            command += ["-D", f"{name}={value}"]
        done = subprocess.run([str(part) for part in command], text=True, capture_output=True)
        if done.returncode != 0:
            sys.exit(f"{self.name} failed on {self.scene.name}:\n{done.stderr}")
        said = json.loads(stats.read_text())
        picture = oiio.ImageBuf(str(out))
        channels = [picture.spec().channelnames.index(name) for name in "RGB"]
        pixels = picture.get_pixels(oiio.FLOAT).astype(np.float64)[..., channels]
        setup = said["load_seconds"] + said["build_seconds"]
        return Run(pixels, said["samples_per_pixel"], said["render_cpu_seconds"], said["render_wall_seconds"], setup)

    def close(self):
        pass


class Mitsuba:
    """Mitsuba 3 in one variant, with one sampler."""

    def __init__(self, variant, sampler, threads):
        self.name = f"mitsuba-{variant}"
        self.variant, self.sampler, self.threads = variant, sampler, threads
        self.process = None

    def missing(self):
        if not importlib.util.find_spec("mitsuba"):
            return "pip install -r tools/requirements.txt"
        probe = f"import mitsuba as mi, drjit as dr; mi.set_variant('{self.variant}'); dr.eval(mi.Float(1) + 1)"
        done = subprocess.run([sys.executable, "-c", probe], text=True, capture_output=True)
        if done.returncode == 0:
            return None
        last = (done.stderr.strip() or "stopped").splitlines()[-1]
        return f"{last} (llvm_ad_rgb wants LLVM 16 or newer: set DRJIT_LIBLLVM_PATH to libLLVM.so)"

    def version(self):
        return f"Mitsuba {importlib.metadata.version('mitsuba')}, {self.variant}, sampler {self.sampler}"

    def open(self, scene, counts, folder):
        self.folder = folder
        command = [sys.executable, __file__, self.variant, self.sampler, self.threads, scene.path]
        command += [f"{name}={value}" for name, value in scene.defines().items()]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([str(part) for part in command], stdin=pipe, stdout=pipe, text=True)
        self.setup = self.answer()["cpu"]
        # Compiled variants make a kernel for each count of samples.
        for spp in counts if "scalar" not in self.variant else [1]:
            self.ask(spp, 0, None)

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"{self.name} ended with code {self.process.wait()}")
        return json.loads(line)

    def ask(self, spp, seed, out):
        print(json.dumps({"spp": spp, "seed": seed, "out": out}), file=self.process.stdin, flush=True)
        return self.answer()

    def render(self, spp, seed):
        out = self.folder / f"{self.name}.npy"
        said = self.ask(spp, seed, str(out))
        return Run(np.load(out), said["spp"], said["cpu"], said["wall"], self.setup)

    def close(self):
        if self.process:
            self.process.stdin.close()
            self.process.wait()
            self.process.stdout.close()
            self.process = None


def process_cpu():
    """CPU seconds of all threads of this process, dead ones included."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def load_mitsuba(mi, path, sampler, defines):
    """The scene with another sampler in the place of the file's."""
    text, found = re.subn(r'(<sampler type=)"\w+"', rf'\1"{sampler}"', path.read_text(encoding="utf-8"))
    assert found == 1, f"{path}: {found} samplers"
    mi.file_resolver().prepend(str(path.parent))
    return mi.load_string(text, **defines)


def serve_mitsuba(variant, sampler, threads, path, *defines):
    """Answers requests on standard input until it ends."""
    # What Mitsuba prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    import drjit as dr
    import mitsuba as mi

    if int(threads) > 0:
        dr.set_thread_count(int(threads))
    mi.set_variant(variant)
    start = process_cpu()
    scene = load_mitsuba(mi, Path(path), sampler, dict(define.split("=", 1) for define in defines))
    print(json.dumps({"cpu": process_cpu() - start}), file=answers, flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        cpu, wall = process_cpu(), time.perf_counter()
        # As an array: the film is developed and all work done when this returns.
        pixels = np.array(mi.render(scene, spp=request["spp"], seed=request["seed"]))
        cpu, wall = process_cpu() - cpu, time.perf_counter() - wall
        if request["out"]:
            np.save(request["out"], pixels[..., :3].astype(np.float64))
        # A sampler may have rounded the count.
        spp = scene.sensors()[0].sampler().sample_count()
        print(json.dumps({"cpu": cpu, "wall": wall, "spp": spp}), file=answers, flush=True)


if __name__ == "__main__":
    serve_mitsuba(*sys.argv[1:])
