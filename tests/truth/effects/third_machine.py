"""Third shapes of what lies between the motor and the pad.

Sources: joints after Hertz (1882), ball contacts under preload among them, and joints that close (Bickford, bolted
joints); screws worn where they are used; the wind-up of a shaft before its play is through (Nordin and Gutman 2002);
asperities of exponential height (Greenwood and Williamson 1966); friction that differs by direction (Armstrong-Hélouvry
1991), after Bouc (1967) and Wen (1976), of seals that the load presses on, and of rubber lips that relax at rest
(Müller and Nau, Fluid Sealing Technology); the share of a cable chain that moves; slotting and the hysteresis of iron
in linear motors (Gieras, Linear Synchronous Motors); sub-divisional error of sine and cosine scales (Heydemann 1981).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.signal import sawtooth

from ..laws import Law, _Tabulated
from .registry import Build, more_shapes, spread


@more_shapes("frame_compliance", "joint_closes")
def joint_closes(build: Build, shape: str, size: float) -> dict[str, float]:
    """Soft until a joint has closed, stiffer beyond; stated is the secant at 0.6 of the greatest force."""
    compliance = size * spread(build.rng, 0.005, 0.02)
    closes, soft = float(build.rng.uniform(0.1, 0.3)) * build.force_N, float(build.rng.uniform(1.8, 3.0))
    at = 0.6 * build.force_N
    beyond = compliance * at / (at + (soft - 1) * closes)
    told = {"frame_form": 3, "frame_mm_N": beyond, "frame_force_N": closes, "frame_stiff_share": soft}
    build.plant.numbers.update(told)
    return {"compliance": compliance}


@more_shapes("frame_compliance", "hertz_joint")
def hertz_joint(build: Build, shape: str, size: float) -> dict[str, float]:
    """Balls under a small preload: d = (3/2) C F_0 ((1 + F/F_0)^{2/3} − 1); the secant at 0.6 of the greatest force."""
    compliance = size * spread(build.rng, 0.005, 0.02)
    preload, at = float(build.rng.uniform(0.03, 0.12)) * build.force_N, 0.6 * build.force_N
    first = compliance * at / (1.5 * preload * ((1 + at / preload) ** (2 / 3) - 1))
    build.plant.numbers.update(frame_form=4, frame_mm_N=first, frame_force_N=preload)
    return {"compliance": compliance}


@njit(cache=True)
def _worn(x, gap):
    """Behind a play whose width `gap` goes with the place."""
    y = x.copy()
    for k in range(1, x.shape[0]):
        y[k] = min(max(y[k - 1], x[k]), x[k] + gap[k])
    return y


@more_shapes("backlash", "worn")
def worn(build: Build, shape: str, size: float) -> dict[str, float]:
    """Wider where the screw is used most, by up to 40 %; stated: its mean over the depths."""
    gap, more = 0.02 * size * spread(build.rng, 0.7, 1.4), float(build.rng.uniform(0.2, 0.4))
    depth = build.depth_mm

    def width(x):
        # Over the depths the cosine has no mean.
        return gap * (1 + more * np.cos(2 * np.pi * np.clip(x / depth - 0.5, -0.5, 0.5)))

    build.plant.play.append(lambda t, x: _worn(x, width(x)))
    return {"gap": gap}


@njit(cache=True)
def _winds_up(x, gap, length):
    """Behind a play that is gone through ever more slowly: in each direction d(lost)/dx = (end − lost)/length."""
    y, lost = x.copy(), 0.0
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        end = 0.0 if dx > 0 else gap
        lost = end + (lost - end) * np.exp(-abs(dx) / length)
        y[k] = x[k] + lost
    return y


@more_shapes("backlash", "wind_up")
def wind_up(build: Build, shape: str, size: float) -> dict[str, float]:
    """The shaft winds up before it turns: after each reversal the play comes as 1 − e^{−s/ℓ}, ℓ half a gap or more."""
    gap = 0.02 * size * spread(build.rng, 0.7, 1.4)
    length = gap * float(build.rng.uniform(0.5, 1.0))
    build.plant.play.append(lambda t, x: _winds_up(x, gap, length))
    return {"gap": gap}


@dataclass(frozen=True)
class Asperities(_Tabulated):
    """The mean of a law over tips of exponential height, density e^{−z/σ}, the highest 4 σ above the plane z = 0.

    The first is met at depth 0, the mean plane (1 − 5 e^{−4})/(1 − e^{−4}) σ above z = 0.
    """

    name: ClassVar[str] = "asperities"
    law: Law
    deviation: float

    @property
    def mean_mm(self) -> float:
        """Depth of the mean height below the highest tip."""
        return self.deviation * (4 - (1 - 5 * np.exp(-4.0)) / (1 - np.exp(-4.0)))

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        nodes, weights = np.polynomial.legendre.leggauss(24)
        heights = 2 * (nodes + 1)
        weights = weights * np.exp(-heights)
        weights = weights / weights.sum()
        parts = [w * self.law.force(depth - self.deviation * (4 - h)) for h, w in zip(heights, weights, strict=True)]
        return np.sum(parts, axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"deviation": self.deviation}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "asperities")
def asperities(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere and bears tips of exponential height, σ up to 15 µm; stated: the mean height."""
    offset = float(build.rng.choice([-1.0, 1.0])) * 0.05 * size * spread(build.rng, 0.7, 1.4)
    law = Asperities(build.plant.pad.law, min(0.12 * abs(offset), 0.015))
    build.plant.pad = replace(build.plant.pad, law=law)
    build.plant.numbers["offset_mm"] = offset - law.mean_mm
    return {"offset": offset}


@njit(cache=True)
def _sliding(x, presliding, forth, back):
    """Coulomb friction in units of its mean: `forth` and `back` are its levels (n,) at each place."""
    out, z = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        z = min(max(z + (x[k] - x[k - 1]) / presliding, -back[k]), forth[k])
        out[k] = z
    return out


@more_shapes("friction", "asymmetric")
def asymmetric(build: Build, shape: str, size: float) -> dict[str, float]:
    """15 to 35 % more one way than the mean and as much less the other way; stated is the mean."""
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding = 1e-3 * spread(rng, 0.6, 1.6)
    differs = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.35))

    def act(t, x, v, a):
        return coulomb * _sliding(x, presliding, np.full(len(x), 1 + differs), np.full(len(x), 1 - differs))

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@more_shapes("friction", "loaded")
def loaded(build: Build, shape: str, size: float) -> dict[str, float]:
    """A seal or bush that the load presses on: from 0.7 to 0.8 in air to as much more at the greatest load.

    Stated is the level at half that load. The load is the elastic force at the depth.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding, goes = 1.5e-3 * spread(rng, 0.6, 1.6), float(rng.uniform(0.4, 0.6))
    law, most = build.plant.pad.law, build.force_N

    def act(t, x, v, a):
        level = 1 + goes * (np.clip(law.force(x) / most, 0.0, 1.2) - 0.5)
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _bouc_wen(x, length):
    """z' = (1 − z²) x'/ℓ while it loads, x'/ℓ while it unloads (n = 2, β = γ = ½); exact for any step."""
    out, z = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        s = (x[k] - x[k - 1]) / length
        if z * s < 0:
            if abs(s) <= abs(z):
                z, s = z + s, 0.0
            else:
                z, s = 0.0, s + z
        z = np.tanh(np.arctanh(z) + s) if abs(s) < 12 else np.copysign(1.0, s)
        z = min(max(z, -1 + 1e-12), 1 - 1e-12)
        out[k] = z
    return out


@more_shapes("friction", "bouc_wen")
def bouc_wen(build: Build, shape: str, size: float) -> dict[str, float]:
    """A smooth loop over 5 to 15 µm that is straight on the way back and bends on the way on."""
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    length = spread(rng, 0.005, 0.015)
    build.plant.felt.append(lambda t, x, v, a: coulomb * _bouc_wen(x, length))
    return {"coulomb": coulomb}


@njit(cache=True)
def _lip(x, h, presliding, stays, relaxes_s):
    """Two elements, of shares `stays` and 1 − `stays`; the deflection of the second fades."""
    out, z, w, kept = np.zeros(x.shape[0]), 0.0, 0.0, np.exp(-h / relaxes_s)
    for k in range(1, x.shape[0]):
        s = (x[k] - x[k - 1]) / presliding
        z = min(max(z + s, -1.0), 1.0)
        w = min(max(w * kept + s, -1.0), 1.0)
        out[k] = stays * z + (1 - stays) * w
    return out


@more_shapes("friction", "rubber_lip")
def rubber_lip(build: Build, shape: str, size: float) -> dict[str, float]:
    """A lip seal of rubber: at rest a fifth to two fifths of its friction fades within 0.5 to 3 s."""
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding, stays, fades_s = 4e-3 * spread(rng, 0.6, 1.6), float(rng.uniform(0.6, 0.8)), spread(rng, 0.5, 3.0)
    build.plant.felt.append(lambda t, x, v, a: coulomb * _lip(x, t[1] - t[0], presliding, stays, fades_s))
    return {"coulomb": coulomb}


@njit(cache=True)
def _gms(x, h, ends_mm, shares, static, speed_mm_s, memory_s):
    """Elements that slip at `ends_mm`, of forces `shares`; all levels follow Stribeck's curve, late by `memory_s`."""
    out, z, level = np.zeros(x.shape[0]), np.zeros(ends_mm.shape[0]), 1 + static
    kept = np.exp(-h / memory_s)
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        wanted = 1 + static * np.exp(-((dx / h / speed_mm_s) ** 2))
        level = wanted + (level - wanted) * kept
        for i in range(ends_mm.shape[0]):
            z[i] = min(max(z[i] + dx / ends_mm[i], -level), level)
            out[k] += shares[i] * z[i]
    return out


@more_shapes("friction", "gms")
def gms(build: Build, shape: str, size: float) -> dict[str, float]:
    """Generalised Maxwell slip (Al-Bender, Lampaert and Swevers 2005): weak elements that slip late, strong ones early.

    Deflections at slip from 1 to 30 µm, forces that fall as their root; 20 to 50 % more at rest, with a memory of 5
    to 20 ms. Stated is the level at speed.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    ends = np.geomspace(0.001, 0.03, 8) * spread(rng, 0.7, 1.4)
    shares = ends**-0.5 / np.sum(ends**-0.5)
    static, speed, memory_s = float(rng.uniform(0.2, 0.5)), spread(rng, 1.0, 8.0), spread(rng, 0.005, 0.02)
    build.plant.felt.append(lambda t, x, v, a: coulomb * _gms(x, t[1] - t[0], ends, shares, static, speed, memory_s))
    return {"coulomb": coulomb}


@more_shapes("inertia", "cable_chain")
def cable_chain(build: Build, shape: str, size: float) -> dict[str, float]:
    """A chain lays itself down: the mass that moves changes along the way, F = m a + m' v²/2; stated: its mean."""
    mass = size * spread(build.rng, 0.05, 0.3)
    grows, depth = float(build.rng.choice([-1.0, 1.0]) * build.rng.uniform(0.3, 0.6)), build.depth_mm

    def act(t, x, v, a):
        return 1e-3 * mass * ((1 + grows * (x / depth - 0.5)) * a + grows / depth * v**2 / 2)

    build.plant.felt.append(act)
    return {"mass": mass}


def _fundamental(wave) -> float:
    """Amplitude of the first harmonic of a wave of period 2π."""
    angle = 2 * np.pi * np.arange(4096) / 4096
    return float(2 * np.abs(np.mean(wave(angle) * np.exp(-1j * angle))))


@more_shapes("cogging", "slotted")
def slotted(build: Build, shape: str, size: float) -> dict[str, float]:
    """Teeth: a ripple with flat tops and steep sides; stated is the amplitude of its first harmonic."""
    rng = build.rng
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, steep = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(1.5, 3.0))

    def wave(angle):
        return np.tanh(steep * np.sin(angle))

    scale = amplitude / _fundamental(wave)
    build.plant.felt.append(lambda t, x, v, a: scale * wave(2 * np.pi * x / period + phase))
    return {"amplitude": amplitude, "period": period}


@njit(cache=True)
def _trails(x, width):
    """The middle of a play of full width `width` that is dragged along."""
    y = x.copy()
    for k in range(1, x.shape[0]):
        y[k] = min(max(y[k - 1], x[k] - width / 2), x[k] + width / 2)
    return y


@more_shapes("cogging", "iron")
def iron(build: Build, shape: str, size: float) -> dict[str, float]:
    """Iron remembers its field: the ripple trails behind the motion by 2 to 5 % of its period on either way."""
    rng = build.rng
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, width = float(rng.uniform(0, 2 * np.pi)), 2 * period * float(rng.uniform(0.02, 0.05))
    build.plant.felt.append(lambda t, x, v, a: amplitude * np.sin(2 * np.pi * _trails(x, width) / period + phase))
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "lissajous")
def lissajous(build: Build, shape: str, size: float) -> dict[str, float]:
    """Sine and cosine with offsets and unequal gains: the arc of their ratio, two harmonics and what follows.

    Stated is the amplitude of the first, which the offsets make; the gains differ by 0.6 to 1 times the offset.
    """
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    offset, phase, side = 2 * np.pi * amplitude / period, *rng.uniform(0, 2 * np.pi, 2)
    gain = 1 + offset * float(rng.uniform(0.6, 1.0))

    def error(x):
        angle = 2 * np.pi * x / period + phase
        ratio = gain * np.sin(angle) + offset * np.sin(side), np.cos(angle) + offset * np.cos(side)
        off = np.arctan2(*ratio) - angle
        return period / (2 * np.pi) * (off - 2 * np.pi * np.round(off / (2 * np.pi)))

    build.plant.encoder.append(lambda t, x: x + error(x))
    return {"amplitude": _fundamental(lambda angle: error(period * angle / (2 * np.pi))), "period": period}


@more_shapes("encoder_error", "interpolator")
def interpolator(build: Build, shape: str, size: float) -> dict[str, float]:
    """A table that is linear between two points of each period: a triangle that leans; stated: its first harmonic."""
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, leans = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.6, 0.8))
    scale = amplitude / _fundamental(lambda angle: sawtooth(angle, leans))
    build.plant.encoder.append(lambda t, x: x + scale * sawtooth(2 * np.pi * x / period + phase, leans))
    return {"amplitude": amplitude, "period": period}
