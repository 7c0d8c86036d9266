"""Where to start what repeats with the position: every period, with the phases and harmonics that fit the residual.

For given periods a sine and a second one are linear in four numbers, so that only periods are scanned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from sim.effects.base import Form

from .numbers import Cause

Array = NDArray[np.float64]

PERIODS = 36
TURNS = 24  # parts of a period
APART = 1.2  # times the waves of one sine, that a second one has at the least: else they are one that swells
BEAT = 0.25  # of a beat over the travel: two waves with less between them are one, whatever their periods
RATIO = 2.5  # of the second sine to the first at the most, to start with

Column = Callable[[float, float], Array]
"""Change of the force (n,), in units of the noise, by a sine of amplitude 1, of a period in mm and a phase in rad,
beyond what the pad can imitate."""

Promise = tuple[float, int, int, Array]
"""(χ² that it takes, waves, waves of the second sine or 0, sizes of their sines and cosines)."""


def ripples(form: Form) -> bool:
    """Whether a form repeats with the position."""
    return {"period", "phase"} <= {p.name for p in form.parameters}


def two_periods(form: Form) -> bool:
    """Whether a form repeats in two ways, of which one has so many waves for each of the other."""
    return ripples(form) and any(p.name == "order" for p in form.parameters)


def merged(form: Form, values: Mapping[str, float], travel_mm: float) -> bool:
    """Whether two waves of a form are hardly apart, and less than a beat over the travel; or apart by a small part of a
    beat: they are one that swells, and their sizes tell of each other alone."""
    if not two_periods(form):
        return False
    beats = abs(values["order"] - 1.0) * travel_mm / values["period"]
    return beats < (1.0 if 1.0 / APART < values["order"] < APART else BEAT)


def larger_first(form: Form, values: Mapping[str, float]) -> dict[str, float] | None:
    """The same two waves with the larger for the first, whose size and period are told; None where it is, or where the
    other would then have more waves for each of it than the form allows."""
    if not two_periods(form) or values["ratio"] <= 1.0:
        return None
    limits = next(p for p in form.parameters if p.name == "order")
    if not limits.lower <= 1.0 / values["order"] <= limits.upper:
        return None
    phases = {"phase": values["second_phase"], "second_phase": values["phase"]}
    return {
        **values,
        "amplitude": values["amplitude"] * values["ratio"],
        "period": values["period"] / values["order"],
        "ratio": 1.0 / values["ratio"],
        "order": 1.0 / values["order"],
        **{name: float(np.mod(value, 2.0 * np.pi)) for name, value in phases.items()},
    }


def turned(cause: Cause) -> list[Cause]:
    """The same ripple, begun at every part of its period."""
    out = []
    for turn in np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False):
        phases = {"phase": cause.start["phase"] + turn}
        if "second_phase" in cause.start:
            phases["second_phase"] = cause.start["second_phase"] + cause.start.get("order", 2.0) * turn
        out.append(cause.with_start(**{name: float(np.mod(value, 2.0 * np.pi)) for name, value in phases.items()}))
    return out


class Waves:
    """What a sine does at every period, kept for the forms of an effect that begin with the same one. `residual` (n,):
    what such sines are to take, in units of the noise.

    It does not keep who makes the columns, who keeps it: neither would go before the other does.
    """

    def __init__(self, residual: Array) -> None:
        self.residual = residual
        self.columns: dict[tuple[float, float], Array] = {}  # by period and phase
        self.known: dict[tuple[float, tuple[tuple[int, int], ...]], list[Promise]] = {}

    def promises(self, column: Column, step: float, combined: tuple[tuple[int, int], ...]) -> list[Promise]:
        """Of pairs of waves by `step` 1/mm, the second 0 where there is none: what each promises, best first."""
        key = (step, combined)
        if key not in self.known:
            self.known[key] = self._promises(column, step, combined)
        return self.known[key]

    def _column(self, column: Column, period_mm: float, phase_rad: float) -> Array:
        key = (period_mm, phase_rad)
        if key not in self.columns:
            self.columns[key] = column(period_mm, phase_rad)
        return self.columns[key]

    def _promises(self, column: Column, step: float, combined: tuple[tuple[int, int], ...]) -> list[Promise]:
        every = sorted({wave for pair in combined for wave in pair if wave})
        pairs = {k: [self._column(column, 1.0 / (k * step), phase) for phase in (0.0, 0.5 * math.pi)] for k in every}
        at = {k: (2 * i, 2 * i + 1) for i, k in enumerate(pairs)}
        columns = np.stack([wave for pair in pairs.values() for wave in pair], axis=1)
        norm = np.linalg.norm(columns, axis=0)
        usable = np.isfinite(norm) & (norm > 1e-9)
        columns = np.where(usable, columns, 0.0)
        gram, along = columns.T @ columns, np.sum(columns * self.residual[:, None], axis=0)
        found: list[Promise] = []
        for alone in (True, False):  # those of two numbers, and those of four
            chosen = [(k, other) for k, other in combined if (other == 0) is alone]
            of = np.array([[*at[k], *(() if alone else at[other])] for k, other in chosen], dtype=np.intp)
            if not len(of):
                continue
            inverse = np.linalg.pinv(gram[of[:, :, None], of[:, None, :]], rcond=1e-10, hermitian=True)
            sizes = np.einsum("kij,kj->ki", inverse, along[of])
            promised = np.sum(sizes * along[of], axis=1).tolist()
            found += [
                (promise, *waves, own)
                for promise, waves, own, told in zip(promised, chosen, sizes, usable[of].all(axis=1), strict=True)
                if told
            ]
        return sorted(found, key=lambda one: -one[0])


def starts(form: Form, column: Column, waves: Waves, most: int) -> Iterator[tuple[dict[str, float], float]]:
    """(values to start from, χ² that they promise to take), best first, at periods apart from each other."""
    period = next(p for p in form.parameters if p.name == "period")
    lowest, highest = 1.0 / period.upper, 1.0 / period.lower
    step = lowest / math.ceil(lowest * PERIODS / max(highest - lowest, 1e-9 * highest))
    combined = tuple(_combined(form, range(round(lowest / step), int(highest / step) + 1)))
    found = waves.promises(column, step, combined)
    firsts = {k for k, _ in combined} if two_periods(form) else set()
    taken: list[int] = []
    for promise, k, other, sizes in found:
        if other in firsts and np.hypot(*sizes[2:]) > np.hypot(*sizes[:2]):
            continue  # the greater one comes first: it is among them the other way round too
        if len(taken) < most and all(abs(k - before) > 1 for before in taken):
            taken.append(k)
            # just inside the bounds, at which an extreme period would stay
            near = min(max(1.0 / (k * step), 1.02 * period.lower), 0.98 * period.upper)
            order = {"order": other / k} if two_periods(form) else {}
            yield {"period": near, **_waves(sizes, form), **order}, promise


def _combined(form: Form, waves: range) -> list[tuple[int, int]]:
    """Waves over the longest way for each that a form may have, with those of its second sine; 0: it has none."""
    named = {p.name: p for p in form.parameters}
    if two_periods(form):
        order = named["order"]
        shorter = range(waves.start, 2 * waves.stop)
        ratios = {(k, other): other / k for k in waves for other in shorter}
        return [pair for pair, r in ratios.items() if order.lower < r < order.upper and not 1.0 / APART < r < APART]
    return [(k, 2 * k if "ratio" in named else 0) for k in waves]


def _waves(sizes: Array, form: Form) -> dict[str, float]:
    """Amplitude and phase of a sin θ + b cos θ, and ratio and phase of the second sine."""
    amplitude = float(np.hypot(sizes[0], sizes[1]))
    out = {"amplitude": amplitude, "phase": float(np.arctan2(sizes[1], sizes[0]))}
    if len(sizes) > 2:
        most = next(min(RATIO, 0.9 * p.upper) for p in form.parameters if p.name == "ratio")
        ratio = float(np.hypot(sizes[2], sizes[3])) / max(amplitude, 1e-300)
        out |= {"ratio": min(ratio, most), "second_phase": float(np.arctan2(sizes[3], sizes[2]))}
    return out
