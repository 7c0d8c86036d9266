"""When a cause is believed: beyond chance over everything tried, beyond a crumb, and beyond what could be measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.stats import chi2 as chi2_law

from sim.effects.base import Parameter

from .channel import FAR, Faults
from .data import Data, Prepared
from .numbers import Cause
from .refit import Fit, errors, force_at, reduced

Mask = NDArray[np.bool_]

LEVEL = 0.01  # of a false alarm over all that is tried
TRIED = 150.0  # candidates with their starts, as independent tries
CRUMB = 0.002  # of the noise power: what is smaller is no finding
EDGE = 1.01  # times a bound, within which a number is at it
BEYOND = 3.0  # standard deviations of touch-off and tare, within which neither is found wrong
MOST_LEFT, SPEAKS = 0.6, 0.01  # of what is left, and of the noise power: a cause beside a far larger one takes so much
RIVAL = 25.0  # Δχ², rescaled by what is left: less excludes no rival
FEWEST = 3  # samples at fault that are called a fault
MOSTLY = 0.8  # of the samples: a limit that so many are beyond is the force itself
FURTHER = 50.0  # Δχ² that a further cause takes at the least: less is hardly to be seen beside the first
SHARE = 0.008  # of what all causes take together: what a further cause must take at the least
EXACT = 2e-4  # the same, of one that takes most of what a far larger one leaves: no shape is so exact
SHORT = 5.0  # deviations that a sample at a ceiling reads less than the force at the least
HIGH, RIGHT = 0.8, 1.5  # of the least force of a ceiling, that is near it; deviations of what a model leaves there

SLOW, KNOTS = ("force_bias", "force_drift"), 24  # causes that are a force of time alone; and the pieces of its course


@dataclass(frozen=True)
class Evidence:
    """A step from one fit to the next: Δχ², and what the noise's colour and what is left besides make of it."""

    delta_chi2: float
    effective: float
    freedom: int
    threshold: float
    share: float
    """Of what the base leaves beyond the noise."""
    crumb: float
    """Δχ² over the number of samples."""
    of_left: float
    """Of what was left before the step, but for what is an earlier cause's of another course."""
    known: int
    """Causes found before."""

    @property
    def significant(self) -> bool:
        """More than chance."""
        return self.effective > self.threshold

    @property
    def pays(self) -> bool:
        """Significant, and large enough to speak of."""
        if not self.significant or self.crumb < CRUMB:
            return False
        if self.known == 0:
            return True
        if self.effective < FURTHER:  # no shape is exact, and a little of what one misses looks like something
            return False
        if self.share >= SHARE:
            return True
        # a small one beside a giant; but a third that is small has two inexact shapes to be the rest of
        return self.known == 1 and self.share >= EXACT and self.of_left >= MOST_LEFT and self.crumb >= SPEAKS


def threshold(freedom: int) -> float:
    """Δχ² that chance passes once in a hundred diagnoses."""
    return float(chi2_law.isf(LEVEL / TRIED, max(freedom, 1)))


def least_gain(base: Fit, memory: float, samples: float, expected: float, first: bool) -> float:
    """Δχ² that a cause must reach at the least to pay."""
    need = max(threshold(1) * memory, CRUMB * samples)
    return need if first else max(need, min(SHARE * (base.chi2 - expected), SPEAKS * samples))


def evidence_of(
    before: Fit, after: Fit, base: Fit, memory: float, samples: float, expected: float, slow: float
) -> Evidence:
    """What the step from `before` to `after` is worth; `memory`: samples that say the same as one, which χ² does not
    know of; `expected`: χ² that noise alone leaves; `slow`: share of what is left that is an earlier
    cause's, of another course.

    What is left besides, of whatever cause, counts as noise where significance is asked (Fisher's ratio of variances).
    """
    delta = before.chi2 - after.chi2
    misfit = max(after.chi2 / max(expected - after.free, 1.0), 1.0)
    freedom = max(after.free - before.free, 1)
    excess = max(base.chi2 - expected, 1e-9)
    left = max(before.chi2 - expected - slow * after.chi2, delta, 1e-9)
    return Evidence(
        delta_chi2=delta,
        effective=delta / (memory * misfit),
        freedom=freedom,
        threshold=threshold(freedom),
        share=delta / max(excess, delta),
        crumb=delta / samples,
        of_left=delta / left,
        known=len(before.structure.causes) - len(base.structure.causes),
    )


def of_slow_force(data: Data, before: Fit, after: Fit, base: Fit) -> float:
    """Share of what `after` leaves, noise and all, that a force of any slow course in time takes, where the causes
    found before are no more than that: a zero that strays or drifts seldom does so along a textbook's curve. Else 0."""
    found = before.structure.causes[len(base.structure.causes) :]
    if not found or any(cause.id not in SLOW for cause in found):
        return 0.0
    first, last = float(data.time_s[0]), float(data.time_s[-1])
    knots = np.concatenate([[first] * 3, np.linspace(first, last, KNOTS), [last] * 3])
    courses = BSpline.design_matrix(data.time_s, knots, 3).toarray()
    basis, _ = np.linalg.qr(np.stack([data.whitened(course) for course in courses.T], axis=1))
    left = errors(data, after.structure, after.x)
    taken = basis.T @ left
    return max(float(np.sum(taken**2)) - len(taken), 0.0) / max(float(np.sum(left**2)), 1e-9)


def penalty(free: int, effective: float) -> float:
    """What numbers cost, in χ² (Schwarz)."""
    return free * float(np.log(effective))


def unexplained(chi2: float, samples: float) -> float:
    """χ² beyond what noise, and the doubt about its size, may leave."""
    return max(chi2 - 1.02 * samples - 3.0 * float(np.sqrt(2.0 * samples)), 0.0)


def tempered(effective: float, share: float, ratio: float) -> float:
    """Evidence against a rival, with the doubt that a shape of its family not tried here would do better.

    `share`: of the gain that it reaches; `ratio`: what it leaves more, over what the best itself leaves unexplained. A
    rival that misses by less than the best itself does is hardly excluded, however significant the difference.
    """
    return min(effective, 1.5 + 250.0 * (1.0 - share), 6.0 * float(np.log1p(max(ratio, 0.0))))


def _inside(p: Parameter, value: float) -> bool:
    """Whether a number is clear of the bounds of what is sought."""
    if p.logarithmic:
        return EDGE * p.lower < value < p.upper / EDGE
    return p.lower < value < p.upper / EDGE


def _ends(fit: Fit, prepared: Prepared) -> bool:
    """Whether a limit shows in more than a sample or two, left out or not, or in one that no noise puts there; and not
    in nearly all of them."""
    full, at = prepared.full, prepared.at
    beyond = beyond_limit(full, fit)[at]
    if np.mean(beyond[full.weight[at] > 0]) > MOSTLY:
        return False
    if np.count_nonzero(beyond) >= FEWEST:
        return True
    unlimited = force_at(full, *reduced(fit, len(fit.structure.causes) - 1))
    short = np.abs(unlimited - full.force_N)[at][beyond] / full.total_N[at][beyond]
    return bool(np.any(short > FAR))


def believable(fit: Fit, prepared: Prepared) -> bool:
    """Whether the last cause's numbers are beyond what such data could show at all, and its own."""
    return _own(fit, prepared) and not _small(fit, prepared)


def too_small(fit: Fit, prepared: Prepared) -> bool:
    """Whether all that speaks against the last cause is that such data could not show so little: it is not named, but
    neither is it excluded."""
    return _own(fit, prepared) and _small(fit, prepared)


def _small(fit: Fit, prepared: Prepared) -> bool:
    """Whether the last cause is less than the instruments resolve."""
    cause = fit.structure.causes[-1]
    values = fit.structure.values(fit.x)[-1]
    limits = {
        "sample_s": prepared.sample_s,
        "position_noise_mm": prepared.position_noise_mm,
        "force_noise_N": prepared.noise.force_N,
    }
    doubts = {"contact_offset": ("offset", prepared.doubt_mm), "force_bias": ("bias", prepared.zero_N)}
    if cause.id in doubts:
        name, std = doubts[cause.id]
        if abs(values[name]) < BEYOND * std:
            return True
    floors = [(p.name, p.floor) for p in cause.form.parameters if p.floor is not None]
    return any(abs(values[name]) < share * limits[of] for name, (of, share) in floors)


def _own(fit: Fit, prepared: Prepared) -> bool:
    """Whether the last cause is clear of its bounds: there it is another's limit, as a wave longer than the data is, a
    pull of any reach, a mode so damped that it is a lag, or a drift that is over at once. (Another law is one at any of
    its numbers.)"""
    cause = fit.structure.causes[-1]
    values = fit.structure.values(fit.x)[-1]
    if cause.id == "saturation" and not _ends(fit, prepared):
        return False
    shortest_s = next((p.lower for p in cause.form.parameters if p.name == "time_constant"), 0.0)
    if cause.id == "force_drift" and values.get("time_constant", np.inf) <= EDGE * shortest_s:
        return False
    return cause.form.amend is not None or within_bounds(cause, values)


def within_bounds(cause: Cause, values: Mapping[str, float]) -> bool:
    """Whether the numbers that the contract asks for, but for the size, are clear of the bounds of what is sought."""
    told = [p for p in cause.form.parameters if p.required and not (p.fixed or p.amplitude)]
    return all(_inside(p, values[p.name]) for p in told)


def beyond_limit(data: Data, fit: Fit) -> Mask:
    """Where on the grid (n,) the force of a fit is more than its channel reports: what is there tells of the limit, and
    not of the pad."""
    index = next((k for k, c in enumerate(fit.structure.causes) if c.id == "saturation"), None)
    if index is None:
        return np.zeros(data.size, dtype=bool)
    limit_N = fit.structure.values(fit.x)[index]["limit"]
    unlimited, limited = force_at(data, *reduced(fit, index)), force_at(data, fit.structure, fit.x)
    # what a limit of one side alone leaves as it is tells of the pad
    return np.asarray((np.abs(unlimited) > limit_N) & (limited != unlimited))


def held_back(prepared: Prepared, fit: Fit, flags: Faults) -> Mask:
    """Of each force sample kept (m,), whether it reads less than the force where samples with as much are saturated: a
    ceiling that is not level shows by itself in some of them, and in the rest once there is a force to hold them
    against. None where the fit has a ceiling itself, or is not right about the greatest forces below it."""
    saturated, at = flags.saturated[prepared.kept], prepared.at
    none = np.zeros_like(saturated)
    if not saturated.any() or any(c.id == "saturation" for c in fit.structure.causes):
        return none
    sign = np.sign(np.mean(prepared.raw.force_N[at][saturated]))
    force = sign * force_at(prepared.raw, fit.structure, fit.x)[at]
    short = (force - sign * prepared.raw.force_N[at]) / prepared.full.total_N[at]
    least = float(np.median(sign * prepared.raw.force_N[at][saturated]))
    found = (force > least) & (short > SHORT) & ~flags.flagged[prepared.kept]
    beside = (force > HIGH * least) & (prepared.raw.weight[at] > 0) & ~found
    right = beside.any() and float(np.mean(short[beside] ** 2)) < RIGHT**2
    return found if right else none
