#!/usr/bin/env python3
"""The macro-benchmark: etendue and its peers, same scenes, in one sitting.

    python tools/race.py [SCENE ...] [--spp 16,64,256] [--runs 16,8,4]
                         [--etendue [NAME=]BINARY ...] [--out FOLDER]

SCENE is a folder of scenes/ or a path to a Mitsuba 3 scene file. Each picture
is rendered `runs` times for each count of samples, in rounds; within a round
every renderer and count takes its turn in random order, so that whatever else
the machine does hits all alike. What is compared is CPU seconds of rendering
alone and relMSE against a common reference (race_error.py says how both are
made). Ratios are peer over ours: above 1, ours is better.

Peers: Mitsuba 3 `scalar_rgb` and `llvm_ad_rgb` with `multijitter`, its best
sampler, at its default (fast) intersections; and every further --etendue, such
as an older build. Peers that are missing, or that read no Mitsuba scenes, are
named with how to get them.

Writes race.csv (every run), race.md (tables, machine, command, commit) and one
plot per scene to --out, by default record/DATE-MACHINE. References are cached
in --cache (target/race).
"""
import argparse
import datetime
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import race_error
import race_peers
import race_report

ROOT = Path(__file__).resolve().parent.parent


def numbers(text):
    return [int(part) for part in text.split(",")]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell-box", "teapot-env", "veach-mis"], metavar="SCENE")
    parser.add_argument("--etendue", action="append", metavar="[NAME=]BINARY", help="ours comes first; target/release/etendue by default")
    parser.add_argument("--peers", default="mitsuba-scalar_rgb,mitsuba-llvm_ad_rgb", help="which of Mitsuba's variants; may be empty")
    parser.add_argument("--sampler", default="multijitter", help="Mitsuba's")
    parser.add_argument("--spp", type=numbers, default=[16, 64, 256], metavar="N,...")
    parser.add_argument("--runs", type=numbers, default=[16, 8, 4], metavar="N,...", help="pictures for each count of samples")
    parser.add_argument("--width", type=int, default=256, help="of the pictures; height by the scene's aspect ratio")
    parser.add_argument("--threads", type=int, default=0, help="of every renderer; 0 is one per core")
    parser.add_argument("--reference-spp", type=int, default=64, metavar="N", help="of each pass of a reference")
    parser.add_argument("--reference-passes", type=int, default=16, metavar="N", help="by ours and by Mitsuba each")
    parser.add_argument("--seed", type=int, default=1, help="of the order of runs and of the bootstrap")
    parser.add_argument("--cache", type=Path, default=ROOT / "target" / "race")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    if len(options.runs) != len(options.spp):
        parser.error("--runs needs as many numbers as --spp")
    if min(options.runs) < 2:
        parser.error("fewer than two runs say nothing about their spread")
    return options


def ready_peers(options):
    """Those that can run, ours first, and what the others lack."""
    named = [text.split("=", 1) if "=" in text else ["etendue", text] for text in options.etendue or ["target/release/etendue"]]
    wanted = [race_peers.Etendue(name, binary, options.threads) for name, binary in named]
    for name in filter(None, options.peers.split(",")):
        variant = name.removeprefix("mitsuba-")
        wanted.append(race_peers.Mitsuba(variant, options.sampler, options.threads))
    if len({peer.name for peer in wanted}) != len(wanted):
        sys.exit("two renderers of the same name: --etendue NAME=BINARY")
    ready, absent = [], {}
    for peer in wanted:
        reason = peer.missing()
        if reason:
            absent[peer.name] = reason
        else:
            ready.append(peer)
    for name, found, how in race_peers.OTHERS:
        absent[name] = "installed, but it reads no Mitsuba scenes: not raced" if found() else f"{how}; reads no Mitsuba scenes: not raced yet"
    for name, reason in absent.items():
        print(f"left out: {name}: {reason}", flush=True)
    if not ready or ready[0] is not wanted[0]:
        sys.exit(f"{wanted[0].name}: {absent[wanted[0].name]}")
    return ready, absent


def find_scene(name, width):
    path = Path(name)
    path = path if path.is_file() else ROOT / "scenes" / name / "scene.xml"
    if not path.is_file():
        sys.exit(f"no scene {name}: neither a file nor a folder of scenes/")
    return race_peers.read_scene(path, width)


def reference_of(scene, peers, options, folder):
    """By ours and by the fastest Mitsuba there is, which share no code."""
    judges = [peers[0], *[peer for peer in peers if isinstance(peer, race_peers.Mitsuba)][-1:]]
    reference = race_error.cached_reference(scene, judges, options.reference_spp, options.reference_passes, options.cache, folder)
    agreement = reference.made.get("agreement")
    print(f"{scene.name}: reference of relMSE {reference.noise():.2e}, {agreement or 'not cross-checked: one renderer only'}", flush=True)
    if agreement and abs(agreement["relative_difference"]) > max(4 * agreement["standard_error"], 2e-3):
        sys.exit(f"{scene.name}: the renderers disagree; a race against their mean would say nothing")
    return reference


def run_scene(scene, peers, reference, options, folder):
    """All rounds of one scene: a row for each picture."""
    rows, order = [], random.Random(options.seed)
    for peer in peers:
        peer.open(scene, options.spp, folder)
    for index in range(max(options.runs)):
        jobs = [(peer, spp) for peer in peers for spp, runs in zip(options.spp, options.runs) if index < runs]
        order.shuffle(jobs)
        for peer, spp in jobs:
            load = os.getloadavg()[0]
            run = peer.render(spp, 1 + index)
            raw, trimmed, mse = reference.errors(run.pixels)
            rows.append({
                "scene": scene.name, "peer": peer.name, "asked_spp": spp, "spp": run.spp, "round": index,
                "pixels": scene.width * scene.height, "cpu": run.cpu, "wall": run.wall, "setup": run.setup,
                "relmse": raw, "relmse_trimmed": trimmed, "mse": mse, "load": load,
            })
        print(f"{scene.name}: round {index + 1} of {max(options.runs)}", flush=True)
    for peer in peers:
        peer.close()
    return rows


def processor():
    """Model of the processor and number of cores this process may use."""
    try:
        text = Path("/proc/cpuinfo").read_text()
        model = re.search(r"model name\s*: (.*)", text).group(1)
    except (OSError, AttributeError):
        import platform

        model = platform.processor() or platform.machine()
    return f"{model}, {len(os.sched_getaffinity(0))} cores"


def commit():
    """Last commit that changed the renderer, and whether it has been edited since."""
    parts = ["--", "src", "Cargo.toml", "Cargo.lock"]
    git = lambda *words: subprocess.run(["git", *words, *parts], cwd=ROOT, text=True, capture_output=True).stdout.strip()
    return (git("log", "-1", "--format=%h") or "unknown") + (" and local changes" if git("status", "--porcelain") else "")


def main():
    options = arguments()
    peers, absent = ready_peers(options)
    options.names = [peer.name for peer in peers]
    scenes = [find_scene(name, options.width) for name in options.scenes]
    today = datetime.date.today().isoformat()
    machine = processor()
    slug = re.sub(r"[^a-z0-9]+", "-", machine.lower()).strip("-")
    out = options.out or ROOT / "record" / f"{today}-{slug}"
    out.mkdir(parents=True, exist_ok=True)
    rows, references, loads = [], {}, [os.getloadavg()]
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            folder = Path(folder)
            references[scene.name] = reference_of(scene, peers, options, folder)
            rows += run_scene(scene, peers, references[scene.name], options, folder)
    loads.append(os.getloadavg())
    facts = {
        "date": today,
        "command": shlex.join(["python", "tools/race.py", *sys.argv[1:]]),
        "commit of the renderer": commit(),
        "processor": machine,
        "load average before, after": " / ".join(", ".join(f"{v:.1f}" for v in load) for load in loads),
        "renderers": "; ".join(f"{peer.name} = {peer.version()}" for peer in peers),
        "left out": "; ".join(f"{name} ({reason})" for name, reason in absent.items()),
    }
    race_report.write(out, rows, references, facts, options)
    print(f"written to {out}", flush=True)


if __name__ == "__main__":
    main()
