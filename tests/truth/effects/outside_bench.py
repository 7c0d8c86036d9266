"""Effects of the bench that the catalogue has no name for. Each size of 1 is a misfit of some 1–3 % of the force."""

from __future__ import annotations

import numpy as np
from numba import njit

from .registry import Build, effect, spread
from .sensor import _disturb

_CELL, _AMPLIFIER = 5, 30  # stages of the sensor, before its resonance and after its lag


def _child(rng: np.random.Generator) -> np.random.Generator:
    """A generator for numbers whose count is not known yet."""
    return np.random.default_rng(int(rng.integers(2**63)))


@njit(cache=True)
def _sawtooth(x, h, pitches_mm, drops, waits_s):
    """Between −1 and 1: rises with the way by 2 in each pitch, in the direction of motion, and drops at the end.

    At rest it drops too, after each of `waits_s`, which may be endless.
    """
    out, y, j, rest_s = np.zeros(x.shape[0]), 0.0, 0, 0.0
    for k in range(1, x.shape[0]):
        y += 2 * (x[k] - x[k - 1]) / pitches_mm[j]
        rest_s = rest_s + h if abs(x[k] - x[k - 1]) < 1e-9 else 0.0
        if abs(y) > 1:
            y -= np.copysign(2 * drops[j], y)
            j = (j + 1) % pitches_mm.shape[0]
        elif rest_s > waits_s[j]:
            y *= 1 - 2 * drops[j]
            j, rest_s = (j + 1) % pitches_mm.shape[0], 0.0
        out[k] = y
    return out


@effect("stick_slip", "guide", "contact_edge")
def stick_slip(build: Build, shape: str, size: float) -> dict[str, float]:
    """Sticks and slips over ways that are never the same (Bowden and Leben 1939).

    `guide`: a seal or bushing, felt in air too; at rest it stays wherever it was. `contact_edge`: the edge of the
    contact is pinned and jumps (Schallamach 1971), at rest too, every few seconds; the force goes with the load.
    """
    rng = build.rng
    amplitude, pitch = 0.04 * size * spread(rng, 0.8, 1.25), build.depth_mm * spread(rng, 0.06, 0.15)
    pitches, drops = pitch * np.exp(rng.normal(0, 0.4, 2048)), rng.uniform(0.5, 1.0, 2048)
    if shape == "guide":
        force, never = 0.7 * amplitude * build.force_N, np.full(2048, np.inf)
        build.plant.felt.append(lambda t, x, v, a: force * _sawtooth(x, t[1] - t[0], pitches, drops, never))
    else:
        waits = rng.exponential(1.5, 2048)

        def gain(t, x):
            return 1 + 1.5 * amplitude * _sawtooth(np.maximum(x, 0.0), t[1] - t[0], pitches, drops, waits)

        build.plant.gain.append(gain)
    return {"amplitude": amplitude, "pitch": pitch}


@njit(cache=True)
def _seats(x, h, seats, waits_s, lean, way_mm, slides_s):
    """Goes to the next of `seats` when a move begins and after each wait, and leans by the direction."""
    out, y, j, rests, since_s, side = np.zeros(x.shape[0]), 0.0, 0, True, 0.0, 0.0
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        moves = abs(dx) >= 1e-9
        since_s += h
        if (moves and rests) or since_s > waits_s[j]:
            j, since_s = (j + 1) % seats.shape[0], 0.0
        if moves:
            side = np.copysign(lean, dx)
        rests = not moves
        step = abs(dx) / way_mm + h / slides_s
        y += min(max(seats[j] + side - y, -step), step)
        out[k] = y
    return out


@effect("probe_tilt", "two_way", "reseats")
def probe_tilt(build: Build, shape: str, size: float) -> dict[str, float]:
    """A probe loose in its mount tilts, and its footprint with it: the stiffness is another one after each tilt.

    It seats itself anew when a move begins, and every few seconds under load. `two_way`: it leans by the direction of
    the last move besides.
    """
    rng = build.rng
    amplitude, way = 0.06 * size * spread(rng, 0.8, 1.25), 0.1 * build.depth_mm
    lean = 0.5 if shape == "two_way" else 0.0
    seats, waits = rng.uniform(-1, 1, 2048), rng.exponential(3.0, 2048)
    build.plant.gain.append(lambda t, x: 1 + amplitude * _seats(x, t[1] - t[0], seats, waits, lean, way, 0.05))
    return {"amplitude": amplitude}


@effect("loose_cable", "two_level", "many_levels")
def loose_cable(build: Build, shape: str, size: float) -> dict[str, float]:
    """A contact that opens and closes at random times adds steps: a random telegraph signal (Rice 1944).

    `many_levels`: each time it closes with another resistance.
    """
    rng = build.rng
    step, dwell_s = 0.04 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 1.0, 4.0)
    child = _child(rng)
    count = int(np.ceil(4 * (build.plant.duration_s + 10) / dwell_s)) + 20
    times = np.cumsum(child.exponential(dwell_s, count))
    levels = np.resize([0.0, 1.0], count + 1) if shape == "two_level" else 2 * child.uniform(-0.5, 0.5, count + 1)
    _disturb(build, lambda t: step * levels[np.minimum(np.searchsorted(times, t), count)])
    return {"step": step, "dwell": dwell_s}


@effect("cell_hysteresis", "sign_of_rate", "bowed")
def cell_hysteresis(build: Build, shape: str, size: float) -> dict[str, float]:
    """The cell reads more while the force rises than while it falls, relaxation at rest included (VDI/VDE 2637).

    `sign_of_rate`: a gain of its own for either sign of dF/dt. `bowed`: the difference is greatest at half load.
    """
    rng = build.rng
    amplitude, most = 0.07 * size * spread(rng, 0.8, 1.25), build.force_N
    slow_N_s = 0.01 * most

    def stage(t, force):
        rate = np.diff(force, prepend=force[0]) / (t[1] - t[0])
        load = force if shape == "sign_of_rate" else 1.5 * force * np.maximum(1 - np.abs(force) / most, 0.0)
        return force + amplitude * load * rate / (np.abs(rate) + slow_N_s)

    build.sensor(_CELL, stage)
    return {"amplitude": amplitude}


@njit(cache=True)
def _ranges(force, up_N, down_N):
    """Whether in the upper range, and steps since the last switch."""
    upper, since, on, steps = np.zeros(force.shape[0]), np.zeros(force.shape[0]), 0.0, 1e12
    for k in range(force.shape[0]):
        if on == 0 and force[k] > up_N:
            on, steps = 1.0, 0.0
        elif on == 1 and force[k] < down_N:
            on, steps = 0.0, 0.0
        steps += 1
        upper[k], since[k] = on, steps
    return upper, since


@effect("ranging", "hysteresis", "settling")
def ranging(build: Build, shape: str, size: float) -> dict[str, float]:
    """An amplifier that changes its range by itself: above a level another gain and zero, until well below it again.

    `settling`: after each change it swings in, within 0.3 to 1.5 s.
    """
    rng = build.rng
    most = build.force_N
    up = most * float(rng.uniform(0.25, 0.4))
    down = up * float(rng.uniform(0.2, 0.4))
    sign = float(rng.choice([-1.0, 1.0]))
    gain, zero = 0.02 * size * sign * spread(rng, 0.8, 1.25), -0.06 * size * sign * most * spread(rng, 0.8, 1.25)
    settles_s, kick = spread(rng, 0.5, 2.0), 0.06 * size * most * sign

    def stage(t, force):
        upper, since = _ranges(force, up, down)
        out = force * (1 + gain * upper) + zero * upper
        if shape == "settling":
            out = out + kick * np.exp(-since * (t[1] - t[0]) / settles_s)
        return out

    build.sensor(_AMPLIFIER, stage)
    return {"level": up, "gain": gain, "zero": zero}


@effect("building", "shaking", "gap")
def building(build: Build, shape: str, size: float) -> dict[str, float]:
    """Floors swing at 3 to 8 Hz, by 10 µm or so on upper storeys (Gordon 1991): a random process of narrow band.

    A swing lasts 1/(2π ζ f), some seconds; its phase is lost after that. `shaking`: the mass at the cell feels it,
    in air too. `gap`: pad and probe stand on different legs, so that it goes with the stiffness.
    """
    rng = build.rng
    frequency, damping = float(rng.uniform(3, 8)), spread(rng, 0.01, 0.04)
    deviation = 0.02 * size * spread(rng, 0.8, 1.25)
    child = _child(rng)
    step_s = 0.002
    count = int(np.ceil((build.plant.duration_s + 1) / step_s)) + 2
    # Complex Ornstein–Uhlenbeck process, from its stationary state; its real part has deviation 1.
    omega = 2 * np.pi * frequency
    turn = np.exp((-damping + 1j) * omega * step_s)
    pushes = (child.standard_normal(count) + 1j * child.standard_normal(count)) * np.sqrt(1 - np.abs(turn) ** 2)
    pushes[0] /= np.sqrt(1 - np.abs(turn) ** 2)
    states = np.zeros(count, dtype=complex)
    for k, push in enumerate(pushes):
        states[k] = push if k == 0 else states[k - 1] * turn + push

    def swing(t):
        return np.interp(t, np.arange(count) * step_s, states.real)

    if shape == "shaking":
        build.plant.felt.append(lambda t, x, v, a: deviation * build.force_N * swing(t))
    else:
        build.plant.height.append(lambda t, x: 0.7 * deviation * build.depth_mm * swing(t))
    return {"frequency": frequency, "damping_ratio": damping, "deviation": deviation}


@njit(cache=True)
def _heated(power, h, tau):
    out = np.zeros(power.shape[0])
    for k in range(1, power.shape[0]):
        out[k] = out[k - 1] + (power[k] - out[k - 1]) * h / tau
    return out


@effect("thermal_growth", "motor", "room")
def thermal_growth(build: Build, shape: str, size: float) -> dict[str, float]:
    """The rod between encoder and probe grows with heat (Slocum, Precision Machine Design): 12 µm for 100 mm and 5 K.

    `motor`: each move heats it by its top speed squared, and it cools with a time constant of 5 to 20 s. `room`: the
    air swings with a period of 15 to 40 s.
    """
    rng = build.rng
    growth = 0.05 * size * build.depth_mm * spread(rng, 0.8, 1.25)
    tau, period, phase = spread(rng, 5.0, 20.0), spread(rng, 15.0, 40.0), float(rng.uniform(0, 2 * np.pi))

    def height(t, x):
        if shape == "room":
            return 0.5 * growth * np.sin(2 * np.pi * t / period + phase)
        heat = np.diff(x, prepend=x[0]) ** 2
        warm = _heated(heat, t[1] - t[0], tau)
        return -2 * growth * warm / np.max(warm)

    build.plant.height.append(height)
    return {"growth": growth, "time_constant": tau} if shape == "motor" else {"growth": growth, "period": period}


@effect("lost_steps", "every_move", "fast_moves")
def lost_steps(build: Build, shape: str, size: float) -> dict[str, float]:
    """A stepper without an encoder reports what was asked and not where it is: each move ends a little off, at random.

    `fast_moves`: only moves above the median speed lose steps, then more of them. Homing at the start of a run is the
    only cure (Acarnley, Stepping Motors).
    """
    rng = build.rng
    off = 0.03 * size * build.depth_mm * spread(rng, 0.8, 1.25)
    motion, child = build.plant.motion, _child(rng)
    middle = (motion.breaks_s[1:] + motion.breaks_s[:-1]) / 2
    speed = np.abs(motion.velocity(middle))
    # The middle of each move is where its pieces are fastest: those with no acceleration, or the top of a triangle.
    moving = speed > 1e-6
    starts = np.flatnonzero(moving & ~np.concatenate([[False], moving[:-1]]))
    ends = np.flatnonzero(moving & ~np.concatenate([moving[1:], [False]]))
    top = np.array([speed[a : b + 1].max() for a, b in zip(starts, ends, strict=True)])
    when = motion.breaks_s[starts], motion.breaks_s[ends + 1]
    jumps = off * child.standard_normal(len(starts)) * (0.7 if shape == "every_move" else 1.0)
    if shape == "fast_moves":
        jumps = np.where(top >= np.median(top), jumps, 0.0)
    # The load pulls the rotor back towards the step that was meant: little adds up.
    place = np.zeros(len(jumps) + 1)
    for k, jump in enumerate(jumps):
        place[k + 1] = 0.2 * place[k] + jump if jump else place[k]

    def lost(t):
        share = np.stack([np.clip((t - a) / max(b - a, 1e-9), 0, 1) for a, b in zip(*when, strict=True)])
        return np.diff(place) @ share

    build.plant.play.append(lambda t, x: x + lost(t))
    return {"deviation": off}
