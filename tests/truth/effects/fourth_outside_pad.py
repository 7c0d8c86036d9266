"""The fourth shapes: effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

Like `outside_pad`, none of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _child
from .registry import Build, effect, spread


def _touches(x: np.ndarray) -> np.ndarray:
    """How many times the probe has come from air so far."""
    inside = x > 0
    return np.cumsum(inside & ~np.concatenate([[False], inside[:-1]]))


@effect("fresh_spot", "stiffness", "height")
def fresh_spot(build: Build, shape: str, size: float) -> dict[str, float]:
    """Each touch meets another spot of a pad that is not the same everywhere, as it lies loose or is turned.

    `stiffness`: as the modulus of cast foams and of tissue differs from place to place (ISO 3386). `height`: it lies
    higher or lower there.
    """
    rng = build.rng
    deviation, child = size * spread(rng, 0.8, 1.25), _child(rng)
    spots = child.uniform(-np.sqrt(3.0), np.sqrt(3.0), 1024)
    spots[:2] = 0.0  # the first touch is what the lab takes the pad for
    if shape == "stiffness":
        build.plant.gain.append(lambda t, x: np.clip(1 + 0.07 * deviation * spots[_touches(x)], 0.3, 2.0))
    else:
        build.plant.height.append(lambda t, x: 0.03 * deviation * build.depth_mm * spots[_touches(x)])
    return {"deviation": deviation}


@effect("swelling", "swells")
def swelling(build: Build, shape: str, size: float) -> dict[str, float]:
    """A gel takes up water, pressed or not, and its surface comes towards the probe (Tanaka and Fillmore 1979).

    With a time of a third to the whole of the recording.
    """
    rng = build.rng
    rise, tau = 0.15 * size * build.depth_mm * spread(rng, 0.8, 1.25), build.plant.duration_s * rng.uniform(0.33, 1.0)
    build.plant.height.append(lambda t, x: rise * np.expm1(-t / tau))
    return {"rise": rise}


@effect("residue", "builds_up", "falls_off")
def residue(build: Build, shape: str, size: float) -> dict[str, float]:
    """What sticks to the probe makes it longer: each touch adds a layer, of a fifth to the whole of a thickness.

    As of gels and fats that fail within themselves and not at the probe (Creton and Ciccotti 2016). `falls_off`: a
    third of the times all of it stays behind.
    """
    rng = build.rng
    layer, child = (0.03 if shape == "builds_up" else 0.05) * size * build.depth_mm, _child(rng)
    layer *= spread(rng, 0.8, 1.25)
    thick = np.zeros(1024)
    for k in range(2, len(thick)):
        lost = shape == "falls_off" and child.random() < 1 / 3
        thick[k] = 0.0 if lost else thick[k - 1] + child.uniform(0.2, 1.0)
    build.plant.height.append(lambda t, x: -np.minimum(layer * thick[_touches(x)], 0.4 * build.depth_mm))
    return {"layer": layer}


@njit(cache=True)
def _follows(wanted, h, rises_s, falls_s):
    """First-order, with one time up and another down."""
    out, w = np.zeros(wanted.shape[0]), 0.0
    for k in range(1, wanted.shape[0]):
        w += (wanted[k] - w) * -np.expm1(-h / (rises_s if wanted[k] > w else falls_s))
        out[k] = w
    return out


@effect("tensing", "bouts", "startles")
def tensing(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad is a muscle, and now and then it tenses: it is stiffer for a while (Oflaz and Baran 2014, in vivo).

    Within 0.1 to 0.3 s, and slack again within 0.5 to 1.5 s. `bouts`: of 1 to 3 s, as long apart, at random.
    `startles`: after a move, in two of five, 0.1 to 0.6 s late, for 0.3 to 1 s.
    """
    rng, motion, duration = build.rng, build.plant.motion, build.plant.duration_s
    growth, child = 0.12 * size * spread(rng, 0.8, 1.25), _child(rng)
    rises_s, falls_s, dwell_s = spread(rng, 0.1, 0.3), spread(rng, 0.5, 1.5), spread(rng, 1.0, 3.0)
    if shape == "bouts":
        times = np.cumsum(child.exponential(dwell_s, 2 * int(np.ceil(2 * (duration + 10) / dwell_s)) + 20))
        begins, ends = times[::2], times[1::2]
    else:
        at = motion.breaks_s[:-1]
        at = at[(np.abs(motion.velocity(at + 1e-4)) > 0) & (np.abs(motion.velocity(at - 1e-4)) == 0)]
        begins = at[child.random(len(at)) < 0.4]
        begins = begins + child.uniform(0.1, 0.6, len(begins))
        ends = begins + child.uniform(0.3, 1.0, len(begins))

    def gain(t, x):
        tense = np.zeros_like(t)
        for begin, end in zip(begins, ends, strict=True):
            tense[(t >= begin) & (t < end)] = 1.0
        return 1 + growth * (1.0 if shape == "bouts" else 1.5) * _follows(tense, t[1] - t[0], rises_s, falls_s)

    build.plant.gain.append(gain)
    return {"growth": growth}


@njit(cache=True)
def _cooled(touching, h, takes_s, returns_s):
    """0 to 1: within `takes_s` while it is touched, back within `returns_s`."""
    out, w = np.zeros(touching.shape[0]), 0.0
    for k in range(1, touching.shape[0]):
        w += (1 - w) * -np.expm1(-h / takes_s) if touching[k] else w * np.expm1(-h / returns_s)
        out[k] = w
    return out


@effect("cold_probe", "stiffens")
def cold_probe(build: Build, shape: str, size: float) -> dict[str, float]:
    """Fat or wax under a cold probe: as long as it touches, at any depth, the pad takes its temperature and stiffens.

    Within 3 to 10 s, and back in air within 5 to 15 s (Marangoni, Fat Crystal Networks).
    """
    rng = build.rng
    takes_s, returns_s, growth = spread(rng, 3.0, 10.0), spread(rng, 5.0, 15.0), 0.25 * size * spread(rng, 0.8, 1.25)
    build.plant.gain.append(lambda t, x: 1 + growth * _cooled(x > 0, t[1] - t[0], takes_s, returns_s))
    return {"growth": growth, "takes": takes_s, "returns": returns_s}
