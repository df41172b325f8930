"""References, errors and intervals for race.py.

A reference is the mean of passes of different seeds by two renderers that
share no code; it comes with its variance, and with what the two disagree by.
relMSE is the mean over pixels and channels of ((a - r)^2 - var r) / (r^2 +
floor) with floor = 1e-2 x mean(r)^2, the same for all: the reference's own
noise is subtracted, and neither black pixels nor the noise of the picture in
question rule the denominator. Trimmed, the 0.1 % of pixels with the largest
error are left out: fireflies.
"""
import hashlib
import json

import numpy as np

FLOOR = 1e-2
TRIM = 1e-3
BLOCK = 16


class Moments:
    """Count, mean and sum of squared deviations of a stream of arrays."""

    def __init__(self):
        self.count, self.mean, self.squares = 0, 0.0, 0.0

    def add(self, value):
        self.count += 1
        step = value - self.mean
        self.mean = self.mean + step / self.count
        self.squares = self.squares + step * (value - self.mean)

    def variance(self):
        """Of the mean."""
        return self.squares / (self.count * (self.count - 1))


def blocks(pixels):
    """Means of 16 x 16 pixels per channel, flattened; the last is the whole mean."""
    height, width, _ = pixels.shape
    rows, columns = range(0, height, BLOCK), range(0, width, BLOCK)
    means = [pixels[y : y + BLOCK, x : x + BLOCK].mean(axis=(0, 1)) for y in rows for x in columns]
    return np.concatenate([*means, [pixels.mean()]])


class Reference:
    """Mean, variance of the mean, and how it was made."""

    def __init__(self, mean, variance, made):
        self.mean, self.variance, self.made = mean, variance, made
        self.denominator = mean**2 + FLOOR * mean.mean() ** 2

    def errors(self, pixels):
        """relMSE, trimmed relMSE, plain MSE; the reference's noise subtracted."""
        square = (pixels - self.mean) ** 2 - self.variance
        relative = (square / self.denominator).mean(axis=2).ravel()
        kept = np.sort(relative)[: relative.size - int(np.ceil(TRIM * relative.size))]
        return float(relative.mean()), float(kept.mean()), float(square.mean())

    def noise(self):
        """Its own relMSE."""
        return float((self.variance / self.denominator).mean())


def agreement(sides):
    """How far two renderers' passes are apart: relative difference of the whole
    mean, its standard error, and the root mean square of z over blocks (1 for
    equal means; somewhat more for few passes)."""
    (a, b) = sides
    difference, variance = a.mean - b.mean, a.variance() + b.variance()
    known = variance[:-1] > 0
    z = difference[:-1][known] / np.sqrt(variance[:-1][known])
    whole = 0.5 * (a.mean[-1] + b.mean[-1])
    return {
        "relative_difference": float(difference[-1] / whole),
        "standard_error": float(np.sqrt(variance[-1]) / whole),
        "rms_block_z": float(np.sqrt((z**2).mean())) if known.any() else 0.0,
    }


def make_reference(scene, peers, spp, passes, folder):
    """Renders with every one of `peers`, `passes` pictures each; weighted by
    the mean variance of their pixels."""
    sides, counts = [], []
    for peer in peers:
        pixels, means = Moments(), Moments()
        peer.open(scene, [spp], folder)
        for index in range(passes):
            run = peer.render(spp, 1_000_000 + index)
            assert np.isfinite(run.pixels).all(), f"{peer.name}: a pass is not finite"
            pixels.add(run.pixels)
            means.add(blocks(run.pixels))
        peer.close()
        counts.append(run.spp)
        sides.append((pixels, means))
    weights = np.array([1 / max(float(pixels.variance().mean()), 1e-300) for pixels, _ in sides])
    weights /= weights.sum()
    mean = sum(w * pixels.mean for w, (pixels, _) in zip(weights, sides))
    variance = sum(w * w * pixels.variance() for w, (pixels, _) in zip(weights, sides))
    made = {"by": [peer.version() for peer in peers], "weights": weights.tolist(), "spp_per_pass": counts, "passes_each": passes}
    if len(sides) == 2:
        made["agreement"] = agreement([means for _, means in sides])
    return Reference(mean, variance, made)


def cached_reference(scene, peers, spp, passes, cache, folder):
    """The same, kept in `cache` under the scene's content and size."""
    key = hashlib.sha256(scene.path.read_bytes())
    key.update(json.dumps([scene.width, scene.height, spp, passes, [peer.name for peer in peers]]).encode())
    path = cache / f"{scene.name}-{scene.width}x{scene.height}-{key.hexdigest()[:12]}.npz"
    if path.exists():
        stored = np.load(path)
        return Reference(stored["mean"], stored["variance"], json.loads(str(stored["made"])))
    reference = make_reference(scene, peers, spp, passes, folder)
    cache.mkdir(parents=True, exist_ok=True)
    np.savez(path, mean=reference.mean, variance=reference.variance, made=json.dumps(reference.made))
    return reference


class Paired:
    """Two renderers over the same rounds: rows are (cpu, spp, relMSE, trimmed)."""

    def __init__(self, ours, theirs):
        self.ours, self.theirs = np.array(ours), np.array(theirs)

    def ratios(self, rounds):
        """Speed (samples per CPU second), efficiency 1 / (relMSE x CPU) raw and
        trimmed; ours over theirs. Seconds of one round shared the machine with
        the same strangers: their ratio is taken within rounds, then the median.
        Errors are means: a median would hide fireflies."""
        ours, theirs = self.ours[rounds], self.theirs[rounds]
        seconds = np.median(theirs[..., 0] / ours[..., 0], axis=-1)
        samples = theirs[..., 1].mean(axis=-1) / ours[..., 1].mean(axis=-1)
        raw, trimmed = (theirs[..., k].mean(axis=-1) / ours[..., k].mean(axis=-1) for k in (2, 3))
        return np.stack([seconds / samples, seconds * raw, seconds * trimmed], axis=-1)

    def estimate(self):
        return self.ratios(np.arange(len(self.ours)))

    def bootstrap(self, generator, count):
        """`count` estimates from rounds drawn with replacement."""
        size = len(self.ours)
        return self.ratios(generator.integers(size, size=(count, size)))


def interval(values):
    """95 % percentile interval; not defined where a resampled error is not positive."""
    values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    if np.isnan(values).all():
        return (np.nan, np.nan)
    return tuple(np.nanpercentile(values, [2.5, 97.5]))
