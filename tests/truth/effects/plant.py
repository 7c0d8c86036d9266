"""From the commanded motion to the force that leaves the sensor, on an even grid of fine time steps.

commanded motion → motor side (reported by the encoder) → play and frame → probe → pad → sensor. An effect adds to the
stages of a `Plant`; each stage is a list, so that effects of any origin go in. Units: mm, N, s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import cont2discrete, lfilter

from ..laws import Law
from ..motion import Motion
from ..pad import Pad
from .kernel import Numbers, run

STEP_S = 1e-4

Along = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (time, values) → values


@dataclass
class Plant:
    """The stages, in the order in which they act.

    motor: (t, commanded mm) → true motor side. encoder: (t, true mm) → reported, noise aside. play: (t, mm) → mm
    behind the play. felt: (t, motor side mm, mm/s, mm/s²) → N at the probe. height, gain, rate_factor: (t, behind mm)
    → mm that the surface lies deeper, factor of the elastic force, factor of the relaxation rates. sensor: order and
    (t, N) → N, t on an even grid. `numbers` go to the kernel. servo_s: time constant with which the motor follows its
    command, critically damped; 0: at once.
    """

    pad: Pad
    motion: Motion
    duration_s: float
    servo_s: float = 0.0
    numbers: dict[str, Any] = field(default_factory=dict)
    motor: list[Along] = field(default_factory=list)
    encoder: list[Along] = field(default_factory=list)
    play: list[Along] = field(default_factory=list)
    felt: list[Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]] = field(default_factory=list)
    height: list[Along] = field(default_factory=list)
    gain: list[Along] = field(default_factory=list)
    rate_factor: list[Along] = field(default_factory=list)
    sensor: list[tuple[int, Along]] = field(default_factory=list)


@dataclass(frozen=True)
class Fine:
    """Every step of what happened, arrays (n,)."""

    time_s: np.ndarray
    reported_mm: np.ndarray
    probe_mm: np.ndarray
    pad_N: np.ndarray
    cell_N: np.ndarray
    force_N: np.ndarray
    contact: np.ndarray

    def at(self, time_s: np.ndarray, what: str = "force_N") -> np.ndarray:
        """One of the arrays, linear between the steps."""
        return np.interp(time_s, self.time_s, getattr(self, what))


def law_table(law: Law, depth_mm: float, points: int = 4001) -> tuple[np.ndarray, float]:
    """Force (N), slope (N/mm) and energy (N mm) at even depths (points, 3), and their distance in mm."""
    depth = np.linspace(0.0, depth_mm, points)
    step, h = float(depth[1]), 1e-6
    force = law.force(depth)
    slope = (law.force(depth + h) - law.force(np.maximum(depth - h, 0.0))) / np.where(depth > 0, 2 * h, h)
    energy = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2 * step)])
    return np.stack([force, slope, energy], axis=1), step


def acceleration(motion: Motion, time_s: np.ndarray) -> np.ndarray:
    """d²δ/dt² in mm/s², from the right where it jumps; 0 outside the motion."""
    k = np.clip(np.searchsorted(motion.breaks_s, time_s, side="right") - 1, 0, len(motion.poly) - 1)
    value = 2 * motion.poly[k, 2]
    if motion.frequency_Hz.shape[1]:
        omega = 2 * np.pi * motion.frequency_Hz[k]
        tau = (time_s - motion.breaks_s[k])[:, None]
        value = value + np.sum(motion.amplitude_mm[k] * omega**2 * np.cos(omega * tau), axis=1)
    return np.where((time_s >= motion.breaks_s[0]) & (time_s < motion.breaks_s[-1]), value, 0.0)


def followed(time_s: np.ndarray, values: np.ndarray, lag_s: float) -> np.ndarray:
    """1/(τ s + 1)² of values on an even grid, linear between its points; at rest at the start."""
    if lag_s <= 0:
        return values
    told = cont2discrete(([1.0], [lag_s**2, 2 * lag_s, 1.0]), float(time_s[1] - time_s[0]), method="foh")
    return values[0] + lfilter(np.ravel(told[0]), told[1], values - values[0])


def simulate(plant: Plant, step_s: float = STEP_S) -> Fine:
    """All stages in turn, of a virgin pad at t = 0."""
    t = np.arange(int(np.ceil(plant.duration_s / step_s)) + 2) * step_s
    x = followed(t, plant.motion.position(t), plant.servo_s)
    for stage in plant.motor:
        x = stage(t, x)
    reported = x
    for stage in plant.encoder:
        reported = stage(t, reported)
    behind = x
    for stage in plant.play:
        behind = stage(t, behind)
    felt = np.zeros_like(t)
    if plant.felt:
        v = followed(t, plant.motion.velocity(t), plant.servo_s)
        a = followed(t, acceleration(plant.motion, t), plant.servo_s)
        for act in plant.felt:
            felt = felt + act(t, x, v, a)
    height, gain, rate_factor = np.zeros_like(t), np.ones_like(t), np.ones_like(t)
    for stage in plant.height:
        height = height + stage(t, behind)
    for stage in plant.gain:
        gain = gain * stage(t, behind)
    for stage in plant.rate_factor:
        rate_factor = rate_factor * stage(t, behind)

    table, table_mm = law_table(plant.pad.law, 1.1 * float(np.max(behind)) + 0.3)
    told = {"unilateral": plant.pad.contact == "unilateral"} | plant.numbers
    # Numba compiles anew for each combination of types: all are cast to those of the defaults.
    typed = {name: type(Numbers._field_defaults.get(name, 0.0))(value) for name, value in told.items()}
    numbers = Numbers(step_s=float(step_s), **typed)._replace(table_mm=table_mm)
    c, nu = np.array(plant.pad.shares), np.array(plant.pad.rates)
    cell, pad, probe, contact = run(numbers, table, c, nu, behind, felt, height, gain, rate_factor)
    force = cell
    for _, stage in sorted(plant.sensor, key=lambda pair: pair[0]):
        force = stage(t, force)
    return Fine(t, reported, probe, pad, cell, force, contact)
