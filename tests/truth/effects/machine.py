"""Between the motor and the pad: encoder, play, frame, guide and moving mass.

Sources: series compliance of testing machines (ASTM E1012 practice; Oliver and Pharr 1992 for indenters), play and
Prandtl–Ishlinskii operators (Krasnosel'skii and Pokrovskii 1989), friction models as in `kernel`, cogging of linear
motors as a Fourier series in position, cyclic error of incremental encoders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit

from .curves import Rounded
from .registry import Build, effect, spread
from .sensor import second_order


@njit(cache=True)
def _play(x, gap):
    """Behind a play of full width `gap`; on the way in the two sides go together, as touch-off has set them."""
    y = x.copy()
    for k in range(1, x.shape[0]):
        y[k] = min(max(y[k - 1], x[k]), x[k] + gap)
    return y


@effect("backlash", "rigid", "soft_stops", "centred")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """One play, several that share the load (stops that give), or one that is centred on the reported position."""
    gap = 0.02 * size * spread(build.rng, 0.7, 1.4)
    parts = np.linspace(0.6, 1.4, 5) * gap if shape == "soft_stops" else np.array([gap])
    shift = gap / 2 if shape == "centred" else 0.0
    build.plant.play.append(lambda t, x: np.mean([_play(x, g) for g in parts], axis=0) - shift)
    return {"gap": gap}


@effect("frame_compliance", "linear", "stiffening")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """d = C F, or d = C F_0 ln(1 + F/F_0); the compliance stated is the secant at 0.6 of the greatest force."""
    compliance = size * spread(build.rng, 0.005, 0.02)
    knee, at = 0.5 * build.force_N, 0.6 * build.force_N
    told = {"frame_form": 1, "frame_mm_N": compliance, "frame_force_N": knee}
    if shape == "stiffening":
        told |= {"frame_form": 2, "frame_mm_N": compliance * at / (knee * np.log1p(at / knee))}
    build.plant.numbers.update(told)
    return {"compliance": compliance}


@effect("contact_offset", "fixed", "rounded", laws=("power",))
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere; `rounded`: a probe that is not parallel touches over a range of heights."""
    offset = float(build.rng.choice([-1.0, 1.0])) * 0.05 * size * spread(build.rng, 0.7, 1.4)
    half = min(0.3 * abs(offset), 0.05) if shape == "rounded" else 0.0
    if half:
        build.plant.pad = replace(build.plant.pad, law=Rounded(build.plant.pad.law, half))
    build.plant.numbers["offset_mm"] = offset - half
    return {"offset": offset}


@effect("friction", "coulomb", "stribeck", "dahl", "lugre", "maxwell_slip")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """Of the guide, felt by the cell; deflection before slip of about 1 µm (Coulomb) to some 10 µm (Maxwell slip)."""
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    form = ("coulomb", "stribeck", "dahl", "lugre", "maxwell_slip").index(shape) + 1
    presliding = (1e-3, 2e-3, 5e-3, 4e-3, 6e-3)[form - 1] * spread(rng, 0.6, 1.6)
    told = {"friction_form": form, "coulomb_N": coulomb, "presliding_mm": presliding}
    if shape in ("stribeck", "lugre"):
        told |= {"static_share": float(rng.uniform(0.2, 0.6)), "stribeck_mm_s": spread(rng, 1.0, 8.0)}
    if shape == "lugre":
        told |= {"bristle_Ns_mm": 2e-4 * coulomb / 0.05, "slide_Ns_mm": 2e-4 * coulomb / 0.05}
    build.plant.numbers.update(told)
    return {"coulomb": coulomb}


@effect("inertia", "rigid", "sprung")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """m a, of a mass that goes with the motor or rides on a stiff damped mount (150–300 Hz)."""
    mass = size * spread(build.rng, 0.05, 0.3)
    mount_Hz = float(build.rng.uniform(150, 300))

    def act(t, x, v, a):
        moved = second_order(t, a, mount_Hz, 0.4) if shape == "sprung" else a
        return 1e-3 * mass * moved

    build.plant.felt.append(act)
    return {"mass": mass}


def _ripple(
    rng: np.random.Generator, amplitude: float, period: float, harmonic: bool
) -> Callable[[np.ndarray], np.ndarray]:
    phase, second = rng.uniform(0, 2 * np.pi, 2)

    def ripple(x):
        angle = 2 * np.pi * x / period
        wave = np.sin(angle + phase)
        return amplitude * (wave + 0.35 * np.sin(2 * angle + second) if harmonic else wave)

    return ripple


@effect("cogging", "sine", "harmonic")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """A force periodic in position; the depth range holds 0.7 to 2 periods."""
    amplitude = 0.05 * size * spread(build.rng, 0.7, 1.6)
    period = min(float(build.rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    ripple = _ripple(build.rng, amplitude, period, shape == "harmonic")
    build.plant.felt.append(lambda t, x, v, a: ripple(x))
    return {"amplitude": amplitude, "period": period}


@effect("encoder_error", "reported", "servo", "harmonic")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """Reported minus true position; `servo`: the loop makes the reported one right and the true one wrong."""
    amplitude = 0.01 * size * spread(build.rng, 0.7, 1.4)
    period = spread(build.rng, 0.7, 1.5)
    ripple = _ripple(build.rng, amplitude, period, shape == "harmonic")
    if shape == "servo":

        def true_mm(t, x):
            y = x
            for _ in range(12):  # y + ripple(y) = x; a ripple of a tenth of its period's slope converges at once
                y = x - ripple(y)
            return y

        build.plant.motor.append(true_mm)
    build.plant.encoder.append(lambda t, x: x + ripple(x))
    return {"amplitude": amplitude, "period": period}
