"""What ails the force channel itself, as causes: saturated, stuck and stray samples, and hum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Measurement
from sim.effects import effect

from .channel import Faults
from .data import Prepared
from .evidence import FEWEST
from .hum import Line
from .numbers import Cause, cause_of
from .refit import Fit
from .result import CauseFound, Number
from .verdict import described

Array = NDArray[np.float64]

HIDDEN = 2.0  # times as many samples stick as show one by one
UNTOLD = "; most of them cannot be told from readings that are equal by chance, and stay in"
SEEN = 2e-4  # of the samples that repeat: told, whatever they add to the error


def channel_causes(m: Measurement, prepared: Prepared, flags: Faults, before_N: Array, final: Fit) -> list[CauseFound]:
    """Each with its `gain` still in N²: the mean square that flagged samples or hum add to the error before."""
    at = prepared.at
    counted = m.counted()[prepared.kept]
    error = (prepared.raw.force_N - before_N)[at]
    n = max(int(counted.sum()), 1)
    out = []
    if final.structure.causes and final.structure.causes[-1].id == "mains_hum":
        hum = prepared.hum_N[at][counted]
        id_, form, numbers = described(final, len(final.structure.causes) - 1)
        out.append(_named(id_, form, numbers, float(np.sum(hum**2)) / n))
    masks = {"saturation": flags.saturated, "stuck_samples": flags.stuck, "outliers": flags.outlier}
    for id_, mask in masks.items():
        mask = mask[prepared.kept] & counted
        count = int(mask.sum())
        if count < FEWEST:
            continue
        if id_ == "saturation":
            numbers = {"limit": Number(float(flags.limit_N or 0.0), "N", prepared.noise.force_N / np.sqrt(count))}
        else:
            share, among = count / n, n
            if id_ == "stuck_samples" and flags.stuck_share is not None:
                share, among = flags.stuck_share, max(round(count / flags.stuck_share), 1)
            numbers = {"fraction": Number(share, "1", float(np.sqrt(share * (1 - share) / among)))}
        if id_ == "saturation":
            mask = mask | (flags.bent[prepared.kept] & counted)
        named = _named(id_, effect(id_).forms[0].name, numbers, float(np.sum(error[mask] ** 2)) / n)
        hidden = id_ == "stuck_samples" and numbers["fraction"].value > HIDDEN * count / n
        out.append(replace(named, explanation=named.explanation + UNTOLD) if hidden else named)
    return out


def joined(causes: Sequence[CauseFound], channel: Sequence[CauseFound]) -> list[CauseFound]:
    """Causes of a model in their order, and those of the channel, each before the first that takes less than it.

    A cause that both have is the model's, with what both take, in the channel's place: a model tells more of a ceiling
    than the samples do that are at it.
    """
    modelled = {c.id: c for c in causes}
    told = [replace(modelled[c.id], gain=modelled[c.id].gain + c.gain) if c.id in modelled else c for c in channel]
    ids = {c.id for c in told}
    out = [c for c in causes if c.id not in ids]
    for cause in sorted(told, key=lambda c: c.gain, reverse=True):
        at = next((k for k, other in enumerate(out) if other.gain < cause.gain), len(out))
        out.insert(at, cause)
    return out


def by_themselves(cause: CauseFound) -> bool:
    """Whether a fault of the channel shows in the samples without any model, so that it needs no gain to be told."""
    return cause.id == "stuck_samples" and cause.parameters["fraction"].value > SEEN


def _named(id_: str, form: str, numbers: Mapping[str, Number], square: float) -> CauseFound:
    cause = effect(id_)
    values = {name: number.value for name, number in numbers.items()}
    try:
        words = cause.explanation(values)
    except KeyError:
        words = cause.what
    return CauseFound(id_, form, dict(numbers), square, 0.99, [], words, cause.check)


def hum_cause(line: Line) -> Cause:
    """The effect that makes the line."""
    hum = effect("mains_hum")
    values = {"amplitude": line.amplitude_N, "frequency": line.frequency_Hz, "phase": line.phase_rad}
    third = {"ratio": line.ratio, "third_phase": line.third_phase_rad} if line.ratio > 0.0 else {}
    if line.growth_1_N != 0.0:
        own = {"growth": line.growth_1_N, "at_force": line.at_N}
        return cause_of(hum, hum.form("loaded_harmonics" if third else "loaded"), values | third | own)
    if line.swing:
        names = ("period", "swell", "swell_phase", "wander", "wander_phase")
        values |= dict(zip(names, line.swing, strict=True))
        if not (third or line.higher):
            return cause_of(hum, hum.form("swinging"), values)
    if line.bursts:
        own = dict(zip(("waves", "fed", "first"), map(float, line.bursts), strict=True))
        return cause_of(hum, hum.form("bursts"), values | own)
    if line.fires_rad:
        return cause_of(hum, hum.form("dimmed"), values | {"fires": line.fires_rad})
    if line.higher or line.swing:
        found = {3: (line.ratio, line.third_phase_rad)} | {order: (ratio, angle) for order, ratio, angle in line.higher}
        plain = "distorted" if any(order % 2 == 0 for order in found) else "flat_topped"
        form = hum.form("swinging_harmonics" if line.swing else plain)
        # behind the others stand pairs of share and phase, in the order of the harmonics
        shares = [p.name for p in form.parameters[len(values) :]]
        orders = (3, 5, 7) if form.name == "flat_topped" else range(2, 8)
        pairs = (part for order in orders for part in found.get(order, (0.0, 0.0)))
        return cause_of(hum, form, values | dict(zip(shares, pairs, strict=True)))
    if third:
        return cause_of(hum, hum.form("harmonics"), values | third)
    return cause_of(hum, hum.form("sine"), values)
