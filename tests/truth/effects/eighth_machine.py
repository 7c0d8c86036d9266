"""Shapes of what lies between the motor and the pad.

Sources: frames with printed parts, which creep by a power of time (Findley, Lai and Onaran 1976), and clamps that the
changes of load work loose (Bickford, bolted joints; Junker 1969); nuts that a spring holds without play (Slocum,
Precision Machine Design) and teeth that are not worn alike (ISO 1328); samples that do not lie flat (ASTM D1621,
correction of the toe); static friction over the first way of a slip (Rabinowicz 1951), friction by rate and state
(Dieterich 1979, Ruina 1983, Rice and Ben-Zion 1996) and grease that is stiff with cold (Lugt, Grease Lubrication in
Rolling Bearings); liquid that is taken along and sheared (Basset 1888, Boussinesq 1885, Landau and Lifshitz) and cells
whose mass an accelerometer corrects for (Instron, dynamic load cells); solid iron, in which fields come late
(Stoll, The Analysis of Eddy Currents), and errors of current sensors (Jahns and Soong 1996); loops that follow a wrong
scale only as quickly as they can (Ellis, Control System Design Guide) and interpolators that set their own offsets as
they move (Hagiwara, Suzuki and Murase 1992).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import gamma
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .outside_bench import _child
from .plant import simulate
from .registry import Build, more_shapes, spread
from .sensor import first_order
from .third_machine import _sliding, _worn


@njit(cache=True)
def _modes(values, h, rates, weights):
    """Σ w_i y_i of y_i' = values − ν_i y_i, from rest; values (n,) are those of the step that ends there."""
    out, y = np.zeros(values.shape[0]), np.zeros(rates.shape[0])
    kept = np.exp(-rates * h)
    gained = (1 - kept) / rates
    for k in range(values.shape[0]):
        for i in range(rates.shape[0]):
            y[i] = y[i] * kept[i] + values[k] * gained[i]
            out[k] += weights[i] * y[i]
    return out


#: Rates (1/s) a factor of 3 apart, enough for powers of time from 0.1 ms to minutes.
_RATES = 3.0 ** np.arange(-8, 10)


def _power_creep(force: np.ndarray, h: float, power: float) -> np.ndarray:
    """∫ (t − s)^n dF(s), t in s, by  t^n = n/Γ(1 − n) ∫ (1 − e^{−νt}) ν^{−n} d ln ν; what is quicker is at once."""
    weights = power / gamma(1 - power) * _RATES**-power * np.log(3.0)
    at_once = (_RATES[-1] * np.sqrt(3.0)) ** -power / gamma(1 - power)
    return at_once * force + _modes(force, h, _RATES, weights * _RATES)


def _yields(build: Build, compliance: float, given: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
    """A frame that yields by `given` (s, N) → mm: C F within each step, and what that lacks by turns with the force.

    It converges where no part of `given` is further from C F than C F itself.
    """
    build.plant.numbers.update(frame_form=1, frame_mm_N=compliance)
    within: list[np.ndarray] = []  # what it lacks so far, where a force that is felt runs the plant by itself

    def stage(t, x):
        if within:
            return x - within[-1]
        plant, lacks = build.plant, np.zeros_like(x)
        for _ in range(30):
            within.append(lacks)
            told = [(lambda _, y, lacks=lacks: y - lacks) if other is stage else other for other in plant.play]
            force = simulate(replace(plant, play=told, encoder=[], sensor=[]), float(t[1] - t[0])).cell_N
            within.pop()
            last, lacks = lacks, given(t, force) - compliance * force
            if np.max(np.abs(lacks - last)) < 1e-8:
                break
        return x - lacks

    build.plant.play.append(stage)


@more_shapes("frame_compliance", "printed", "clamp_loosens")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """Printed parts creep by a power of time, with no last value; or a clamp that each change of the load loosens.

    `printed`: d = C ((1 − s) F + s ∫ (t − s)^n dF), s of 0.2 to 0.35 and n of 0.15 to 0.3; stated is that after 1 s.
    `clamp_loosens`: from 0.8 of the compliance to 1.2, evenly with ∫ |dF|; stated is the mean.
    """
    rng, compliance = build.rng, size * spread(build.rng, 0.005, 0.02)
    share, power, loosens = float(rng.uniform(0.2, 0.35)), float(rng.uniform(0.15, 0.3)), 0.2

    def given(t, force):
        if shape == "printed":
            return compliance * ((1 - share) * force + share * _power_creep(force, t[1] - t[0], power))
        way = np.cumsum(np.abs(np.diff(force, prepend=force[0])))
        return compliance * (1 + loosens * (2 * way / max(way[-1], 1e-9) - 1)) * force

    _yields(build, compliance, given)
    return {"compliance": compliance}


@more_shapes("backlash", "sprung_nut", "teeth")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """A spring holds the halves of a nut apart until the load is more than it; or each tooth has a width of its own.

    `sprung_nut`: no play below 0.8 of the preload and all of it above 1.2, the preload 0.2 to 0.4 of the greatest load;
    stated is all of it. `teeth`: 0.3 to 0.9 mm apart, of 0.6 to 1.4 of the mean of those in use, which is stated; from
    one to the next within a tenth.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    gap, preload = 0.02 * size * spread(rng, 0.7, 1.4), float(rng.uniform(0.2, 0.4)) * most
    pitch, begins, child = spread(rng, 0.3, 0.9), float(rng.uniform(0.0, 1.0)), _child(rng)
    teeth = np.arange(-40, 41)
    used = (pitch * (teeth + begins) > -pitch) & (pitch * (teeth + begins) < build.depth_mm)
    widths = 1 + 0.4 * child.uniform(-1, 1, len(teeth))
    widths = widths / widths[used].mean()
    edges = np.ravel(pitch * (teeth[:, None] + begins + np.array([0.05, 0.95])))

    def width(x):
        if shape == "sprung_nut":
            return gap * np.clip((law.force(x) / preload - 0.8) / 0.4, 0.0, 1.0)
        return gap * np.interp(x, edges, np.repeat(widths, 2))

    build.plant.play.append(lambda t, x: _worn(x, width(x)))
    return {"gap": gap}


@dataclass(frozen=True)
class Curled(_Tabulated):
    """A sample that stands hollow: a spring of `bends` N/mm in series with the law, until it has given way by `lift`.

    It lies where the force is bends · lift; beyond, F = F(δ − lift).
    """

    name: ClassVar[str] = "curled"
    law: Law
    lift: float
    bends: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        lies, pressed = self.bends * self.lift, np.linspace(0, 1, 4001) ** 2
        force = lies * np.linspace(0, 1, 801) ** 2
        given = force / self.bends + np.interp(force, self.law.force(pressed), pressed)
        return np.where(depth < given[-1], np.interp(depth, given, force), self.law.force(depth - self.lift))

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"lift": self.lift, "bends": self.bends}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "curled")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere, and the sample is curled: up to 30 µm of air below it, gone at 1 % of the load or so.

    Stated is where the surface is once the sample lies on its base.
    """
    rng = build.rng
    offset = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.7, 1.4)
    lift, bends = min(0.5 * abs(offset), 0.03), build.force_N * float(rng.uniform(0.2, 0.5))
    build.plant.pad = replace(build.plant.pad, law=Curled(build.plant.pad.law, lift, bends))
    build.plant.numbers["offset_mm"] = offset - lift
    return {"offset": offset}


@njit(cache=True)
def _slip_weakens(x, presliding, more, length):
    """Level 1 + `more` e^{−s/ℓ}, s the way slipped since the last rest or turn."""
    out, z, slipped = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        if abs(dx) < 1e-9 or dx * z < 0:
            slipped = 0.0
        z += dx / presliding
        if abs(z) > 1 + more * np.exp(-slipped / length):
            before = slipped
            for _ in range(4):
                slipped = before + presliding * (abs(z) - 1 - more * np.exp(-slipped / length))
            z = np.copysign(1 + more * np.exp(-slipped / length), z)
        out[k] = z
    return out


@njit(cache=True)
def _rate_and_state(x, h, direct, heals, length):
    """1 + a ln(v/v_0) + b ln(v_0 θ/ℓ), v_0 of 1 mm/s, never slower than 1 µm/s; θ' = 1 − v θ/ℓ."""
    out, theta = np.zeros(x.shape[0]), length
    for k in range(1, x.shape[0]):
        v = max(abs(x[k] - x[k - 1]) / h, 1e-3)
        end = length / v
        theta = end + (theta - end) * np.exp(-h / end)
        out[k] = 1 + direct * np.log(v) + heals * np.log(theta / length)
    out[0] = out[1]
    return out


@more_shapes("friction", "slip_weakens", "rate_and_state", "cold_grease")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """More over the first way after each rest or turn; by the logarithms of speed and age; or a grease that warms.

    `slip_weakens`: 1 + f e^{−s/ℓ}, f of 0.3 to 0.8 and ℓ of 10 to 50 µm; stated is what is left. `rate_and_state`: a of
    0.01 to 0.02 and b 0.01 to 0.03 more, ℓ of 5 to 20 µm; stated is that of a steady 1 mm/s. `cold_grease`: it falls to
    0.4 to 0.6 of what it is at first, within a fifth to a half of the recording; stated is the mean over time.
    """
    rng, duration = build.rng, build.plant.duration_s
    coulomb, presliding = 0.05 * size * spread(rng, 0.7, 1.6), 1e-3 * spread(rng, 0.6, 1.6)
    more, length = float(rng.uniform(0.3, 0.8)), spread(rng, 0.01, 0.05)
    direct, weakens, ages_mm = float(rng.uniform(0.01, 0.02)), float(rng.uniform(0.01, 0.03)), spread(rng, 0.005, 0.02)
    falls, tau = float(rng.uniform(0.4, 0.6)), float(rng.uniform(0.2, 0.5))
    mean = falls + (1 - falls) * tau * -np.expm1(-1 / tau)

    def act(t, x, v, a):
        if shape == "slip_weakens":
            return coulomb * _slip_weakens(x, presliding, more, length)
        if shape == "rate_and_state":
            level = _rate_and_state(x, t[1] - t[0], direct, direct + weakens, ages_mm)
        else:
            level = (falls + (1 - falls) * np.exp(-t / (tau * duration))) / mean
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@more_shapes("inertia", "bath", "compensated")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """Liquid of a bath that the probe takes along, and more of it the longer; or what a correction has left over.

    `bath`: m (a + ∫ a e^{−(t − s)/T}/√(π τ (t − s)) ds), τ of 0.2 to 1 s, T of 0.3 to 1 s as the bath is not deep;
    stated is what comes along at once. `compensated`: the accelerometer takes off 0.35 to 0.6 of it, late by a first
    order of 2 to 6 ms; stated is what is left of a slow move.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    tau, ends_s = spread(rng, 0.2, 1.0), spread(rng, 0.3, 1.0)
    corrects, late_s = float(rng.uniform(0.35, 0.6)), spread(rng, 0.002, 0.006)

    def act(t, x, v, a):
        if shape == "bath":
            # 1/√(π t) is 1/π ∫ e^{−νt} √ν d ln ν.
            weights = np.sqrt(_RATES) * np.log(3.0) / np.pi
            history = _modes(a, t[1] - t[0], _RATES + 1 / ends_s, weights)
            return 1e-3 * mass * (a + history / np.sqrt(tau))
        return 1e-3 * mass / (1 - corrects) * (a - corrects * first_order(t, a, late_s))

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "eddy_currents", "current_sensors")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """Solid iron, whose field comes late and is less at speed; or current sensors with an offset and unequal gains.

    `eddy_currents`: e^{iθ}/(1 + i ω τ), ω = 2π v/period, τ of 3 to 10 ms; stated is that at rest. `current_sensors`:
    the offset makes a ripple at any load, the gains one of half the period that goes with it, 0.6 to 1.2 of the first
    at the greatest; stated is the first.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, other = rng.uniform(0, 2 * np.pi, 2)
    tau, share = spread(rng, 0.003, 0.01), float(rng.uniform(0.6, 1.2))

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period
        if shape == "eddy_currents":
            return amplitude * np.imag(np.exp(1j * (angle + phase)) / (1 + 2j * np.pi * tau * v / period))
        load = np.clip(law.force(x) / most, 0.0, 1.2)
        return amplitude * (np.sin(angle + phase) + share * load * np.sin(2 * angle + other))

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "slow_loop", "sets_itself")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """The loop follows the wrong scale as far as it is quick enough; or the interpolator sets its offsets on the way.

    `slow_loop`: by a first order of 2 to 8 ms, so that slow moves go wrong and quick ones are reported wrong.
    `sets_itself`: towards 0.2 to 0.4 of the error at first, by e^{−way/ℓ}, ℓ 0.15 to 0.4 of all the way there is;
    stated is the mean over the way.
    """
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, loop_s = float(rng.uniform(0, 2 * np.pi)), spread(rng, 0.002, 0.008)
    stays, length = float(rng.uniform(0.2, 0.4)), float(rng.uniform(0.15, 0.4))
    mean = stays + (1 - stays) * length * -np.expm1(-1 / length)

    def ripple(x):
        return amplitude * np.sin(2 * np.pi * x / period + phase)

    def true_mm(t, x):
        y = x
        for _ in range(12):
            y = x - first_order(t, ripple(y), loop_s)
        return y

    def error(x):
        if shape == "slow_loop":
            return ripple(x)
        way = np.cumsum(np.abs(np.diff(x, prepend=x[0])))
        return ripple(x) * (stays + (1 - stays) * np.exp(-way / (length * max(way[-1], 1e-9)))) / mean

    if shape == "slow_loop":
        build.plant.motor.append(true_mm)
    build.plant.encoder.append(lambda t, x: x + error(x))
    return {"amplitude": amplitude, "period": period}
