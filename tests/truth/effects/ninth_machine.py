"""The ninth shapes of what lies between the motor and the pad.

Sources: J. O. Almen and A. László, The uniform-section disk spring, Trans. ASME 58 (1936) 305; D. R. Otis and A.
Pourmovahed, An algorithm for computing nonflow gas processes in gas springs and hydropneumatic accumulators, J. Dyn.
Syst. Meas. Control 107 (1985) 93; S. Dubowsky and F. Freudenstein, Dynamic analysis of mechanical systems with
clearances, J. Eng. Ind. 93 (1971) 305; A. Tustin, The effects of backlash and of speed-dependent friction on the
stability of closed-cycle control systems, J. IEE 94 (1947) 143; B. N. J. Persson, Relation between interfacial
separation and load, Phys. Rev. Lett. 99 (2007) 125502; L. Prandtl, Ein Gedankenmodell zur kinetischen Theorie der
festen Körper, ZAMM 8 (1928) 85; G. A. Tomlinson, A molecular theory of friction, Phil. Mag. 7 (1929) 905; K. A. Grosch,
The relation between the friction and visco-elastic properties of rubber, Proc. R. Soc. A 274 (1963) 21; A. R. Savkoor,
On the friction of rubber, Wear 8 (1965) 222; D. Tabor, The mechanism of rolling friction, Proc. R. Soc. A 229 (1955)
198; A. M. Wahl, Mechanical Springs (1963), surge; G. Duffing, Erzwungene Schwingungen (1918), A. H. Nayfeh and D. T.
Mook, Nonlinear Oscillations (1979); P. Colwell, Bessel functions and Kepler's equation, Am. Math. Mon. 99 (1992) 45; S.
Ruoho, E. Dlala and A. Arkkio, Comparison of demagnetization models for finite-element analysis of permanent-magnet
synchronous machines, IEEE Trans. Magn. 43 (2007) 3964; M. A. Donmez et al., A general methodology for machine tool
accuracy enhancement by error compensation, Precis. Eng. 8 (1986) 187; K. K. Tan, H. X. Zhou and T. H. Lee, New
interpolation method for quadrature encoder signals, IEEE Trans. Instrum. Meas. 51 (2002) 1073.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import erf
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.special import j1

from ..laws import Law, _Tabulated
from .eighth_machine import _yields
from .registry import Build, more_shapes, spread
from .third_machine import _fundamental, _sliding

_GAMMA = 1.4


def _flattens(load: np.ndarray, height: float) -> np.ndarray:
    """Way u of a disc spring, 1 where it is flat: load = u (r² (1 − u)(1 − u/2) + 1), r its height by its thickness.

    Beyond it is a solid ring. Pulled, it goes on as it begins.
    """
    u = np.linspace(0.0, 1.0, 8001)
    pressed = np.interp(load, u * (height**2 * (1 - u) * (1 - u / 2) + 1), u)
    return np.where(load < 0, load / (1 + height**2), pressed)


@njit(cache=True)
def _gas(pressure, h, tau):
    """Temperature of a gas by that of the room: T'/T = (1 − 1/γ) p'/p + (1/T − 1)/(γ τ)."""
    out, warm = np.ones(pressure.shape[0]), 1.0
    kept = np.exp(-h / (_GAMMA * tau))
    for k in range(1, pressure.shape[0]):
        warm *= (pressure[k] / pressure[k - 1]) ** (1 - 1 / _GAMMA)
        warm = 1 + (warm - 1) * kept
        out[k] = warm
    return out


@more_shapes("frame_compliance", "disc_spring", "gas_strut")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """Disc springs, softer the flatter, and solid once they are flat; or a strut of gas, which warms as it is pressed.

    `disc_spring`: 0.4 to 0.65 of it, beside what is linear; height by thickness 0.6 to 1, flat at 0.75 to 0.95 of the
    greatest force. `gas_strut`: (F_0 + F)(L − d) = F_0 L T, F_0 0.8 to 2 times the greatest force, and the gas gives
    its heat away within 0.3 to 2 s. Stated is the secant at 0.6 of the greatest force, of the gas as it has cooled.
    """
    rng, compliance, at = build.rng, size * spread(build.rng, 0.005, 0.02), 0.6 * build.force_N
    share, height = float(rng.uniform(0.4, 0.65)), float(rng.uniform(0.6, 1.0))
    flat, filled = (build.force_N * float(rng.uniform(*part)) for part in ((0.75, 0.95), (0.8, 2.0)))
    cools_s = spread(rng, 0.3, 2.0)

    def bends(force):
        return (1 - share) * force + share * flat * _flattens(force / flat, height)

    scale = compliance * at / float(bends(np.array(at)))

    def given(t, force):
        if shape == "disc_spring":
            return scale * bends(force)
        pressure = 1 + np.maximum(force / filled, -0.5)
        return compliance * (filled + at) * (1 - _gas(pressure, t[1] - t[0], cools_s) / pressure)

    _yields(build, compliance, given)
    return {"compliance": compliance}


@njit(cache=True)
def _coasts(x, h, gap, slows):
    """A part that is pushed by either flank, which it does not leave faster, and else slows down by dry friction."""
    y, v = x.copy(), 0.0
    for k in range(1, x.shape[0]):
        v = np.copysign(max(abs(v) - slows * h, 0.0), v)
        y[k] = y[k - 1] + v * h
        if y[k] < x[k] or y[k] > x[k] + gap:
            y[k] = min(max(y[k], x[k]), x[k] + gap)
            v = (x[k] - x[k - 1]) / h
    return y


@njit(cache=True)
def _hangs(x, gap, low, high):
    """Between two flanks, x − gap and x: it sinks to the place `low`, is lifted to `high`, and else stays."""
    y = x.copy()
    for k in range(1, x.shape[0]):
        y[k] = min(max(min(max(y[k - 1], low), high), x[k] - gap), x[k])
    return y


@more_shapes("backlash", "coasts", "hangs")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """The probe's side goes on by itself where the motor stops; or hangs in its nut, until the load has lifted it.

    `coasts`: dry friction slows it down by 200 to 800 mm/s², so that it is through the play unless it was slow.
    `hangs`: it weighs 0.2 to 0.4 of the greatest load, and its guide rubs by 0.1 to 0.25 of that; at this load the
    motor goes through the play and nothing is pressed. The load is the elastic force at the depth.
    """
    rng, law = build.rng, build.plant.pad.law
    gap, slows = 0.02 * size * spread(rng, 0.7, 1.4), spread(rng, 200.0, 800.0)
    weight, rubs = float(rng.uniform(0.2, 0.4)) * build.force_N, float(rng.uniform(0.1, 0.25))
    depth = np.linspace(0.0, build.depth_mm, 20_001)
    low, high = (float(np.interp(weight * part, law.force(depth), depth)) for part in (1 - rubs, 1 + rubs))

    def play(t, x):
        return _coasts(x, t[1] - t[0], gap, slows) if shape == "coasts" else _hangs(x, gap, low, high)

    build.plant.play.append(play)
    return {"gap": gap}


@dataclass(frozen=True)
class Matted(_Tabulated):
    """A law in series with roughness whose gap falls by the logarithm of the load: δ = δ_F + u ln(1 + F/f)."""

    name: ClassVar[str] = "matted"
    law: Law
    height: float
    first: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        pressed = max(float(np.max(depth)), 1e-9) * np.linspace(0, 1, 20_001) ** 2
        force = self.law.force(pressed)
        return np.interp(depth, pressed + self.height * np.log1p(force / self.first), force)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"height": self.height, "first": self.first}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "matted")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere and is rough on all scales, so that it closes by the logarithm of the load.

    By up to 4 µm for each e times of it above 0.3 to 1 % of the greatest, which lies 20 µm or so on; stated is the
    surface there, under the greatest force.
    """
    rng = build.rng
    offset = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.7, 1.4)
    height, first = min(0.06 * abs(offset), 0.004), build.force_N * spread(rng, 0.003, 0.01)
    build.plant.pad = replace(build.plant.pad, law=Matted(build.plant.pad.law, height, first))
    build.plant.numbers["offset_mm"] = offset - height * float(np.log1p(build.force_N / first))
    return {"offset": offset}


@njit(cache=True)
def _ribs(x, wave, soft):
    """A wiper on a spring over ribs: sin θ = (X − θ)/η, X = 2π x/λ from the start; θ goes downhill from where it is."""
    out, theta = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        place = 2 * np.pi * (x[k] - x[0]) / wave
        for _ in range(400):
            pull = place - theta - soft * np.sin(theta)
            if abs(pull) < 1e-9:
                break
            theta += pull / (1 + soft)
        out[k] = (place - theta) / soft
    return out


@njit(cache=True)
def _rolling_ring(x, presliding, way, rolls):
    """Level `rolls` while a ring has room to roll, over `way` mm in all, and 1 where it has none and slides."""
    out, z, place, level = np.zeros(x.shape[0]), 0.0, 0.5 * way, rolls
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        if abs(dx) > 1e-9:
            level = rolls if 0 < place + dx < way else 1.0
            place = min(max(place + dx, 0.0), way)
        z = min(max(z + dx / presliding, -level), level)
        out[k] = z
    return out


@more_shapes("friction", "ribs", "rubber_bell", "ring_rolls", "tared")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """A wiper that snaps from rib to rib; rubber, which rubs most at some speed; a ring that rolls before it slides; or
    dry friction that was taken for zero.

    `ribs`: 40 to 150 µm apart, the spring so soft that η is 3 to 6; stated is the mean as it slides. `rubber_bell`:
    1 + b e^{−(ln v/v_p)²/w²}, b of 0.6 to 1.5, v_p of 5 to 30 mm/s, w of 1 to 1.6; stated is the mean over the
    logarithm of speed from 1 to 100 mm/s. `ring_rolls`: over 0.1 to 0.4 mm after each turn, at 0.4 to 0.65 of what it
    takes to slide, which is stated. `tared`: the axis had come to its place one way or the other, and stood stuck when
    the force was set to zero; stated is what slides, which is on either side of what was zeroed.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    wave, soft, presliding = spread(rng, 0.04, 0.15), float(rng.uniform(3.0, 6.0)), 1.5e-3 * spread(rng, 0.6, 1.6)
    more, peak, wide = float(rng.uniform(0.6, 1.5)), spread(rng, 5.0, 30.0), float(rng.uniform(1.0, 1.6))
    way, rolls = spread(rng, 0.1, 0.4), float(rng.uniform(0.4, 0.65))
    # Over six waves, once it slides.
    slides = float(np.mean(_ribs(np.linspace(0.0, 12.0, 24_001), 1.0, soft)[12_001:]))
    bell = erf(np.log(100 / peak) / wide) - erf(np.log(1 / peak) / wide)
    mean = 1 + more * np.sqrt(np.pi) / 2 * wide * bell / np.log(100)
    came = float(rng.choice([-1.0, 1.0]))

    def act(t, x, v, a):
        if shape == "ribs":
            return coulomb / slides * _ribs(x, wave, soft)
        if shape == "ring_rolls":
            return coulomb * _rolling_ring(x, presliding, way, rolls)
        if shape == "tared":
            before = np.concatenate([x[:1] - 9 * came * presliding, x])
            force = coulomb * _sliding(before, presliding, np.ones(len(before)), np.ones(len(before)))[1:]
            return force - force[0]
        level = (1 + more * np.exp(-((np.log(np.maximum(np.abs(v), 1e-9) / peak) / wide) ** 2))) / mean
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _surges(v, h, steps, tau):
    """2 q − v of a rod with a free end: q is v less what q was a way to and fro ago, smoothed by a first order."""
    q, back, kept = v.copy(), 0.0, np.exp(-h / tau)
    for k in range(steps, v.shape[0]):
        back = q[k - steps] + (back - q[k - steps]) * kept
        q[k] = v[k] - back
    return 2 * q - v


@njit(cache=True)
def _hardens(a, h, omega, damping, way):
    """Acceleration of a mass on a mount that hardens: r'' = −a − 2 ζ ω r' − ω² r (1 + r²/ℓ²), a + r''; Runge–Kutta."""
    out, r, v, small = a.copy(), 0.0, 0.0, h / 2
    for k in range(1, a.shape[0]):
        for part in range(2):
            p1, p2, p3, p4, v1, v2, v3, v4 = 0.0, 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0
            for turn in range(4):
                s = 0.0 if turn == 0 else (1.0 if turn == 3 else 0.5)
                base = a[k - 1] + (a[k] - a[k - 1]) * (part + s) / 2
                x = r + s * small * (v1 if turn <= 1 else (v2 if turn == 2 else v3))
                u = v + s * small * (p1 if turn <= 1 else (p2 if turn == 2 else p3))
                push = -base - 2 * damping * omega * u - omega * omega * x * (1 + x * x / (way * way))
                if turn == 0:
                    p1, v1 = push, u
                elif turn == 1:
                    p2, v2 = push, u
                elif turn == 2:
                    p3, v3 = push, u
                else:
                    p4, v4 = push, u
            r += small * (v1 + 2 * v2 + 2 * v3 + v4) / 6
            v += small * (p1 + 2 * p2 + 2 * p3 + p4) / 6
        out[k] = -2 * damping * omega * v - omega * omega * r * (1 + r * r / (way * way))
    return out


@more_shapes("inertia", "surge", "hard_mount")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """A long soft spring or hose that hangs free, with waves in it; or a part on a mount that hardens.

    `surge`: Z (2 q − v), q of a wave that is back after 8 to 30 ms, the other way round, smoothed by a tenth to a
    quarter of that. `hard_mount`: half to four fifths of it, 25 to 60 Hz where it hardly swings; at the greatest
    acceleration it would go 1.5 to 3 times as far as makes its mount twice as stiff. Stated is that of slow moves.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    there_and_back, smooths = spread(rng, 0.008, 0.03), float(rng.uniform(0.1, 0.25))
    share, mount_Hz, damping = float(rng.uniform(0.5, 0.8)), spread(rng, 25.0, 60.0), spread(rng, 0.05, 0.15)
    far, omega = float(rng.uniform(1.5, 3.0)), 2 * np.pi * mount_Hz

    def act(t, x, v, a):
        h = float(t[1] - t[0])
        if shape == "surge":
            steps = max(round(there_and_back / h), 1)
            tau = smooths * steps * h
            # (1 − R)/(1 + R) is s (2T + τ)/2 at first.
            return 1e-3 * mass * 2 / (steps * h + tau) * _surges(v, h, steps, tau)
        way = max(float(np.max(np.abs(a))), 1.0) / omega**2 / far
        return 1e-3 * mass * ((1 - share) * a + share * _hardens(a, h, omega, damping, way))

    build.plant.felt.append(act)
    return {"mass": mass}


def _leans(angle: np.ndarray, give: float) -> np.ndarray:
    """Sin E of E − e sin E = angle, by Newton's method."""
    at = angle + give * np.sin(angle)
    for _ in range(6):
        at = at - (at - give * np.sin(at) - angle) / (1 - give * np.cos(at))
    return np.sin(at)


@more_shapes("cogging", "leans", "demagnetised")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """A coupling gives way to the ripple, which leans; or magnets that lose strength, for good, with the load borne.

    `leans`: F ∝ sin E, E = θ + e sin E, e of 0.4 to 0.7 either way; stated is the first harmonic. `demagnetised`: at
    first 1.5 to 2 times what is left once the greatest load has been borne, which is stated.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, lost = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.5, 1.0))
    give = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.7))
    # Sin E is 2/e Σ J_n(n e)/n sin n θ.
    scale = amplitude * give / (2 * float(j1(give)))

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period + phase
        if shape == "leans":
            return scale * _leans(angle, give)
        borne = np.maximum.accumulate(np.clip(law.force(x) / most, 0.0, 1.0))
        return amplitude * (1 + lost * (1 - borne)) * np.sin(angle)

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "old_map", "in_turn")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """A map of the error that has shifted since it was taken, at few points; or sine and cosine that are read in turn.

    `old_map`: by 0.3 to 0.6 rad, straight between five to eight points of a period; stated is the first harmonic of
    what is left. `in_turn`: an offset, which is stated, and the cosine so late that at the greatest speed it makes
    another error, of half the period, of 0.5 to 1 times that.
    """
    rng, motion = build.rng, build.plant.motion
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, shift = float(rng.uniform(0, 2 * np.pi)), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.6))
    points, late = int(rng.integers(5, 9)), float(rng.uniform(0.5, 1.0))
    quickest = float(np.max(np.abs(motion.velocity(np.arange(0.0, motion.duration_s, 1e-3)))))
    late_s, offset = late * 2 * amplitude / max(quickest, 1e-3), 2 * np.pi * amplitude / period

    def left(angle):
        place = (angle - shift) * points / (2 * np.pi)
        before, part = np.floor(place), place - np.floor(place)
        ends = (np.sin(2 * np.pi * (before + side) / points) for side in (0, 1))
        return np.sin(angle) - next(ends) * (1 - part) - next(ends) * part

    scale = amplitude / _fundamental(left)

    def error(t, x):
        angle = 2 * np.pi * x / period + phase
        if shape == "old_map":
            return scale * left(angle)
        later = angle + 2 * np.pi * late_s * np.gradient(x, t) / period
        off = np.arctan2(np.sin(angle) + offset, np.cos(later)) - angle
        return period / (2 * np.pi) * (off - 2 * np.pi * np.round(off / (2 * np.pi)))

    build.plant.encoder.append(lambda t, x: x + error(t, x))
    return {"amplitude": amplitude, "period": period}
