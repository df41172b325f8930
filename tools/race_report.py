"""Tables and plots of race.py: CSV of every run, Markdown, one SVG per scene."""
import csv
import os

import numpy as np

from race_error import Paired, interval

BOOTSTRAPS = 2000
RATIOS = ("speed", "efficiency", "trimmed")


def pick(rows, scene, peer, spp):
    """Runs of one renderer at one count of samples, by round."""
    chosen = [row for row in rows if (row["scene"], row["peer"], row["asked_spp"]) == (scene, peer, spp)]
    return sorted(chosen, key=lambda row: row["round"])


def paired(rows, scene, ours, theirs, spp):
    columns = ("cpu", "spp", "relmse", "relmse_trimmed")
    side = lambda peer: [[row[column] for column in columns] for row in pick(rows, scene, peer, spp)]
    return Paired(side(ours), side(theirs))


def number(value, bounds=None):
    """Three digits, with its interval."""
    text = f"{value:.3g}" if value < 1e3 else f"{value:.0f}"
    return text if bounds is None else f"{text} ({bounds[0]:.3g} to {bounds[1]:.3g})"


def table(header, lines):
    rule = ["-"] + ["-:"] * (len(header) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [header, rule, *lines]) + "\n"


def mean_interval(values, generator):
    values = np.array(values)
    return interval(values[generator.integers(values.size, size=(BOOTSTRAPS, values.size))].mean(axis=1))


def measured(rows, scene, peers, options, generator):
    """What each renderer did: one line per count of samples."""
    lines = []
    for spp in options.spp:
        for peer in peers:
            runs = pick(rows, scene, peer, spp)
            samples = runs[0]["pixels"] * runs[0]["spp"]
            cpu = np.median([run["cpu"] for run in runs])
            error, trimmed = ([run[key] for run in runs] for key in ("relmse", "relmse_trimmed"))
            lines.append([
                peer, str(runs[0]["spp"]), str(len(runs)), number(cpu), number(samples / cpu / 1e6), number(1e6 * cpu / samples),
                f"{np.mean(error):.2e}", "{:.1e} to {:.1e}".format(*mean_interval(error, generator)), f"{np.mean(trimmed):.2e}",
                number(float(np.median([run["setup"] for run in runs]))),
            ])
    header = ["renderer", "spp", "runs", "CPU s", "M samples per CPU s", "µs per sample", "relMSE", "95 %", "trimmed", "setup s"]
    return table(header, lines)


def compare(rows, scenes, peers, options, generator):
    """Ratios of every peer to ours: {(peer, spp): {scene: (estimate, replicates)}}."""
    ratios = {}
    for theirs in peers[1:]:
        for spp in options.spp:
            pairs = {scene: paired(rows, scene, peers[0], theirs, spp) for scene in scenes}
            ratios[theirs, spp] = {scene: (pair.estimate(), pair.bootstrap(generator, BOOTSTRAPS)) for scene, pair in pairs.items()}
    return ratios


def ratio_tables(ratios, scenes):
    """One table per peer; a line per count of samples and scene, then the
    geometric mean and the worst scene."""
    text = ""
    for peer in dict.fromkeys(peer for peer, _ in ratios):
        lines = []
        for (name, spp), by_scene in ratios.items():
            if name != peer:
                continue
            for scene in scenes:
                estimate, replicates = by_scene[scene]
                lines.append([scene, str(spp), *[number(estimate[k], interval(replicates[:, k])) for k in range(len(RATIOS))]])
            if len(scenes) > 1:
                lines.append(["**geometric mean**", str(spp), *summary(by_scene)])
                worst = np.min([estimate for estimate, _ in by_scene.values()], axis=0)
                lines.append(["**worst**", str(spp), *[number(value) for value in worst]])
        text += f"\n### {peer} against ours\n\n"
        text += table(["scene", "spp", "speed", "efficiency", "efficiency, trimmed"], lines)
    return text


def summary(by_scene):
    with np.errstate(invalid="ignore"):
        estimate = np.exp(np.mean([np.log(estimate) for estimate, _ in by_scene.values()], axis=0))
        replicates = np.exp(np.mean([np.log(replicates) for _, replicates in by_scene.values()], axis=0))
    return [number(estimate[k], interval(replicates[:, k])) for k in range(len(RATIOS))]


def shared(rows, threads):
    """Part of the runs that did not have the machine to themselves."""
    return np.mean([row["cpu"] < 0.9 * row["wall"] * threads for row in rows])


def references_text(references):
    lines = []
    for scene, reference in references.items():
        made = reference.made
        agreement = made.get("agreement")
        how = " and ".join(f"{made['passes_each']} × {spp} spp by {by}" for spp, by in zip(made["spp_per_pass"], made["by"]))
        said = "not cross-checked"
        if agreement:
            said = f"{100 * agreement['relative_difference']:+.3f} % ± {100 * agreement['standard_error']:.3f} %, blocks' rms z {agreement['rms_block_z']:.2f}"
        lines.append([scene, how, f"{reference.noise():.1e}", said])
    return table(["scene", "reference", "its relMSE (subtracted)", "difference of the two means"], lines)


def plot(path, rows, scene, peers, options, generator):
    """relMSE against CPU seconds, both logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.fonttype"] = "none"
    matplotlib.rcParams["svg.hashsalt"] = "etendue"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 4.2))
    for index, peer in enumerate(peers):
        points = []
        for spp in options.spp:
            runs = pick(rows, scene, peer, spp)
            errors = [run["relmse"] for run in runs]
            mean, (low, high) = np.mean(errors), mean_interval(errors, generator)
            points.append((np.median([run["cpu"] for run in runs]), mean, mean - low, high - mean))
        x, y, below, above = np.array(points).T
        axes.errorbar(x, y, yerr=np.maximum([below, above], 0), marker="o", capsize=3, label=peer, color=f"C{index}")
        if index == 0:
            axes.plot(x, y[0] * x[0] / x, ":", color="gray", label="1/t")
    axes.set(xscale="log", yscale="log", xlabel="CPU seconds of rendering", ylabel="relMSE", title=scene)
    axes.grid(True, which="both", alpha=0.2)
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)


def write(out, rows, references, facts, options):
    """race.csv, race.md and SCENE.svg; `facts` go to the top as they are."""
    generator = np.random.default_rng(options.seed)
    scenes, peers = list(references), options.names
    with open(out / "race.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    threads = options.threads or len(os.sched_getaffinity(0))
    text = "# Race\n\n" + "".join(f"- {key}: {value}\n" for key, value in facts.items())
    text += f"- runs with less CPU than 90 % of wall time × {threads} threads, which shared the machine: {100 * shared(rows, threads):.0f} %\n"
    text += "\nCPU seconds are of rendering alone, median over runs; relMSE is the mean over runs, with a 95 % bootstrap interval; "
    text += "*trimmed* leaves out the 0.1 % of pixels with the largest error; *setup* is loading and building.\n"
    text += "\n## References\n\n" + references_text(references)
    text += "\n## Ratios\n\nOver 1, ours is better. *Speed*: samples per CPU second. *Efficiency*: 1 / (relMSE × CPU seconds).\n"
    text += ratio_tables(compare(rows, scenes, peers, options, generator), scenes)
    for scene in scenes:
        text += f"\n## {scene}\n\n" + measured(rows, scene, peers, options, generator) + f"\n![relMSE against CPU seconds]({scene}.svg)\n"
        plot(out / f"{scene}.svg", rows, scene, peers, options, generator)
    (out / "race.md").write_text(text, encoding="utf-8")
