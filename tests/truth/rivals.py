"""Whether a wrong name could do as well: the believed structure is refitted with a rival beside it, without noise.

What is left is counted as in `detect`. Where it is at most 25, the data cannot tell the rival from what was hidden. A
rival stands here in its plain shapes, so that a rival in a shape not tried here might do better yet: what is called
apart may still be alike, not the other way about. Written for what makes the force late, which is what is taken for
each other most.

What a delay has beyond its mean is chance: samples that wait in a queue, buses that are busy. No fit can know it, so
that a rival of a delay is held against a constant delay, and not against nothing left.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from .beside import drawn_again, slope
from .cases import Case
from .detect import Lab, _coordinates, _pad, _sigma, _whitened, fitted, freed, misfit, of_the_pad
from .effects.sensor import first_order, second_order

AS_GOOD = 25.0

Stage = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(even times, force, numbers) → force."""

LATE_S = (3e-4, 1e-3, 2e-3, 4e-3, 8e-3, 1.5e-2)
"""Starts of how late the force is."""


def _delayed(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.interp(t - np.exp(x[0]), t, force)


def _one_pole(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    return first_order(t, force, float(np.exp(x[0])))


def _two_poles(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    half = float(np.exp(x[0])) / 2
    return first_order(t, first_order(t, force, half), half)


def _flattest(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Second order with ζ = 1/√2, whose delay is 2 ζ/ω."""
    return second_order(t, force, float(np.sqrt(2) / np.exp(x[0]) / (2 * np.pi)), float(np.sqrt(0.5)))


def _mean(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Over the last 2 τ; before the start the force was as at the start."""
    window, off = 2 * float(np.exp(x[0])), force - force[0]
    whole = np.concatenate([[0.0], np.cumsum((off[1:] + off[:-1]) / 2 * np.diff(t))])
    return force[0] + (whole - np.interp(t - window, t, whole)) / window


def _rings(t: np.ndarray, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """2 ζ/ω late; ζ between 0.01 and 0.5, beyond which it is a lag."""
    damping = 0.01 + 0.49 / (1 + np.exp(-x[1]))
    return second_order(t, force, float(2 * damping / np.exp(x[0]) / (2 * np.pi)), float(damping))


def _gaining(t: np.ndarray, force: np.ndarray, x: np.ndarray, sign: float = 1.0) -> np.ndarray:
    """The later the longer the run lasts: x is the logarithm of how late at half of it; sign −1: the earlier."""
    return np.interp(t - sign * 2 * np.exp(x[0]) * (t - t[0]) / (t[-1] - t[0]), t, force)


CHANCE = ("force_delay",)
CLOCKED = ("force_delay", "clock_skew")
"""Effects that change when a sample was felt: beside them a rival's force would have to be asked for elsewhere."""

STAGES: dict[str, tuple[tuple[Stage, tuple[float, ...]], ...]] = {
    "force_delay": ((_delayed, ()),),
    "sensor_lag": ((_one_pole, ()), (_two_poles, ()), (_flattest, ()), (_mean, ())),
    "resonance": ((_rings, (0.0,)),),
    "clock_skew": ((_gaining, ()), (partial(_gaining, sign=-1.0), ())),
}
"""Shapes by id, and what their numbers begin with after the logarithm of how late."""


def left_beside(case: Case, id: str) -> float | None:
    """χ² that the believed structure leaves with the rival beside it, the best of its shapes; None: no rival known."""
    if id not in STAGES:
        return None
    truth = case.truth
    t, own = truth.fine.time_s, _coordinates(misfit(case).refitted)

    def force_of(stage: Stage) -> Callable[[Lab, np.ndarray], np.ndarray]:
        def force(lab: Lab, x: np.ndarray) -> np.ndarray:
            even = np.interp(t, lab.nodes, lab.along(_pad(truth.structure, x[: len(own)])))
            return np.interp(lab.nodes[lab.at], t, stage(t, even, x[len(own) :]))

        return force

    lab, best = Lab(truth), np.inf
    for stage, more in STAGES[id]:
        force, starts = force_of(stage), [np.array([*own, np.log(late), *more]) for late in LATE_S]
        start = min(starts, key=lambda x: float(np.sum((force(lab, x) - truth.clean_N) ** 2)))
        best = min(best, fitted(truth, start, force, 150)[1])
        if best <= AS_GOOD:
            break
    return best


def as_good(case: Case, id: str) -> bool:
    """Whether the rival fits the noise-free data of a case of one effect as well as what was hidden does."""
    rival, hidden = left_beside(case, id), case.truth.ids[0]
    if rival is None or rival <= AS_GOOD or hidden not in CHANCE:
        return rival is not None and rival <= AS_GOOD
    own = left_beside(case, hidden)
    return own is not None and rival <= own + AS_GOOD


def left_in_place(case: Case, rival: str, hidden: str) -> float | None:
    """χ² that a pair leaves with the rival in place of one of its two effects; None: nothing is known of that.

    The pad's numbers and the other effect's size are free to first order, as in `beside`; the rival's own wholly.
    """
    (other,) = (id for id in case.truth.ids if id != hidden)
    if rival not in STAGES or other in CLOCKED:
        return None
    both, alone = drawn_again(case, *case.truth.ids), drawn_again(case, other)
    truth, fine, lab = both.truth, alone.truth.fine, Lab(both.truth)
    sigma, label = _sigma(truth, lab), truth.label_time_s

    def weighed(force: np.ndarray) -> np.ndarray:
        return _whitened(truth.noise, label, force * truth.noise.std / sigma)

    columns = [*of_the_pad(truth, lab, weighed), weighed(slope(case, other, other))]
    own = truth.clean_N - alone.truth.clean_N

    def left(x: np.ndarray, stage: Stage) -> np.ndarray:
        late = stage(fine.time_s, fine.force_N, x) - fine.force_N
        return freed(weighed(own - np.interp(label, fine.time_s, late)), columns)

    best = np.inf
    for stage, more in STAGES[rival]:
        starts = [np.array([np.log(late), *more]) for late in LATE_S]
        start = min(starts, key=lambda x: float(np.sum(left(x, stage) ** 2)))
        best = min(best, 2 * float(least_squares(left, start, args=(stage,), method="lm", max_nfev=60).cost))
        if best <= AS_GOOD:
            break
    return best


def as_good_in_place(case: Case, rival: str, hidden: str) -> bool:
    """Whether the rival fits the noise-free data of a pair as well in place of one of its effects."""
    left = left_in_place(case, rival, hidden)
    return left is not None and left <= AS_GOOD
