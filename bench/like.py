"""A model held against a measurement: the measured motion, the surface where it serves the model best.

Touch-off finds the surface to some micrometres. A fit moves it within that doubt, and the number belongs to the run and
not to the model; so whoever compares a model with a run finds it again, for this model and this run.

Reported positions are noisy, and coarse in fast moves. A diagnosis runs its models on the motion as the pad felt it
(`bench.felt_motion`), a fit on the positions as they are. Both ways are tried, and the motion as felt counts where it
serves the model clearly better.

What a run took for zero (its tare) counts as zero of the model too, as in a diagnosis: friction or a bias that the load
cell felt before contact is not in its net force. The tare's own error is found again within its doubt, as the surface
is; and so is the state that a pad was in when the data begin amid its load, as in a fit and a diagnosis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from bench.diagnose.asked_again import NEAR
from bench.diagnose.channel import Faults, faults, standing_off
from bench.diagnose.data import prepare
from bench.errors import InputError
from bench.felt_motion import felt, serves
from bench.identify.noise import noise_of
from bench.identify.past import begins_inside
from bench.identify.problem import sized
from bench.readings import resolution
from bench.recording.types import Measurement
from bench.restamp import restamped
from sim.grid import union
from sim.model import Model
from sim.pad import Cascade, Past

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FARTHEST = 6.0
"""Standard deviations that a surface may be moved; as many as in a fit (`identify.surface`). And times the greatest
force, that the past may have left in a mode."""

FAR = 3.0
"""Standard deviations beyond which a surface is not where touch-off found it by chance."""

CLOSE = 1e-4
"""Standard deviations to which the best place is found."""

MOST_ZERO = 4.0
"""How far off a tare may be, in its standard deviations."""

STEPS = 20
"""To the state that a pad was in when the data begin, at the most."""


@dataclass(frozen=True)
class Likeness:
    """A model's force over a measurement's motion: `force_N` (m,) at its force stamps, all of them.

    `moved_mm`: depth added to the positions, 0 where the surface is certain. `flagged` (m,): samples that a fault of
    the force channel has made, as a diagnosis flags them. `rmse_N`: over the samples that count and are not flagged;
    `rmse_with_flagged_N`: over all that count. `rmse_as_reported_N`: as `rmse_N`, on the positions as they are.
    `begins_inside`: the pad is in contact from the first sample on, in a state that was found.
    """

    measurement: Measurement
    force_N: Array
    moved_mm: float
    rmse_N: float
    rmse_with_flagged_N: float
    flagged: Mask
    rmse_as_reported_N: float = math.nan
    begins_inside: bool = False

    @property
    def sentence(self) -> str:
        """What was left out, and what was done to the surface, for people; empty where nothing was."""
        said = []
        if self.begins_inside:
            said.append("the data begin amid the pad's load, in the state that serves the model best")
        if self.rmse_as_reported_N > self.rmse_N:
            said.append(
                f"the motion taken as the pad felt it ({self.rmse_as_reported_N:.6g} N on the positions as reported)"
            )
        left_out = int(np.count_nonzero(self.flagged & self.measurement.counted()))
        if left_out:
            several = "samples" if left_out > 1 else "sample"
            said.append(
                f"{left_out} {several} left out that the channel spoiled ({self.rmse_with_flagged_N:.6g} N with them)"
            )
        if self.measurement.surface_std_mm > 0:
            way = "lower" if self.moved_mm < 0 else "higher"
            said.append(
                f"surface taken {1e3 * abs(self.moved_mm):.2g} µm {way} than touch-off said "
                f"(its own doubt: {1e3 * self.measurement.surface_std_mm:.2g} µm)"
            )
            if abs(self.moved_mm) > FAR * self.measurement.surface_std_mm:
                said.append("so far off it stands for something else that the model gets wrong")
        return "; ".join(said)


@np.errstate(over="ignore")  # a law far too steep for the motion: whoever asked is told of that
def likeness(model: Model, measurement: Measurement) -> Likeness:
    """The model's force over the measured motion, from rest, or from the state that serves it best where the data begin
    amid the pad's load.

    Where touch-off stated a doubt, the surface is moved: the shift s with the least Σ e² + V (s/std)², V being the
    mean square error at the best s without that prior. Positions whose surface is certain (CSV) are taken as they are.
    Raises InputError for numbers that are none of a bench.
    """
    sized(measurement)
    alone = faults(measurement.force_N)
    flagged = ~alone.good
    pressed = begins_inside(measurement, float(measurement.position_mm.max()), noise_of([measurement]).position_mm)
    found = [_along(model, measurement, *path, flagged, pressed) for path in _paths(measurement)]
    best = found[-1] if serves(found[-1].rmse_N, found[0].rmse_N) else found[0]
    flagged = _spoiled(measurement, best.force_N, best.rmse_N, alone)
    judged = replace(_of(measurement, best.force_N, best.moved_mm, flagged), begins_inside=best.begins_inside)
    if best is found[0]:
        return judged
    as_reported = _of(measurement, found[0].force_N, found[0].moved_mm, flagged)
    return replace(judged, rmse_as_reported_N=as_reported.rmse_N)


def _paths(measurement: Measurement) -> Iterator[tuple[Array, Array, Array]]:
    """Stamps and positions of the motion, and stamps of the force: as reported, and as felt."""
    yield measurement.position_time_s, measurement.position_mm, measurement.force_time_s
    told = restamped(measurement)
    motion = felt(told.position_time_s, told.position_mm)
    if told is not measurement or not np.array_equal(motion.position_mm, measurement.position_mm):
        time, _ = union(motion.time_s, told.force_time_s)
        yield time, motion.at(time), told.force_time_s


def _along(
    model: Model,
    measurement: Measurement,
    time_s: Array,
    position_mm: Array,
    stamp_s: Array,
    flagged: Mask,
    pressed: bool,
) -> Likeness:
    """On one path, the surface where it serves the model best. `stamp_s` (m,): of the forces. `pressed`: whether it
    begins in the pad, in a state that is found too."""
    counted = measurement.counted() & ~flagged
    measured = measurement.force_N[counted]

    stamps_s, at = union(time_s, stamp_s)
    tared = _tared(measurement, stamps_s)
    if not tared.any():
        stamps_s, at = stamp_s, np.arange(stamp_s.size)

    def simulated(plant: Cascade, moved_mm: float = 0.0) -> Array:
        return plant.simulate_at(time_s, position_mm + moved_mm, stamps_s)

    def after(past: Past) -> Cascade:
        return Cascade(model.pad.physics(), model.cascade.effects, past)

    plant = model.cascade
    if pressed and model.pad.relaxation.rates:
        rates = tuple(model.pad.relaxation.rates)
        plant = after(_past(lambda past: simulated(after(past))[at][counted], measured, rates, float(np.ptp(time_s))))

    def force(moved_mm: float) -> Array:
        whole = simulated(plant, moved_mm)
        own = whole[at] - float(np.mean(whole[tared])) if tared.any() else whole
        return own + _zero_N(measured - own[counted], measurement.zero_std_N)

    def square(moved_mm: float) -> float:
        return float(np.sum((measured - force(moved_mm)[counted]) ** 2))

    moved_mm = 0.0
    std = measurement.surface_std_mm
    if std > 0 and measured.size:
        moved_mm = _least(square, std)
        V = square(moved_mm) / measured.size
        moved_mm = _least(lambda s: square(s) + V * (s / std) ** 2, std)
    return replace(_of(measurement, force(moved_mm), moved_mm, flagged), begins_inside=plant is not model.cascade)


def _past(simulated_N: Callable[[Past], Array], measured_N: Array, rates: tuple[float, ...], run_s: float) -> Past:
    """What modes of these rates begin with so that the force is nearest to the measured one (n,). Forces as large as
    the greatest are as likely as none, as in a diagnosis."""
    unit, V = max(float(np.abs(measured_N).max(initial=0.0)), 1e-6), 0.0

    def begun(left: Array) -> Past:
        return Past(rates, tuple((unit * left).tolist()), run_s)

    def error(left: Array) -> Array:
        return np.append(measured_N - simulated_N(begun(left)), math.sqrt(V) * left)

    left = np.zeros(len(rates))
    for _ in range(2):  # how much the doubt weighs is known once the state is
        left = least_squares(error, left, bounds=(-FARTHEST, FARTHEST), max_nfev=STEPS).x
        V = float(np.mean(error(left)[: measured_N.size] ** 2))
    return begun(left)


def _zero_N(error_N: Array, std_N: float) -> float:
    """What the force reads without load: the tare's own error, as far as the errors (n,) and its doubt say."""
    V = float(np.mean(error_N**2)) if error_N.size else 0.0
    if not (std_N > 0.0 and V > 0.0 and math.isfinite(V)):
        return 0.0
    return float(np.clip(np.sum(error_N) / (error_N.size + V / std_N**2), -MOST_ZERO * std_N, MOST_ZERO * std_N))


def _tared(measurement: Measurement, stamps_s: Array) -> Mask:
    """Of the stamps (k,), those within the tare; of all stamps, as a diagnosis has it, and not of the forces' alone."""
    if measurement.tared_s is None:
        return np.zeros(stamps_s.size, dtype=bool)
    return (stamps_s >= measurement.tared_s[0]) & (stamps_s <= measurement.tared_s[1])


def _of(measurement: Measurement, simulated_N: Array, moved_mm: float, flagged: Mask) -> Likeness:
    counted = measurement.counted()
    error = measurement.force_N - simulated_N
    rmse, with_flagged = _rms(error[counted & ~flagged]), _rms(error[counted])
    return Likeness(measurement, simulated_N, moved_mm, rmse, with_flagged, flagged)


def _rms(error: Array) -> float:
    return math.sqrt(float(np.mean(error**2))) if error.size else math.nan


def _spoiled(measurement: Measurement, simulated_N: Array, rmse_N: float, alone: Faults) -> Mask:
    """Samples (m,) that the channel made: those that show it alone, stray ones against the model where it is right
    enough, as in a diagnosis."""
    try:
        noise_N = prepare(measurement, alone.good).floor_N
    except InputError:
        return ~alone.good  # too few samples to tell
    if not rmse_N <= NEAR * noise_N:
        return ~alone.good
    faulty = alone.by_itself
    step_N = resolution(measurement.force_N)
    return faulty | standing_off(measurement.force_N - simulated_N, ~faulty, alone.outlier, step_N)


def _least(cost: Callable[[float], float], std_mm: float) -> float:
    found = minimize_scalar(
        cost, bounds=(-FARTHEST * std_mm, FARTHEST * std_mm), method="bounded", options={"xatol": CLOSE * std_mm}
    )
    return float(found.x)
