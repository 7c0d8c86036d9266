"""What the believed structure lacks: another elastic law, another mode, rates that change with depth.

Sources: the stretched exponential of Kohlrausch (1854) and Williams and Watts (1970); Fung's fading of one reduced
relaxation with strain (Pryse et al. 2003; Provenzano et al. 2001 for rates that depend on strain).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares, nnls

from .. import draw
from ..laws import Exponential, Law, Power, Tanh
from .curves import Blend, Foam, MooneyRivlin, TwoSlope
from .modes import add_modes
from .registry import Build, effect, spread


def fitted(law: Law, target: Law, depth_mm: float) -> Law:
    """The numbers of `law` that come closest to another law over the depths, all positive."""
    depth = np.linspace(0.02, 1.0, 60) * depth_mm
    wanted = target.force(depth)
    names, start = list(law.parameters()), np.array(list(law.parameters().values()))

    def left(logs):
        return law.with_parameters(dict(zip(names, np.exp(logs).tolist(), strict=True))).force(depth) - wanted

    best = least_squares(left, np.log(np.maximum(start, 1e-3)), bounds=(-8, 6)).x
    return law.with_parameters(dict(zip(names, np.exp(best).tolist(), strict=True)))


def _other(rng: np.random.Generator, shape: str, depth: float, force: float) -> Law:
    if shape == "mooney_rivlin":
        law = MooneyRivlin(1.0, float(rng.uniform(0.0, 0.6)), depth / float(rng.uniform(0.35, 0.55)))
        factor = force / float(law.force(depth))
        return replace(law, first=law.first * factor, second=law.second * factor)
    if shape == "tanh":
        scale, share = depth * float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.3, 0.6))
        return Tanh(float((1 - share) * force / np.tanh(depth / scale)), scale, share * force / depth)
    if shape == "two_slope":
        law = TwoSlope(1.0, float(rng.uniform(1.0, 4.0)), depth * float(rng.uniform(0.35, 0.65)), 0.04 * depth)
        factor = force / float(law.force(depth))
        return replace(law, first=law.first * factor, more=law.more * factor)
    plateau = force * float(rng.uniform(0.3, 0.5))
    scale = depth * float(rng.uniform(0.2, 0.4))
    return Foam(plateau, scale, force - plateau * float(np.tanh(depth / scale)), depth)


def _allowed(base: Law, other: Law, share: float, depth_mm: float) -> float:
    """The share of the way from one law to the other, less if the law there would not rise everywhere."""
    depth = np.linspace(0, 1.3 * depth_mm, 400)
    first, second = np.diff(base.force(depth)), np.diff(other.force(depth))
    least = 0.2 * np.minimum(first, second)
    while share > 1 and np.any(first + share * (second - first) < least):
        share = max(0.95 * share, 1.0)
    return share


def hide_law(build: Build, name: str, other: Law, size: float, believed: Law | None = None) -> dict[str, Any]:
    """Make `other` the true law, and believe the nearest of a family: the one given, or a power or exponential."""
    believed = believed or (Power(1.0, 0.7), Exponential(1.0, 0.5))[int(build.rng.integers(2))]
    believed = fitted(believed, other, build.depth_mm)
    share = _allowed(believed, other, size, build.depth_mm)
    other = other if share == 1 else Blend(believed, other, share)
    build.plant.pad = replace(build.plant.pad, law=other)
    build.believed = replace(build.believed, law=believed)
    return {"law": name, "share_of_difference": share}


@effect("elastic_law", "catalogue", "mooney_rivlin", "tanh", "two_slope", "foam")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is another; the believed one is fitted to it. Sizes but 1 lie between (or beyond) the two."""
    rng, depth, force = build.rng, build.depth_mm, build.force_N
    if shape == "catalogue":
        name = str(rng.choice(["exponential", "power"]))
        believed = Power(1.0, 0.7) if name == "exponential" else Exponential(1.0, 0.5)
        return hide_law(build, name, draw.law(rng, name, depth, force), size, believed)
    return hide_law(build, shape, _other(rng, shape, depth, force), size)


def _stretched(beta: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of exponentials that add to e^{−(ν t)^β}, fitted over four decades."""
    t = np.geomspace(0.01, 100, 300) / rate
    rates = rate * np.geomspace(0.003, 300, 12)
    weights, _ = nnls(np.exp(-np.outer(t, rates)), np.exp(-((rate * t) ** beta)))
    kept = weights > 1e-3
    return weights[kept] / weights[kept].sum(), rates[kept]


@effect("missing_relaxation_mode", "mode", "stretched", "pair")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad relaxes by one more mode, by a stretched exponential, or by two modes close to each other."""
    rng, pad = build.rng, build.plant.pad
    share = 0.08 * size * spread(rng, 0.7, 1.4)
    known = np.log(pad.rates) if pad.rates else np.array([np.log(100.0)])
    tries = rng.uniform(np.log(0.15), np.log(40.0), 12)
    apart = np.min(np.abs(tries[:, None] - known), axis=1)
    near_enough = apart > np.log(3.0)
    rate = float(np.exp(tries[np.argmax(near_enough)] if near_enough.any() else tries[np.argmax(apart)]))
    weights, rates = np.ones(1), np.array([rate])
    if shape == "stretched":
        weights, rates = _stretched(float(rng.uniform(0.45, 0.65)), rate)
    elif shape == "pair":
        weights, rates = np.array([0.5, 0.5]), rate * np.array([1.7, 1 / 1.7])
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@effect("depth_dependent_relaxation", "linear", "exponential", "saturating")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """ν (1 + s δ), ν e^{s δ}, ν (1 + s δ/(1 + δ/4 mm)); negative slopes stop short of a standstill."""
    rng = build.rng
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope = max(slope, -0.8 / build.depth_mm)
    form = {"linear": 1, "exponential": 2, "saturating": 3}[shape]
    build.plant.numbers.update(rate_form=form, rate_per_mm=slope)
    return {"slope": slope}
