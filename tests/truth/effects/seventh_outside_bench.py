"""The seventh effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: springs beside the sample, as of
flexures (Smith, Flexures) and gaiters; marks of a shunt that an amplifier puts in by itself (Doebelin, Measurement
Systems); heat that a probe takes up from the sample (HBM, thermal effects on load cells); codes by the logarithm
(ITU-T G.711) and converters with uneven codes (Kester, Data Conversion Handbook); fringes of optical force sensors
(Wu and Deslattes 1998); a drive's switching in the leads (Ott, Electromagnetic Compatibility Engineering).
"""

from __future__ import annotations

import numpy as np

from .fourth_outside_bench import _wandering
from .outside_bench import _AMPLIFIER, _CELL, _child
from .registry import Build, effect, spread
from .sensor import _disturb
from .third_outside_bench import _fades


@effect("guide_spring", "flexure", "gaiter")
def guide_spring(build: Build, shape: str, size: float) -> dict[str, float]:
    """A spring beside the pad, felt in air as well as under load: nothing where the cell was tared, at the start.

    With ξ the way from there in depths: `flexure`: K (ξ + c ξ³), c of 0.5 to 1.5. `gaiter`: K (ξ less three fifths of
    what ξ was in the last 1 to 4 s), as its rubber relaxes.
    """
    rng, motion = build.rng, build.plant.motion
    spring, side = 0.06 * size * build.force_N * spread(rng, 0.8, 1.25), float(rng.choice([-1.0, 1.0]))
    cubic, tau = float(rng.uniform(0.5, 1.5)), spread(rng, 1.0, 4.0)
    grid = np.arange(0.0, build.plant.duration_s + 1.0, 1e-3)

    def way(t):
        return (motion.position(t) - motion.position(0.0)) / build.depth_mm

    relaxed = _fades(way(grid), 1e-3, tau)

    def added(t):
        if shape == "flexure":
            return side * spring * (way(t) + cubic * way(t) ** 3)
        return 2 * spring * (way(t) - 0.6 * np.interp(t, grid, relaxed))

    _disturb(build, added)
    return {"spring": spring}


@effect("shunt_marks", "one_way", "both_ways")
def shunt_marks(build: Build, shape: str, size: float) -> dict[str, float]:
    """At even distances, every 2 to 5 s, the amplifier puts in a shunt for 0.25 to 0.5 s, to check itself.

    `one_way`: the reading is higher by a step, at any force. `both_ways`: higher, then lower for as long.
    """
    rng = build.rng
    both = shape == "both_ways"
    step = (0.03 if both else 0.045) * size * build.force_N * spread(rng, 0.8, 1.25)
    every, lasts, phase = spread(rng, 2.0, 5.0), float(rng.uniform(0.25, 0.5)), float(rng.uniform(0.2, 0.9))

    def added(t):
        since = (t / every + phase) % 1 * every
        return step * ((since < lasts) * 1.0 - both * ((since >= lasts) & (since < 2 * lasts)))

    _disturb(build, added)
    return {"step": step, "every": every, "lasts": lasts}


@effect("touch_heat", "one_body", "two_bodies")
def touch_heat(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pad and probe are not equally warm: as long as they touch, at any depth, the cell's zero goes, and back in air.

    `one_body`: within 1.5 to 5 s. `two_bodies`: half of it within a fifth of that.
    """
    rng, motion = build.rng, build.plant.motion
    zero = 0.045 * size * build.force_N * spread(rng, 0.8, 1.25) * float(rng.choice([-1.0, 1.0]))
    tau, grid = spread(rng, 1.5, 5.0), np.arange(0.0, build.plant.duration_s + 1.0, 1e-3)
    touches = (motion.position(grid) > 0).astype(float)
    warm = _fades(touches, 1e-3, tau)
    if shape == "two_bodies":
        warm = 0.5 * warm + 0.5 * _fades(touches, 1e-3, tau / 5)
    _disturb(build, lambda t: zero * np.interp(t, grid, warm))
    return {"zero": zero, "time_constant": tau}


@effect("coarse_codes", "logarithm", "uneven")
def coarse_codes(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force is kept in few codes; nothing is a code of its own.

    `logarithm`: even ones of ln(1 + 255 F/F_0), F_0 1.2 times the greatest force, as of telephones. `uneven`: each is
    0.3 to 1.7 of the mean width, and says its middle.
    """
    rng, child = build.rng, _child(build.rng)
    width, full = 0.06 * size * spread(rng, 0.8, 1.25), 1.2 * build.force_N
    widths = child.uniform(0.3, 1.7, int(np.ceil(8 / max(width, 1e-3))))
    widths[0] = 1.0
    edges = full * width * (np.cumsum(widths) - 0.5)
    middles = np.concatenate([[0.0], (edges[1:] + edges[:-1]) / 2])

    def stage(t, force):
        size_N = np.abs(force)
        if width == 0:
            return force
        if shape == "logarithm":
            # As wide as the others at two fifths of the whole.
            code = np.log1p(255 * size_N / full) / (2.5 * width)
            return np.sign(force) * full / 255 * np.expm1(np.round(code) * 2.5 * width)
        return np.sign(force) * middles[np.minimum(np.searchsorted(edges, size_N), len(middles) - 1)]

    build.sensor(_AMPLIFIER, stage)
    return {"width": width}


@effect("fringes", "drift", "wander")
def fringes(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell that counts fringes of light is off by a sine of the force, whose phase goes with the light's colour.

    Three to five waves from nothing to the greatest force; nothing where there is none. `drift`: the phase goes once
    around in 15 to 40 s. `wander`: it wanders by 1.5 rad or so, within 2 to 6 s.
    """
    rng = build.rng
    amplitude, wave = 0.03 * size * build.force_N * spread(rng, 0.8, 1.25), build.force_N / float(rng.uniform(3.0, 5.0))
    around, begins, time_s = spread(rng, 15.0, 40.0), float(rng.uniform(0, 2 * np.pi)), spread(rng, 2.0, 6.0)
    along = _wandering(_child(rng), build.plant.duration_s, time_s)

    def stage(t, force):
        phase = begins + (2 * np.pi * t / around if shape == "drift" else 1.5 * along(t))
        return force + amplitude * (np.sin(2 * np.pi * force / wave + phase) - np.sin(phase))

    build.sensor(_CELL, stage)
    return {"amplitude": amplitude, "wave": wave}


@effect("drive_noise", "in_motion", "by_speed")
def drive_noise(build: Build, shape: str, size: float) -> dict[str, float]:
    """What a drive's switching leaves in the leads: a noise of 4 to 12 ms at any force, only while the motor moves.

    `in_motion`: as much in any move. `by_speed`: as the speed over its greatest, to the power 0.5.
    """
    rng, motion, duration = build.rng, build.plant.motion, build.plant.duration_s
    deviation, time_s = 0.05 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 0.004, 0.012)
    along = _wandering(_child(rng), duration, time_s, 0.001)
    quickest = float(np.max(np.abs(motion.velocity(np.arange(0.0, duration, 1e-3)))))

    def added(t):
        speed = np.abs(motion.velocity(t))
        loud = (speed > 1e-6) * 1.0 if shape == "in_motion" else 1.5 * np.sqrt(speed / max(quickest, 1e-9))
        return deviation * loud * along(t)

    _disturb(build, added)
    return {"deviation": deviation}
