"""How noisy the force is, sample by sample, and how much neighbouring samples say the same thing.

σ² = σ_F² + (K σ_x)²: the force's own noise, which may grow with the force (`uneven`), and be louder in motion or at
times (`louder`), and what is left of the position's through the local stiffness. The colour is that of a Gauss–Markov
process with white noise beside it, ρ_k = a φ^k, or of several whose memories are evenly spread: 1/f.

Both are matched to how far the means of three neighbouring stretches of a hold are off a line, stretches of 1, 2, 4 …
samples (the three-sample variance of clocks: R. A. Baugh, Proc. 25th Freq. Control Symp., 1971, 222–225). Noise has
no power that rises with frequency, and forgets within `MEMORY_S` where it is no 1/f. What knocks for a while, swings or
wanders in the holds is none, and is told from it by that; what is louder at times in samples that follow each other is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter
from scipy.stats import chi2 as chi2_law

from bench.identify.motion import holds
from bench.recording.types import Measurement

from .uneven import likeliest, share_of_force

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLED_S = 0.15  # after a move: before, what a mode, a lag or ringing still does is no noise
LONGEST = 4000  # samples of a hold that are looked at
LEAST = 12
MEMORY_S = 0.15  # correlation time beyond which it is no noise, but structure
SLOWER_S, SMOOTHER_S = (0.6, 2.5), (0.1, 0.5)  # memory of what wanders, and of what wanders without kinks
SWINGS_HZ, SWINGS_S = np.geomspace(1.0, 16.0, 9), 4.0  # what swings, and how long it keeps its phase
FLICKER_S, OCTAVES = (10.0, 2.5, 0.64, 0.32, 0.16, 0.08, 0.04), 4.0  # longest memories of noise of 1/f, the longest
# first; from pole to pole
AS_LIKELY = 5.0  # twice the log-likelihood within which the longest memory is taken: 1/f has no end that is known
REACH_S = 0.6  # of the longest stretches that are compared
LEVELS = 12
WINDOW_S, SHORTEST = 0.4, 24  # in which noise is compared with noise; samples
CHANCE = 1e-3  # that a window of noise alone is left out
TAILS = 1.5  # times more than Gaussian noise does a window of heavy-tailed noise vary
STEADY = 0.02  # relative doubt of every level: no noise is exactly of this form
HARDLY_ANY = 0.5  # of what noise leaves, in power: so little only a simulation without noise does
FINEST, NEARLY_ALL = 2e-5, 0.99  # of the force that nearly all samples are below
MISFIT = 2.0  # times better must colour make the fit of noise with structure beside it
WIDTHS = range(2, 17)  # samples of a running mean
COLOURED, PAYS = 3.0, 20.0  # twice the log-likelihood by which colour, and structure beside the noise, must better it


Poles = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Colour:
    """ρ_0 = 1, ρ_k = Σ share · φ^k between force samples k apart, of poles (share, φ)."""

    poles: Poles = ()

    @property
    def memory(self) -> float:
        """Samples that say the same as one, of a slow direction: 1 + 2 Σ ρ."""
        return 1.0 + 2.0 * sum(share * phi / (1.0 - phi) for share, phi in self.poles)

    def memory_of(self, change: Array) -> float:
        """The same of a change (n,) of a model's force, sample by sample: Σ ρ_(i−j) d_i d_j/Σ d²."""
        power = max(float(np.sum(change * change)), 1e-300)
        felt = change * (1.0 - sum(share for share, _ in self.poles))
        for share, phi in self.poles:
            felt = felt + share * (2.0 * lfilter([1.0], [1.0, -phi], change) - change)
        return float(np.sum(felt * change)) / power


@dataclass(frozen=True)
class ForceNoise:
    """Of the force alone: `air_N` in air and at rest, and `share` of the force adds to that in squares; `force_N`: RMS
    over the data. `from_holds`: else from motion."""

    air_N: float
    colour: Colour
    from_holds: bool
    share: float = 0.0
    force_N: float = 0.0

    def at(self, force_N: Array) -> Array:
        """Standard deviations at forces (n,), N."""
        return np.asarray(np.hypot(self.air_N, self.share * force_N))


Part = tuple[Array, Array, Array]
"""Of one hold: stamps, errors about a smooth curve, and the orthonormal basis that was taken out."""


def least_N(m: Measurement) -> float:
    """Noise, N, below which no load cell is: less are the digits of a simulation that has none."""
    return max(FINEST * float(np.quantile(np.abs(m.force_N), NEARLY_ALL)), 1e-9)


def hold_errors(m: Measurement, good: Mask) -> list[Part]:
    """What smooth curves leave of the force samples (m,) that are `good`, hold by hold."""
    parts: list[Part] = []
    for stretch in holds(m.position_time_s, m.position_mm):
        t0, t1 = m.position_time_s[stretch.start], m.position_time_s[stretch.stop - 1]
        first, last = np.searchsorted(m.force_time_s, [t0, t1])
        first = int(first) + min(
            int(last - first) // 4, int(np.searchsorted(m.force_time_s[first:last], t0 + SETTLED_S))
        )
        first = max(first, int(last) - LONGEST)
        kept = np.arange(first, int(last))[good[first : int(last)]]
        if len(kept) >= LEAST:
            parts.append((m.force_time_s[kept], *_about_curve(m.force_time_s[kept], m.force_N[kept])))
    return parts


def force_noise(m: Measurement, good: Mask, louder: Array | None = None) -> ForceNoise:
    """Of the force samples (m,) that are `good`, about smooth curves through the holds. `louder` (m,): times as loud as
    in the mean, at rest."""
    noise = _of_holds(m, good, np.ones(len(m.force_N)) if louder is None else louder)
    return replace(noise, force_N=float(np.sqrt(np.mean(noise.at(m.force_N[good]) ** 2))))


def _of_holds(m: Measurement, good: Mask, louder: Array) -> ForceNoise:
    parts, sample_s = hold_errors(m, good), float(np.median(np.diff(m.force_time_s)))
    parts = [(t, e / np.interp(t, m.force_time_s, louder), Q) for t, e, Q in parts]
    if sum(len(e) for _, e, _ in parts) < 40:
        return ForceNoise(_from_motion(m.force_N[good]), Colour(), False)
    curves = [np.interp(t, m.force_time_s, m.force_N) - e for t, e, _ in parts]
    share = share_of_force([e for _, e, _ in parts], [float(np.sqrt(np.mean(y**2))) for y in curves])
    if share == 0.0:
        return _matched([(e, Q) for _, e, Q in parts], sample_s)
    in_air = _matched([(e / np.hypot(1.0, share * y), Q) for (_, e, Q), y in zip(parts, curves, strict=True)], sample_s)
    return replace(in_air, share=share * in_air.air_N)


def _about_curve(t: Array, y: Array) -> tuple[Array, Array]:
    """(what is left of y about a constant, a line and exponentials, the orthonormal basis taken out)."""
    n = len(y)
    span = t[-1] - t[0]
    terms = int(np.clip(n // 8, 1, 9))
    basis = [np.ones(n), (t - t[0]) / span]
    basis += [np.exp(-(t - t[0]) / tau) for tau in np.geomspace(2.0 * span / n, 0.6 * span, terms)]
    Q, _ = np.linalg.qr(np.stack(basis, axis=1))
    left = y - y.mean()
    return left - Q @ (Q.T @ left), Q


def _bent(values: Array, m: int) -> Array:
    """Of values (n, …), (n − 3m + 1, …): the mean of m neighbours less twice the next m's, and that of the m after."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    means = (total[m:] - total[:-m]) / m
    return np.asarray(means[: -2 * m] - 2.0 * means[m:-m] + means[2 * m :])


@dataclass(frozen=True)
class _Level:
    """Stretches of `m` samples: squares (k,) and the window (k,) of each; by part, the basis bent like the errors."""

    m: int
    square: Array
    window: NDArray[np.intp]
    bent: list[Array]

    @property
    def white(self) -> Array:
        """E of each square (k,) for unit white noise, of which the projections took their part."""
        return np.asarray(6.0 / self.m - np.concatenate([np.sum(bent**2, axis=1) for bent in self.bent]))


def _levels(parts: list[tuple[Array, Array]], sample_s: float) -> list[_Level]:
    longest, out = max(len(e) for e, _ in parts), []
    width = max(round(WINDOW_S / sample_s), SHORTEST)
    for m in [2**k for k in range(LEVELS)]:
        if 4 * m > longest or (m > 4 and m * sample_s > REACH_S):
            break
        squares, windows, bent, before = [], [], [], 0
        for e, Q in parts:
            count, n = max(len(e) // width, 1), len(e) - 3 * m + 1
            if 4 * m <= len(e):
                squares.append(_bent(e, m) ** 2)
                windows.append(before + np.minimum((np.arange(n) + 3 * m // 2) * count // len(e), count - 1))
                bent.append(_bent(Q, m))
            else:
                bent.append(np.zeros((0, Q.shape[1])))
            before += count
        out.append(_Level(m, np.concatenate(squares), np.concatenate(windows), bent))
    return out


def _of_lags(parts: list[tuple[Array, Array]], level: _Level, kept: Mask) -> Array:
    """w (n,): Σ w_k ρ_k is what the `kept` squares (k,) are in the mean, for unit noise of correlations ρ.

    With C the stretches, one a row, and B = C Q: the trace of C (1 − QQᵀ) R (1 − QQᵀ) Cᵀ, whatever R is.
    """
    stretch = np.repeat([1.0, -2.0, 1.0], level.m) / level.m
    own = np.correlate(stretch, stretch, "full")[len(stretch) - 1 :]
    out, at = np.zeros(max(len(e) for e, _ in parts)), 0
    out[: len(own)] = kept.sum() * np.concatenate([own[:1], 2.0 * own[1:]])
    for (e, Q), bent in zip(parts, level.bent, strict=True):
        n = len(e)
        if len(bent):
            bent = bent * kept[at : at + len(bent), None]
            at += len(bent)
            back = _bent(np.pad(bent, ((3 * level.m - 1,) * 2, (0, 0))), level.m)  # Cᵀ B
            long = next_fast_len(2 * n, real=True)
            across = rfft(Q, long, axis=0).conj() * rfft(Q @ (bent.T @ bent) - 2.0 * back, long, axis=0)
            both = irfft(across.sum(axis=1), long)
            out[:n] += both[:n]
            out[1:n] += both[: long - n : -1]
    return out / int(kept.sum())


def _steady(level: _Level, windows: int) -> Mask:
    """Windows (windows,) that are no louder than noise is that does not change, by one level of detail."""
    n = np.bincount(level.window, minlength=windows)
    there = n > 0
    powers = np.bincount(level.window, level.square, windows), np.bincount(level.window, level.white, windows)
    loud = powers[0][there] / powers[1][there]
    freedom = np.maximum(n[there] / _together(level.m), 1.0)
    usual = float(np.median(loud / (chi2_law.median(freedom) / freedom)))
    freedom = np.maximum(freedom / TAILS, 1.0)
    kept = np.ones(windows, dtype=bool)
    kept[there] = loud <= usual * np.asarray(chi2_law.isf(CHANCE, freedom)) / freedom
    return kept


def _together(m: int) -> float:
    """Neighbouring squares that say as much as one, of white noise: Σ of their squared correlations."""
    return 0.78 * m + 1.16


def _matched(parts: list[tuple[Array, Array]], sample_s: float) -> ForceNoise:
    """σ, a and φ under which the squares found are likeliest."""
    levels = _levels(parts, sample_s)
    windows = 1 + max(int(level.window.max()) for level in levels)
    keep = np.logical_and.reduce([_steady(level, windows) for level in levels])
    keep = keep if keep.any() else ~keep  # each is loud at some level: then none is an exception
    used = [(level, at) for level in levels if (at := keep[level.window]).sum() >= 3.0 * _together(level.m)]
    counts = np.array([at.sum() / _together(level.m) for level, at in used])
    lags = np.stack([_of_lags(parts, level, at) for level, at in used])
    after_s = sample_s * np.arange(lags.shape[1])

    def tail(memory_s: float, frequency_Hz: float = 0.0) -> Array:
        return np.asarray(lags @ (np.exp(-after_s / memory_s) * np.cos(2.0 * np.pi * frequency_Hz * after_s)))

    plain, found = lags[:, 0], np.array([level.square[at].mean() for level, at in used])
    if len(found) < 3 or not found.all():  # a channel without noise stands still in air
        return ForceNoise(float(np.sqrt(max(found[0] / plain[0], 1e-300))), Colour(), True)
    weight = 1.0 / (1.0 / counts + STEADY**2)
    memories = np.geomspace(0.5 * sample_s, max(MEMORY_S, sample_s), 20).tolist()
    kinds = [_Kind((), [plain]), *(_Kind(_pole(memory, sample_s), [plain, tail(memory)]) for memory in memories)]
    best = _best(kinds, [], found, weight)
    flicker = best
    if _best(kinds[:1], [], found, weight).deviance > PAYS:
        flickers = [_best([_flicker(longest, sample_s, plain, tail)], [], found, weight) for longest in FLICKER_S]
        enough = min(f.deviance for f in flickers) + AS_LIKELY
        flicker = next(f for f in flickers if f.deviance <= enough)
        if best.carried < best.own and flicker.deviance < min(best.deviance, PAYS) + COLOURED:
            best = flicker  # of two that serve as well: what fades beside more that is white is seldom of one memory
    if best.deviance > PAYS:
        widths = [w for w in WIDTHS if w * sample_s < MEMORY_S]
        # of what fades, the memory that adds up to as many samples: near enough to make it white
        averages = [
            _Kind(
                _pole(sample_s / float(np.log((w + 1) / (w - 1))), sample_s),
                # as white noise has after a running mean: it forgets all at once
                [plain, lags @ np.maximum(1.0 - after_s / (w * sample_s), 0.0)],
            )
            for w in widths
        ]
        averaged = _best(averages, [], found, weight)
        if averaged.deviance + PAYS < best.deviance:
            best, kinds = averaged, [kinds[0], *averages]
    if best.deviance > PAYS:
        beside = [tail(memory) for memory in SLOWER_S]
        # (1 + x) e^−x
        beside += [tail(memory) + (tail(1.05 * memory) - tail(0.95 * memory)) / 0.1 for memory in SMOOTHER_S]
        beside += [tail(SWINGS_S, f) for f in SWINGS_HZ if f * sample_s < 0.1]
        # no structure has just these forms: colour must take a good part of what they leave
        other = _best(kinds[:1], beside, found, weight)
        coloured = _best(kinds, beside, found, weight)
        other = coloured if coloured.deviance * MISFIT + COLOURED < other.deviance else other
        if flicker.deviance < min(best.deviance, other.deviance + PAYS):
            best = flicker
        elif other.deviance + PAYS < best.deviance:
            best = other
    sigma2 = max(best.own + best.carried, 1e-300)
    share = best.carried / sigma2
    poles = tuple((share * part, phi) for part, phi in best.poles)
    return ForceNoise(float(np.sqrt(sigma2)), Colour(poles if share > 0.02 else ()), True)


@dataclass(frozen=True)
class _Kind:
    """Noise of a colour: its poles; by level, the squares of white noise (levels,) and of unit noise of the poles."""

    poles: Poles
    columns: list[Array]


@dataclass(frozen=True)
class _Told:
    """How well a kind does, and its white and coloured power."""

    deviance: float
    poles: Poles
    own: float
    carried: float


def _pole(memory_s: float, sample_s: float) -> Poles:
    return ((1.0, float(np.exp(-sample_s / memory_s))),)


def _flicker(longest_s: float, sample_s: float, plain: Array, tail: Callable[[float], Array]) -> _Kind:
    """Noise of as much power in each octave, as amplifiers and bridges fed by direct current have: poles that are
    evenly spread, from the longest memory to that of a sample (A. van der Ziel, Physica 16, 1950, 359–372)."""
    count = max(int(np.log(2.0 * longest_s / sample_s) / np.log(OCTAVES)) + 1, 1)
    memories = [longest_s / OCTAVES**k for k in range(count)]
    poles = tuple((1.0 / count, float(np.exp(-sample_s / memory))) for memory in memories)
    return _Kind(poles, [plain, np.mean([tail(memory) for memory in memories], axis=0)])


def _best(kinds: list[_Kind], beside: list[Array], found: Array, weight: Array) -> _Told:
    """The noise that does best with what is beside."""
    out = _Told(np.inf, (), 0.0, 0.0)
    for kind in kinds:
        amounts, deviance = likeliest(np.stack([*kind.columns, *beside], axis=1), found, weight)
        deviance += COLOURED * (len(kind.columns) - 1)
        if deviance < out.deviance:
            out = _Told(deviance, kind.poles, float(amounts[0]), float(amounts[1]) if kind.poles else 0.0)
    return out


def _from_motion(y: Array) -> float:
    """Without holds: scatter about parabolas over nine samples."""
    n = len(y) // 9
    if n < 2:
        return float(np.std(np.diff(y)) / np.sqrt(2)) if len(y) > 2 else 0.0
    t = np.linspace(-1, 1, 9)
    A = np.stack([np.ones(9), t, t * t], axis=1)
    windows = y[: 9 * n].reshape(n, 9)
    error = windows - windows @ (A @ np.linalg.pinv(A)).T
    return float(np.sqrt(np.median(np.sum(error**2, axis=1)) / 5.348))
