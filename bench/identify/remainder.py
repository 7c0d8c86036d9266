"""What a fit leaves unexplained, in plain words: which simple pattern the residual follows.

No diagnosis: each pattern is one small regression of the residual, told by the share of the excess over the noise
that it takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._kernel import Array
from .motion import holds
from .result import FitResult, Trace

TELLING = 0.2  # a pattern that takes less of the excess is not worth a sentence
MOST = 40_000


@dataclass(frozen=True)
class Pattern:
    """`share` of the residual's power beyond the noise that the pattern takes, 0 to 1; `sentence`: what it is."""

    name: str
    share: float
    sentence: str


def patterns(result: FitResult) -> list[Pattern]:
    """All patterns, the strongest first; [] where the residual is within 1.2 times the noise floor.

    Where the model does not describe the data at all, they are sought in the measured force itself.
    """
    if result.rmse <= 1.2 * result.noise_floor:
        return []
    foreign = is_foreign(result)
    tables = [_features(t, foreign) for t in result.traces]
    left = np.concatenate([t[1] for t in tables])
    if foreign:
        left = left - left.mean()
    excess = float(np.sum(left**2)) - len(left) * result.noise_floor**2
    out = []
    for name, sentence in SENTENCES.items():
        columns = np.concatenate([t[0][name] for t in tables])
        if foreign:
            columns = columns - columns.mean(axis=0)
        span = np.linalg.norm(columns, axis=0)
        columns = columns[:, span > 1e-9 * max(span.max(initial=0.0), 1e-300)]
        if columns.shape[1] == 0 or span.max(initial=0.0) == 0:
            continue
        columns = columns / np.linalg.norm(columns, axis=0)
        solution = np.linalg.lstsq(columns, left, rcond=1e-8)[0]
        taken = float(np.sum((columns @ solution) ** 2))
        out.append(Pattern(name, float(np.clip(taken / excess, 0.0, 1.0)), sentence))
    return sorted(out, key=lambda p: -p.share)


def is_foreign(result: FitResult) -> bool:
    """Whether the model explains next to nothing of the force: what was measured is no pad pressed in."""
    return result.fit_percent < 30.0 or not result.physical


def sentence(result: FitResult) -> str:
    """One or two plain sentences on what is left, and how much it is."""
    if not patterns(result):
        ratio = result.rmse / result.noise_floor if result.noise_floor > 0 else np.inf
        return f"Nothing plain: the error is {ratio:.2g} times the noise."
    told = gist(result)
    if is_foreign(result):
        return "The model does not describe these data. Of the force's variation, " + told + "."
    ratio = result.rmse / result.noise_floor if result.noise_floor > 0 else np.inf
    return f"The error is {ratio:.2g} times the noise. Of that, {told}."


def gist(result: FitResult, most: int = 2) -> str:
    """The strongest patterns, or else where the residual is large; empty where nothing is left."""
    found = patterns(result)
    if not found:
        return ""
    told = [p for p in found if p.share >= TELLING][:most]
    return "; ".join(f"{100 * p.share:.0f} % {p.sentence}" for p in told) or _where(result)


def _where(result: FitResult) -> str:
    """Where the residual is large, when it follows no pattern."""
    power = {"corners": 0.0, "moves": 0.0, "holds": 0.0}
    samples = dict(power)
    for t in result.traces:
        counted = np.flatnonzero(t.counted)
        square = t.residual_N[counted] ** 2
        still, corner = np.zeros(len(counted), dtype=bool), np.zeros(len(counted), dtype=bool)
        corner[:CORNER] = True
        for s in holds(t.time_s[counted], t.position_mm[counted]):
            still[s] = True
            for edge in (s.start, s.stop):
                corner[max(edge - CORNER, 0) : edge + CORNER] = True
        for name, mask in (("corners", corner), ("moves", ~still & ~corner), ("holds", still & ~corner)):
            power[name] += float(square[mask].sum())
            samples[name] += float(mask.sum())
    total, count = max(sum(power.values()), 1e-300), max(sum(samples.values()), 1.0)
    for name, line in PLACES.items():
        share, part = power[name] / total, samples[name] / count
        if share >= 0.6 and share > 1.3 * part:
            return f"{100 * share:.0f} % {line.format(part=100 * part)}"
    return "nothing follows a simple pattern of motion, depth or time"


CORNER = 5  # samples on either side of where a move begins or ends

PLACES = {
    "corners": "stands where moves begin and end ({part:.0f} % of the samples): stamps of position and force that do"
    " not agree, or corners between samples",
    "moves": "lies in the moves ({part:.0f} % of the samples) and follows no simple pattern there: shaking of the"
    " drive, or a reported position that is not the true one",
    "holds": "lies in the holds ({part:.0f} % of the samples) and follows no simple pattern there",
}

SENTENCES = {
    "level": "is a constant offset of the force",
    "drift": "drifts with time, in and out of contact alike",
    "cycles": "grows or shrinks from one loading to the next (softening, conditioning or damage)",
    "direction": "changes sign with the direction of motion (hysteresis that does not fade with slowness, or friction)",
    "speed": "goes with the speed",
    "acceleration": "goes with the acceleration (mass, or a late force)",
    "depth": "is a fixed function of depth (the elastic law's shape)",
    "late": "goes with the slope of the force (clocks of force and position apart, or a lag)",
    "holds": "is a change through the holds that depends on the depth (relaxation not the same at every depth)",
}


def _features(t: Trace, foreign: bool) -> tuple[dict[str, Array], Array]:
    """Regressors of every pattern, (n, k) each, and the residual (n,) (or the force), over the samples that count."""
    counted = np.flatnonzero(t.counted)
    stride = max(1, len(counted) // MOST)
    time, depth = t.time_s[counted], t.position_mm[counted]
    model = np.zeros(len(time)) if foreign else t.simulated_N[counted]
    still = np.zeros(len(time), dtype=bool)
    since = np.zeros(len(time))
    for s in holds(time, depth):
        still[s] = True
        since[s] = time[s] - time[s.start]
    speed = np.where(still, 0.0, _slope(time, depth))
    acceleration = np.where(still, 0.0, _slope(time, speed))
    u = depth / max(float(np.abs(depth).max()), 1e-300)
    way = np.sign(speed) * (np.abs(speed) > 0.02 * np.abs(speed).max(initial=0.0))
    inside = (u > 0).astype(float)
    progress = (time - time[0]) / max(time[-1] - time[0], 1e-300) - 0.5
    edges = np.linspace(0, 1, 9)
    hats = np.stack([np.maximum(0, 1 - np.abs(u - e) * 8) for e in edges[1:]], axis=1)
    relaxing = np.log1p(since / max(float(np.median(np.diff(time))), 1e-300))
    columns = {
        "level": np.ones((len(time), 1)),
        "drift": np.stack([np.ones(len(time)), progress, progress**2], axis=1),
        "cycles": np.stack([model, model * progress, model * _loading(u)], axis=1),
        "direction": np.stack([way, way * u, way * inside], axis=1),
        "speed": np.stack([speed, speed * inside], axis=1),
        "acceleration": acceleration[:, None],
        "depth": hats,
        "late": _slope(time, model)[:, None],
        "holds": np.stack([still * relaxing * h for h in hats.T], axis=1),
    }
    error = (t.force_N if foreign else t.residual_N)[counted]
    return {k: v[::stride] for k, v in columns.items()}, error[::stride]


def _slope(time: Array, y: Array) -> Array:
    """Derivative over a few samples on either side."""
    reach = 3 if len(time) > 60 else 1
    if len(time) < 2 * reach + 1:
        return np.zeros(len(time))
    out = np.zeros(len(time))
    out[reach:-reach] = (y[2 * reach :] - y[: -2 * reach]) / (time[2 * reach :] - time[: -2 * reach])
    return out


def _loading(u: Array) -> Array:
    """Log of the number of the loading a sample belongs to (from below a third of the depth to above two)."""
    number, out, armed = 1, np.empty(len(u)), True
    for k, value in enumerate(u.tolist()):
        if armed and value > 2 / 3:
            armed = False
        elif not armed and value < 1 / 3:
            armed, number = True, number + 1
        out[k] = number
    return np.asarray(np.log(out))
