"""Steps by force: press until a force is reached, then hold the position, or hold the force (creep)."""

from __future__ import annotations

import math

import numpy as np

from bench.errors import Stopped
from bench.run.loop import Loop, Script, Window
from bench.run.motion import Mover

HOLD_FORCE_GAIN = 0.3
"""Share of the force error that one correction takes away; the rest waits for the next, as the pad still relaxes."""

HOLD_FORCE_SAMPLES = 8
"""Force samples averaged for one correction."""

TREND_SAMPLES = 24
"""Samples of the line that tells the force now: 44 ms of a DAD 141.1, and 0.4 sigma at its end."""

CLEARLY = 4.0
"""So many sigma beyond the target, twice in a row, is beyond it without a line."""

MIN_CORRECTION_MM = 1e-3
"""Smaller corrections are lost in the encoder's resolution."""


def press(
    loop: Loop, mover: Mover, target_N: float, name: str, speed_mm_s: float, away_mm: float, noise_N: float
) -> Script[float]:
    """Move until the net force is `target_N`; returns the local stiffness there, N/mm.

    Presses deeper when the force is below the target, else backs off towards `away_mm` (motor frame). `noise_N` is
    the standard deviation of one sample in air. Raises `Stopped` where the travel ends before the force comes.
    """
    deeper = loop.last_net_N < target_N
    end = loop.monitor.envelope.deepest_mm if deeper else away_mm
    window = mover.watch()
    reached = Reached(window, target_N, deeper, noise_N)
    found = yield from mover.go_until(end, speed_mm_s, reached)
    mover.unwatch()
    if not found:
        raise Stopped(
            f"{name}: {target_N:g} N was not reached: {loop.last_net_N:.3f} N at the end of the allowed travel "
            f"({end:.2f} mm, motor frame); lower the force, or allow more depth"
        )
    stiffness = stiffness_of(window)
    loop.sink.event(
        loop.clock.now(),
        "force_reached",
        {"step": name, "target_N": target_N, "net_N": reached.force_N, "stiffness_N_mm": stiffness},
    )
    return stiffness


class Reached:
    """Whether a rising (or falling) force has come to its target: asked once for every sample of the window.

    The force now is taken from the line through the last samples. One sample alone would end a slow ramp some three
    sigma early, as it has hundreds of chances to. Two samples in a row that are clearly beyond the target count at
    once: where a force rises in less time than the line spans, the line is late.
    """

    def __init__(self, window: Window, target_N: float, rising: bool, noise_N: float) -> None:
        self.window = window
        self.target_N = target_N
        self.sign = 1.0 if rising else -1.0
        self.clear_N = CLEARLY * noise_N
        self.force_N = math.nan

    def __call__(self) -> bool:
        """Look at the newest sample."""
        force = self.window.net_N[-TREND_SAMPLES:]
        if len(force) < 2:
            return False
        time = self.window.force_time_s[-len(force) :]
        self.force_N = line_end(time, force)
        clear = all(self.sign * (sample - self.target_N) > self.clear_N for sample in force[-2:])
        settled = len(force) == TREND_SAMPLES and self.sign * (self.force_N - self.target_N) >= 0.0
        return settled or clear


def line_end(time_s: list[float], values: list[float]) -> float:
    """Value of the least-squares line through two samples or more at the last of their times."""
    n = len(values)
    mean_t, mean = sum(time_s) / n, sum(values) / n
    spread = sum((t - mean_t) ** 2 for t in time_s)
    if spread <= 0.0:
        return mean
    slope = sum((t - mean_t) * value for t, value in zip(time_s, values, strict=True)) / spread
    return mean + slope * (time_s[-1] - mean_t)


def hold_force(
    loop: Loop, mover: Mover, target_N: float, seconds: float, stiffness_N_mm: float, speed_mm_s: float
) -> Script[None]:
    """Keep the net force at the target for so long by small moves, each a share of error / stiffness."""
    until = loop.clock.now() + seconds
    while loop.clock.now() < until:
        count, total = 0, 0.0
        seen = loop.force_count
        while count < HOLD_FORCE_SAMPLES and loop.clock.now() < until:
            if loop.force_count != seen:
                seen = loop.force_count
                count += 1
                total += loop.last_net_N
            yield
        if count == 0:
            return
        error = target_N - total / count
        move = HOLD_FORCE_GAIN * error / stiffness_N_mm
        if abs(move) < MIN_CORRECTION_MM:
            continue
        goal = min(mover.here() + move, loop.monitor.envelope.deepest_mm)
        yield from mover.go(goal, speed_mm_s)


def stiffness_of(window: Window) -> float:
    """Stiffness dF/dx over the last third of the way pressed, N/mm; at least a hundredth of the mean one."""
    x = np.interp(window.force_time_s, window.motor_time_s, window.position_mm) if window.motor_time_s else np.array([])
    force = np.array(window.net_N)
    if x.size < 3 or np.ptp(x) <= 0:
        return 1.0
    last = np.abs(x - x[-1]) <= np.ptp(x) / 3.0
    mean = float(np.ptp(force) / np.ptp(x))
    if last.sum() < 3 or np.ptp(x[last]) <= 0:
        return max(mean, 1e-3)
    slope = float(np.polyfit(x[last], force[last], 1)[0])
    return max(slope, 0.01 * mean, 1e-3)
