"""Random pads, their fits by the default estimator, and what the errors of many such fits amount to."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from unittest.mock import patch

import numpy as np

from bench.identify import continuous, fit, problem
from bench.recording.types import Measurement
from tests.truth import draw
from tests.truth.motion import Motion, staircase
from tests.truth.noise import Coloured, White
from tests.truth.pad import Pad, simulate

TOLD = 0.2  # of the value: a bound above it is not pooled
STEP_S = 0.05  # of the truth's integration, at the most: the samples and the motion's corners are nodes anyway
SCREEN = 10  # every so many samples are enough to see that a pad is not wanted
RESAMPLED = 400  # sets of draws, for an interval


@dataclass(frozen=True)
class Setting:
    """What a draw is made of. `noise`: of the elastic force at depth; `modes`: r, 0 for 1 to 3 at random; `all_told`:
    only pads whose every bound is at most 20 %; `colours_s`: correlation times of the noise, 0 for white."""

    rate_hz: float
    hold_s: float
    noise: float
    modes: int = 0
    all_told: bool = False
    colours_s: tuple[float, ...] = (0.0,)
    auto: bool = False
    paths: tuple[str, ...] = ("rebuilt",)


@dataclass(frozen=True)
class Outcome:
    """One parameter of one fit, or of none (`name` empty): the fit alone. Errors in units of std and of the bound."""

    seed: int
    colour_s: float
    path: str
    right: bool
    excess: float  # V over V at the truth, minus 1
    name: str = ""
    z: float = math.nan
    over_bound: float = math.nan
    relative_bound: float = math.nan
    undetermined: bool = False


def drawn(setting: Setting, rng: np.random.Generator) -> tuple[Pad, Motion, np.ndarray, float, np.ndarray]:
    """A pad, drawn anew until it is one that the setting wants: (pad, motion, times (n,) in s, noise in N, ∂F/∂θ)."""
    for _ in range(1000):
        found = draw.pad(rng, orders=(setting.modes,) if setting.modes else (1, 2, 3))
        pad, depth, std = found.pad, found.depth_mm, setting.noise * found.force_N
        levels = (depth * np.array([0.25, 0.5, 0.75, 1.0, 0.5, 0.2])).tolist()
        motion = staircase([*levels, -0.5], 80.0, setting.hold_s, lead_s=0.5 + float(rng.uniform(0, 0.02)))
        t = np.arange(int(motion.duration_s * setting.rate_hz)) / setting.rate_hz
        few = t[::SCREEN]
        if setting.all_told:
            rough = bound_of(sensitivities(pad, motion, few), White(std / math.sqrt(SCREEN)), few)
            if np.any(rough > 1.5 * TOLD * _values(pad)):
                continue
        J = sensitivities(pad, motion, t)
        if not setting.all_told or np.all(bound_of(J, White(std), t) <= TOLD * _values(pad)):
            return pad, motion, t, std, J
    raise RuntimeError(f"no pad of a thousand is told as wanted: {setting}")


def outcomes(setting: Setting, seed: int) -> list[Outcome]:
    """One pad, and its fits."""
    rng = np.random.default_rng([seed, int(setting.rate_hz), int(1e6 * setting.noise), setting.modes])
    pad, motion, t, std, J = drawn(setting, rng)
    clean = simulate(pad, motion, t, STEP_S).force_N
    out: list[Outcome] = []
    for colour_s in setting.colours_s:
        noise = Coloured(std, colour_s) if colour_s else White(std)
        bound = bound_of(J, noise, t)
        force = clean + noise.draw(t, rng)
        for path in setting.paths:
            out += _fitted(setting, seed, pad, motion, t, force, clean, bound, colour_s, path)
    return out


def _values(pad: Pad) -> np.ndarray:
    return np.abs(list(pad.parameters().values()))


def sensitivities(pad: Pad, motion: Motion, t: np.ndarray, relative_step: float = 3e-5) -> np.ndarray:
    """∂F/∂θ (n, P) as `tests.truth.crb` has it, on fewer nodes."""
    columns = []
    for name, value in pad.parameters().items():
        h = relative_step * (abs(value) or 1.0)
        above, below = (
            simulate(pad.with_parameters({name: value + s * h}), motion, t, STEP_S).force_N for s in (1, -1)
        )
        columns.append((above - below) / (2 * h))
    return np.stack(columns, axis=1)


def bound_of(J: np.ndarray, noise: White, t: np.ndarray) -> np.ndarray:
    """Cramér and Rao's bound on each number, (P,), from ∂F/∂θ (n, P) at the times t (n,)."""
    white = noise.whiten(t, J)
    fisher = white.T @ white
    scale = np.sqrt(np.diag(fisher))
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(fisher / np.outer(scale, scale)))) / scale)


def _fitted(
    setting: Setting, seed: int, pad: Pad, motion: Motion, t: np.ndarray, force: np.ndarray, clean: np.ndarray,
    bound: np.ndarray, colour_s: float, path: str,
) -> list[Outcome]:  # fmt: skip
    degree = 3 if pad.law.name == "polynomial" else None
    asked = {} if setting.auto else {
        "law": pad.law.name, "order": len(pad.rates), "contact": pad.contact, "degree": degree
    }  # fmt: skip
    data = Measurement("draw", t, motion.position(t), t, force)
    straight = partial(_straight, problem.build)
    with patch.object(continuous, "build", straight if path == "straight" else problem.build):
        result = fit(data, **asked)  # type: ignore[arg-type]
    right = (result.law, result.order, result.degree) == (pad.law.name, len(pad.rates), degree)
    excess = result.V / float(np.mean((force - clean) ** 2)) - 1
    rows = [Outcome(seed, colour_s, path, right, excess)]
    for (name, value), least in zip(pad.parameters().items(), bound.tolist(), strict=True):
        found = result.parameters.get(name)
        if found is None:
            continue
        error = found.value - value
        z = error / found.std if found.std > 0 else math.nan
        relative = least / abs(value) if value else math.inf
        lost = name in result.undetermined
        rows.append(Outcome(seed, colour_s, path, right, excess, name, z, error / least, relative, lost))
    return rows


def _straight(build: Callable[..., problem.Problem], *args: object, **options: object) -> problem.Problem:
    return build(*args, **{**options, "between": False})


def _told(rows: Iterable[Outcome]) -> list[Outcome]:
    return [row for row in rows if row.name and row.right and row.relative_bound <= TOLD]


def held(row: Outcome) -> float:
    """Whether the interval holds the truth; a missing one holds nothing."""
    return float(abs(row.z) < 1.959964)


def coverage(rows: Sequence[Outcome]) -> tuple[float, float, float, int]:
    """Share of intervals that hold the truth, with its own 95 % interval, and how many there are."""
    return (*_pooled(_told(rows), held), len(_told(rows)))


def over_bound(rows: Sequence[Outcome]) -> tuple[float, float, float]:
    """Pooled root mean square of error over bound, with its 95 % interval."""
    middle, low, high = _pooled(_told(rows), lambda row: row.over_bound**2)
    return math.sqrt(middle), math.sqrt(low), math.sqrt(high)


def flagged(rows: Sequence[Outcome], low: float, high: float) -> tuple[int, int, float]:
    """How many whose bound is in this range are called undetermined, how many there are, and the share that a judge
    would call so who knows the bound itself exactly, but the value only with the bound's doubt: he halves the way
    from 50 to 100 %, and so flags where value + doubt is below 1.5 bounds."""
    some = [row for row in rows if row.name and low <= row.relative_bound < high]
    at_best = [0.5 * math.erfc((1 / row.relative_bound - 1.5) / math.sqrt(2)) for row in some]
    return sum(row.undetermined for row in some), len(some), float(np.mean(at_best)) if some else math.nan


def far_off(rows: Sequence[Outcome], low: float, high: float) -> tuple[str, str]:
    """Of the parameters whose bound is in this range: how many are off by more than half of their value, of those
    called undetermined, and of the others."""
    some = [row for row in rows if row.name and low <= row.relative_bound < high]
    shares = []
    for called in (True, False):
        group = [abs(row.over_bound) * row.relative_bound > 0.5 for row in some if row.undetermined == called]
        shares.append(f"{sum(group)} of {len(group)}")
    return shares[0], shares[1]


def violations(rows: Sequence[Outcome]) -> tuple[int, int, float]:
    """Fits whose V is above that of the truth, all fits, and the largest excess."""
    excess = [row.excess for row in rows if not row.name]
    return sum(e > 1e-9 for e in excess), len(excess), max([0.0, *excess])


def _pooled(rows: Sequence[Outcome], value: Callable[[Outcome], float]) -> tuple[float, float, float]:
    """Mean of a value, with its 95 % interval: whole draws are resampled, as a draw's errors hang together."""
    sums: dict[int, tuple[float, int]] = {}
    for row in rows:
        total, count = sums.get(row.seed, (0.0, 0))
        sums[row.seed] = total + value(row), count + 1
    if not sums:
        return math.nan, math.nan, math.nan
    table = np.array(list(sums.values()))
    picks = np.random.default_rng(0).integers(len(table), size=(RESAMPLED, len(table)))
    again = table[picks].sum(axis=1)
    low, high = np.quantile(again[:, 0] / again[:, 1], [0.025, 0.975])
    return float(table[:, 0].sum() / table[:, 1].sum()), float(low), float(high)
