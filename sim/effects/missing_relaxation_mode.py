"""A missing relaxation mode: the pad relaxes on a time scale that the believed model does not have.

The mode takes its share from c_0, the part that never relaxes, as a fit with one more mode would. Where c_0 is not
enough, the believed modes give way too, in proportion: c_0 is then 0.

- `exponential`: share · e^(−rate t).
- `stretched`: share · e^(−(rate t)^β), Kohlrausch's law (G. Williams, D. C. Watts, Trans. Faraday Soc. 66, 1970,
  80–85), as ten modes. Their rates are quantiles of the one-sided stable law of which e^(−t^β) is the Laplace
  transform (V. M. Zolotarev, One-dimensional Stable Distributions, AMS, 1986), so they move smoothly with β.
- `box`: a spectrum even in the logarithm of the rate, `decades` wide, as ten modes (Y. C. Fung, Biomechanics:
  Mechanical Properties of Living Tissues, 2nd ed., Springer, 1993, chapter 7).
- `power`: a power of time in the end, share · (1 + t/τ)^(−n), 1/e at 1/rate (P. G. Nutting, J. Franklin Inst. 191,
  1921, 679–685): rates after the gamma distribution, as ten modes at its quantiles.
- `fractional`: share · E_α(−(rate t)^α) with Mittag-Leffler's function, a fractional element (R. C. Koeller, J. Appl.
  Mech. 51, 1984, 299–307). Its rates are spread as by K. S. Cole, R. H. Cole, J. Chem. Phys. 9, 1941, 341–351: ten
  modes at quantiles.
- `consolidation`: water that is pressed out of a layer, 8/π² Σ e^(−(2k+1)² rate t)/(2k+1)²: four fifths go at `rate`
  itself (K. Terzaghi, Theoretical Soil Mechanics, Wiley, 1943; M. A. Biot, J. Appl. Phys. 12, 1941, 155–164). Ten
  modes, the last of which takes what is left.
- `sphere`: what leaves a sphere by diffusion, 6/π² Σ e^(−n² rate t)/n², so that three fifths go at `rate` itself (J.
  Crank, The Mathematics of Diffusion, 2nd ed., Oxford, 1975). Ten modes, the last of which takes what is left.
- `gel`: water that leaves a gel under a sphere, 0.491 e^(−0.908 √s) + 0.509 e^(−1.679 s), 1/e of it left at 1/rate
  (Y. Z. Hu, X. Zhao, J. J. Vlassak, Z. Suo, Using indentation to characterize the poroelasticity of gels, Appl. Phys.
  Lett. 96, 2010, 121904): a stretched exponential and one mode.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sim.effects.base import Effect, Form, Parameter

if TYPE_CHECKING:
    from sim.pad import Pad

NODES = 10
_OF_A_ROOT, _ROOT, _PLAIN = 0.491, 0.908, 1.679  # Hu's fit for a sphere: share and factor of √s, factor of s
_GEL_LASTS = 0.7507262302  # of Hu's time s: when 1/e is left


_gauss = functools.lru_cache(np.polynomial.legendre.leggauss)  # nodes and weights; asked for in every step of a fit


def _with_modes(pad: Pad, shares: Sequence[float], rates: Sequence[float]) -> Pad:
    from sim.relaxation import Relaxation

    added, old = math.fsum(shares), math.fsum(pad.relaxation.shares)
    keep = 1.0 if old + added <= 1.0 or old == 0.0 else max(0.0, 1.0 - added) / old
    both = [(c * keep, nu) for c, nu in zip(pad.relaxation.shares, pad.relaxation.rates, strict=True)]
    both += zip(shares, rates, strict=True)
    both.sort(key=lambda mode: -mode[1])
    return replace(pad, relaxation=Relaxation(tuple(c for c, _ in both), tuple(nu for _, nu in both)))


def _exponential(pad: Pad, values: Mapping[str, float]) -> Pad:
    return _with_modes(pad, [values["share"]], [values["rate"]])


@functools.lru_cache(maxsize=64)
def _stretched_rates(beta: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Weights and rates of modes that add up to e^(−t^β): Gauss's nodes in the probability of the rate."""
    nodes, weights = _gauss(NODES)
    if beta >= 1.0 - 1e-9:
        return tuple(0.5 * weights), (1.0,) * NODES
    angle_nodes, angle_weights = _gauss(200)
    angle = 0.5 * math.pi * (1.0 + angle_nodes)
    log_a = (
        beta / (1.0 - beta) * np.log(np.sin(beta * angle))
        + np.log(np.sin((1.0 - beta) * angle))
        - np.log(np.sin(angle)) / (1.0 - beta)
    )
    wanted = 0.5 * (1.0 + nodes)
    low, high = np.full(NODES, -60.0), np.full(NODES, 60.0)
    for _ in range(60):  # P(rate < k) = mean of exp(−k^(−β/(1−β)) a(angle)) rises with k
        middle = 0.5 * (low + high)
        exponent = np.minimum(log_a - beta / (1.0 - beta) * middle[:, None], 600.0)
        below = np.exp(-np.exp(exponent)) @ (0.5 * angle_weights) < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return tuple(0.5 * weights), tuple(np.exp(0.5 * (low + high)))


def _stretched(pad: Pad, values: Mapping[str, float]) -> Pad:
    weights, rates = _stretched_rates(values["stretch"])
    return _with_modes(pad, [values["share"] * w for w in weights], [values["rate"] * k for k in rates])


def _box(pad: Pad, values: Mapping[str, float]) -> Pad:
    nodes, weights = _gauss(NODES)
    rates = values["rate"] * 10.0 ** (0.5 * values["decades"] * nodes)
    return _with_modes(pad, [float(values["share"] * 0.5 * w) for w in weights], [float(k) for k in rates])


@functools.lru_cache(maxsize=64)
def _gamma_rates(n: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Weights and rates of modes that add up to (1 + t/τ)^−n, 1/e at t = 1."""
    from scipy.special import gammaincinv

    nodes, weights = _gauss(NODES)
    rates = gammaincinv(n, 0.5 * (1.0 + nodes)) * math.expm1(1.0 / n)
    return tuple(0.5 * weights), tuple(float(rate) for rate in rates)


def _power(pad: Pad, values: Mapping[str, float]) -> Pad:
    weights, rates = _gamma_rates(values["power"])
    return _with_modes(pad, [values["share"] * w for w in weights], [values["rate"] * k for k in rates])


def _fractional(pad: Pad, values: Mapping[str, float]) -> Pad:
    nodes, weights = _gauss(NODES)
    order, below = values["order"], 0.5 * (1.0 + nodes)
    rates = (np.sin(math.pi * order * below) / np.sin(math.pi * order * (1.0 - below))) ** (1.0 / order)
    shares = [float(values["share"] * 0.5 * w) for w in weights]
    return _with_modes(pad, shares, [float(values["rate"] * k) for k in rates])


def _diffusion(pad: Pad, values: Mapping[str, float], first: float, step: float) -> Pad:
    """With first/π² Σ e^(−n² rate t)/n² over n = 1, 1 + step, …"""
    n = step * np.arange(NODES) + 1.0
    weights = first / (math.pi * n) ** 2
    weights[-1] += 1.0 - weights.sum()
    return _with_modes(pad, [float(values["share"] * w) for w in weights], [float(values["rate"] * k) for k in n**2])


def _consolidation(pad: Pad, values: Mapping[str, float]) -> Pad:
    return _diffusion(pad, values, first=8.0, step=2.0)


def _sphere(pad: Pad, values: Mapping[str, float]) -> Pad:
    return _diffusion(pad, values, first=6.0, step=1.0)


def _gel(pad: Pad, values: Mapping[str, float]) -> Pad:
    weights, rates = _stretched_rates(0.5)
    shares = [values["share"] * _OF_A_ROOT * w for w in weights] + [values["share"] * (1.0 - _OF_A_ROOT)]
    return _with_modes(pad, shares, [values["rate"] * _GEL_LASTS * k for k in (*(_ROOT**2 * k for k in rates), _PLAIN)])


_SHARE = Parameter(
    "share", "1", 0.0, 1.0, 0.1, "share of the force that relaxes in this way", required=True, amplitude=True
)
_RATE = Parameter(
    "rate",
    "1/s",
    1e-4,
    1e4,
    1.0,
    "how fast: 1/rate is the time to 1/e",
    required=True,
    starts=(0.01, 0.05, 0.3, 1.5, 8.0, 40.0, 200.0),
)

EFFECT = Effect(
    id="missing_relaxation_mode",
    what="The pad relaxes on a time scale that the model does not have.",
    says="{share:percent} of the force relaxes at a rate of {rate:.3g} per second, which the model lacks",
    check="fit with one more mode; hold longer for slow ones, ramp faster for fast ones",
    reference="Williams, Watts, Trans. Faraday Soc. 66, 1970, 80-85; Fung, Biomechanics, 2nd ed., 1993",
    of_motion=False,
    forms=(
        Form(name="exponential", what="one more mode", parameters=(_SHARE, _RATE), amend=_exponential),
        Form(
            name="stretched",
            what="a stretched exponential (Kohlrausch)",
            parameters=(
                _SHARE,
                _RATE,
                Parameter("stretch", "1", 0.2, 1.0, 0.5, "exponent of time", starts=(0.35, 0.6)),
            ),
            amend=_stretched,
        ),
        Form(
            name="box",
            what="evenly over a span of rates (Fung)",
            parameters=(
                _SHARE,
                _RATE,
                Parameter("decades", "1", 0.1, 6.0, 2.0, "width of the span in powers of ten", starts=(1.0, 3.0)),
            ),
            amend=_box,
        ),
        Form(
            name="power",
            what="a power of time in the end (Nutting)",
            parameters=(
                _SHARE,
                _RATE,
                Parameter("power", "1", 0.5, 10.0, 2.0, "exponent of time in the end", starts=(1.0, 2.0, 4.0)),
            ),
            sought=False,
            amend=_power,
        ),
        Form(
            name="fractional",
            what="a fractional element",
            parameters=(
                _SHARE,
                _RATE,
                Parameter("order", "1", 0.3, 0.98, 0.75, "order of the derivative", starts=(0.6, 0.85)),
            ),
            sought=False,
            amend=_fractional,
        ),
        Form(
            name="consolidation",
            what="water that is pressed out (Terzaghi)",
            parameters=(_SHARE, _RATE),
            sought=False,
            amend=_consolidation,
        ),
        Form(
            name="sphere",
            what="what leaves a sphere by diffusion",
            parameters=(_SHARE, _RATE),
            amend=_sphere,
        ),
        Form(
            name="gel",
            what="water that leaves a gel under a sphere (Hu)",
            parameters=(_SHARE, _RATE),
            sought=False,
            amend=_gel,
        ),
    ),
)
