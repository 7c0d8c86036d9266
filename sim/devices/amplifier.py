"""A strain-gauge amplifier of the Flintec DAD family: converter, digital filter, zero, tare, motion detection.

Sources: docs/devices.md 3.1; DAD 141.1 Technical Manual rev. 2.5 p. 30-42 (commands, filter table, ranges), DAS 72.1
user guide p. 39 (FIR table of the same converter). The converter makes 600 values a second.

Chosen here, since no manual says it: without filter and averaging a value is converted when it is asked for (so a
line's value is as old as the line's start); the input saturates at 1.6 × capacity (the manual's ±3.2 mV/V range
with a cell of 2 mV/V). Filters start out off (FL 0), as a bench needs them; the factory setting is FL 3 (4 Hz).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from sim.axis import BenchPlant
from sim.clock import Event, SimClock
from sim.noise import GaussianNoise

CONVERSIONS_PER_S = 600.0
CUTOFF_HZ = (math.inf, 18.0, 8.0, 4.0, 3.0, 2.0, 1.0, 0.5, 0.25)
"""3 dB frequency of the IIR filter by FL, manual p. 36: second order, Gaussian; two equal poles meet its
settling times (0.1 %) within 5 %."""

FIR_TAPS = 28
"""FIR filter: 28 · FL conversions; a Blackman-Harris window meets the table's cut-off (19.7 Hz / FL), settling
(47 ms · FL) and stop band (over 90 dB beyond 80 Hz / FL). Its output rate is 600 / FL."""

FULL_RANGE = 1.6
NEWTONS = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "g": 9.80665e-3, "kg": 9.80665}


class Amplifier:
    """Forces become counts; one count is 10^-decimals of the unit that the cell is calibrated in.

    `newtons_per_unit` is signed: it carries the bench's scale and the cell's mounting. `drift_N_s` is added from
    power-up on. All counts are integers as the device shows them.
    """

    def __init__(
        self,
        clock: SimClock,
        plant: BenchPlant,
        noise: GaussianNoise,
        *,
        capacity_N: float,
        newtons_per_unit: float = 1.0,
        decimals: int | None = None,
        drift_N_s: float = 0.0,
    ) -> None:
        self.clock = clock
        self.plant = plant
        self.noise = noise
        self.drift_N_s = drift_N_s
        self.newtons_per_unit = newtons_per_unit
        self.limit_N = FULL_RANGE * capacity_N
        fullest = 1.5 * capacity_N / abs(newtons_per_unit)
        if decimals is None:
            decimals = max(0, min(3, math.floor(math.log10(999_999 / fullest))))
        self.set_decimals(decimals)
        self.max_counts = int(min(999_999, round(fullest * 10**decimals)))
        self.min_counts = -self.max_counts
        self.step = 1
        self.filter_level = 0
        self.fir = False
        self.averaging = 0
        self.no_motion_counts = 20
        self.no_motion_ms = 1000
        self.on_output: Callable[[float], None] | None = None
        self.distortions: list[Callable[[float, float], float]] = []
        """What faults make of a reading (N, time), one after the other."""
        self.zero = 0
        self.tare = 0
        self.zeroed = self.tared = False
        self.peak = self.valley = self.held = 0
        self._sampled_s = 0.0
        self._still_at = 0
        self._still_since_s = 0.0
        self._tick: Event | None = None
        self._tick_number = 0
        self._reset_filter()

    # -- settings ----------------------------------------------------------------------------------------------

    def set_decimals(self, decimals: int) -> None:
        """Decimal places of the indication."""
        self.decimals = decimals
        self._counts_per_N: float = 10**decimals / self.newtons_per_unit

    def set_filter(self, level: int | None = None, fir: bool | None = None, averaging: int | None = None) -> None:
        """Filter level (FL), mode (FM) and averaging over 2^n values (UR); starts the filter afresh."""
        self.filter_level = self.filter_level if level is None else level
        self.fir = self.fir if fir is None else fir
        self.averaging = self.averaging if averaging is None else averaging
        if self._tick is not None:
            self._tick.cancel()
            self._tick = None
        self._reset_filter()
        if self.running:
            self._tick_number = math.floor(self.clock.now() * CONVERSIONS_PER_S) + 1
            self._tick = self.clock.schedule(self._tick_number / CONVERSIONS_PER_S, self._convert)

    @property
    def running(self) -> bool:
        """Whether the converter runs by itself, at 600 a second, because a filter or average is on."""
        return self.filter_level > 0 or self.averaging > 0

    @property
    def period_s(self) -> float:
        """Time between values."""
        return self._decimation() * (1 << self.averaging) / CONVERSIONS_PER_S

    # -- readings ----------------------------------------------------------------------------------------------

    def gross(self, at_s: float) -> int:
        """Gross counts now; past `max_counts` or `min_counts` the device shows over- or under-range."""
        value = (self._raw(at_s) if self._latest is None else self._latest) * self._counts_per_N
        counts = round(value) if self.step == 1 else self.step * round(value / self.step)
        counts -= self.zero
        if abs(counts - self._still_at) > self.no_motion_counts:
            self._still_at = counts
            self._still_since_s = at_s
        if counts > self.peak:
            self.peak = counts
        elif counts < self.valley:
            self.valley = counts
        return counts

    def still(self, at_s: float) -> bool:
        """No motion: the value has stayed within the range for the time (as far as it was looked at)."""
        return at_s - self._still_since_s >= self.no_motion_ms * 1e-3

    def over_range(self, counts: int) -> int:
        """+1 over range, -1 under range, 0 within."""
        return int(counts > self.max_counts) - int(counts < self.min_counts)

    # -- zero and tare (refused while the weight moves, manual p. 38) --------------------------------------------

    def set_zero(self, at_s: float) -> bool:
        """Make the present weight the zero; False where refused."""
        counts = self.gross(at_s)
        if not self.still(at_s):
            return False
        self.zero += counts
        self.zeroed = True
        self._still_at = 0
        return True

    def set_tare(self, at_s: float) -> bool:
        """Make the present gross the tare; False where refused."""
        counts = self.gross(at_s)
        if not self.still(at_s):
            return False
        self.tare = counts
        self.tared = True
        return True

    def reset_zero(self) -> None:
        """Back to the zero of the calibration."""
        self._still_at += self.zero
        self.zero = 0
        self.zeroed = False

    def reset_tare(self) -> None:
        """No tare."""
        self.tare = 0
        self.tared = False

    # -- the converter -----------------------------------------------------------------------------------------

    def _raw(self, at_s: float) -> float:
        plant = self.plant
        plant.advance(at_s)
        sensed_N = plant.sensed_force_N(at_s) + self.drift_N_s * at_s + self.noise.draw()
        force_N = plant.plant.sample(at_s - self._sampled_s, sensed_N)
        self._sampled_s = at_s
        for distort in self.distortions:
            force_N = distort(force_N, at_s)
        return min(max(force_N, -self.limit_N), self.limit_N)

    def _decimation(self) -> int:
        return self.filter_level if self.fir and self.filter_level > 0 else 1

    def _reset_filter(self) -> None:
        self._latest: float | None = None
        self._stages: tuple[float, float] | None = None
        self._since_output = 0
        self._sum = 0.0
        self._summed = 0
        self._history: deque[float] = deque(maxlen=max(1, FIR_TAPS * self.filter_level))
        if self.fir and self.filter_level > 0:
            self._weights = _blackman_harris(FIR_TAPS * self.filter_level)
        if self.filter_level > 0:
            single_Hz = CUTOFF_HZ[self.filter_level] / math.sqrt(math.sqrt(2.0) - 1.0)
            self._gain = 1.0 - math.exp(-2.0 * math.pi * single_Hz / CONVERSIONS_PER_S)

    def _convert(self, at_s: float) -> None:
        """One conversion at the converter's own rate, through filter and average."""
        self._tick_number += 1
        self._tick = self.clock.schedule(self._tick_number / CONVERSIONS_PER_S, self._convert)
        value = self._filtered(self._raw(at_s))
        self._since_output += 1
        if self._latest is None:
            self._latest = value
        if self._since_output < self._decimation():
            return
        self._since_output = 0
        self._sum += value
        self._summed += 1
        if self._summed < 1 << self.averaging:
            return
        self._latest = self._sum / self._summed
        self._sum, self._summed = 0.0, 0
        if self.on_output is not None:
            self.on_output(at_s)

    def _filtered(self, raw: float) -> float:
        if self.filter_level == 0:
            return raw
        if self.fir:
            history = self._history
            if not history:
                history.extend([raw] * FIR_TAPS * self.filter_level)
            history.append(raw)
            if self._since_output + 1 < self._decimation():
                return raw  # not put out
            return float(np.dot(self._weights, history))
        first, second = self._stages or (raw, raw)
        first += self._gain * (raw - first)
        second += self._gain * (first - second)
        self._stages = (first, second)
        return second


def _blackman_harris(taps: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """The four-term window, scaled to a sum of 1; shape (taps,)."""
    angle = 2.0 * np.pi * (np.arange(taps) + 0.5) / taps
    window = sum(a * np.cos(k * angle) for k, a in enumerate((0.35875, -0.48829, 0.14128, -0.01168)))
    return np.asarray(window / np.sum(window), dtype=np.float64)
