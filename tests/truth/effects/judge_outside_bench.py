"""The judge's effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: B. Alessandro, C. Beatrice, G.
Bertotti and A. Montorsi, Domain-wall dynamics and Barkhausen effect in metallic ferromagnetic materials, J. Appl. Phys.
68 (1990) 2901; F. Preisach, Über die magnetische Nachwirkung, Z. Phys. 94 (1935) 277; D. C. Jiles, Theory of the
magnetomechanical effect, J. Phys. D 28 (1995) 1537; L. Pantel and L. C. Wolf, On the suitability of dead reckoning
schemes for games, Proc. NetGames (2002) 79; E. Catmull and R. Rom, A class of local interpolating splines, in Computer
Aided Geometric Design (1974) 317; W. Schottky, Über spontane Stromschwankungen in verschiedenen Elektrizitätsleitern,
Ann. Phys. 362 (1918) 541; M. Büttiker, Scattering theory of current and intensity noise correlations in conductors and
wave guides, Phys. Rev. B 46 (1992) 12485, of what is parted at random; P. M. Lugt, A review on grease lubrication in
rolling bearings, Tribol. Trans. 52 (2009) 470, of grease that is churned aside and flows back; W. R. Harper, Contact
and Frictional Electrification (1967); J. Lowell and A. C. Rose-Innes, Contact electrification, Adv. Phys. 29 (1980)
947.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .fourth_outside_bench import _wandering
from .outside_bench import _AMPLIFIER, _CELL, _child
from .registry import Build, judge_effect, spread
from .sensor import _disturb


@njit(cache=True)
def climbed(force, low, step, ground):
    """y of y + W(y) = F where y goes on, either way, only as far as it must: W is straight between even places."""
    out, last = np.zeros(force.shape[0]), ground.shape[0] - 1
    y = 0.0
    for k in range(force.shape[0]):
        i = min(max(int(np.floor((y - low) / step)), 0), last - 1)
        part = (y - low) / step - i
        here = y + ground[i] + part * (ground[i + 1] - ground[i])
        if here < force[k]:
            while i < last - 1 and low + (i + 1) * step + ground[i + 1] < force[k]:
                i += 1
                part, here = 0.0, low + i * step + ground[i]
        elif here > force[k]:
            while i > 0 and low + i * step + ground[i] > force[k]:
                i -= 1
                part, here = 1.0, low + (i + 1) * step + ground[i + 1]
        left, right = low + i * step + ground[i], low + (i + 1) * step + ground[i + 1]
        if here != force[k]:
            end = right if here < force[k] else left
            share = (force[k] - here) / (end - here) if end != here else 0.0
            part += min(max(share, 0.0), 1.0) * ((1.0 if here < force[k] else 0.0) - part)
        y = low + (i + part) * step
        out[k] = y
    return out


@njit(cache=True)
def switched(force, up, down, weights):
    """Σ w of switches that are on: each goes on at or above its `up`, and off below its `down`."""
    out, on = np.zeros(force.shape[0]), np.zeros(up.shape[0], dtype=np.bool_)
    for k in range(force.shape[0]):
        for i in range(up.shape[0]):
            if force[k] >= up[i]:
                on[i] = True
            elif force[k] < down[i]:
                on[i] = False
            if on[i]:
                out[k] += weights[i]
    return out


@judge_effect("barkhausen", "walls", "switches")
def barkhausen(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell of magnetic steel, whose walls are pinned: the reading goes by jumps, at other forces up than down.

    `walls`: y + W(y) = F, W an Ornstein–Uhlenbeck process over 0.03 to 0.08 of the greatest force, and y goes no
    further than it must. `switches`: 16, eight of either sign, on at 0.1 to 1 of the greatest force and off at 0.4 to
    0.8 of that.
    """
    rng, child, most = build.rng, _child(build.rng), build.force_N
    pinned, over = 0.02 * size * most * spread(rng, 0.8, 1.25), most * spread(rng, 0.03, 0.08)
    step = over / 30
    places = step * np.arange(-int(np.ceil(2 * most / step)), int(np.ceil(4 * most / step)) + 1)
    along = _wandering(child, float(places[-1] - places[0]) / over, 1.0, 1 / 30)
    # Nothing where there is no force.
    ground = pinned * along((places - places[0]) / over) * -np.expm1(-np.abs(places) / over)
    up = most * child.uniform(0.1, 1.0, 16)
    down = up * child.uniform(0.4, 0.8, 16)
    weights = child.permutation(np.resize([1.0, -1.0], 16)) * child.uniform(0.5, 1.5, 16)

    def stage(t, force):
        if shape == "switches":
            return force + 0.5 * pinned * switched(force, up, down, weights)
        return climbed(force, places[0], step, ground)

    build.sensor(_CELL, stage)
    return {"pinned": pinned, "over": over}


@judge_effect("setpoints", "dead_reckoning", "cubic")
def setpoints(build: Build, shape: str, size: float) -> dict[str, float]:
    """The drive is told a place now and then, and makes up its own way between; the log has what was planned.

    Every 4 to 6 ms. `dead_reckoning`: on as between the last two, so that it goes too far at each stop and begins late.
    `cubic`: a smooth curve through all of them, 16 to 25 ms apart, which swings before each corner as well as after.
    """
    every_s = 5e-3 * size * spread(build.rng, 0.8, 1.25) * (4.0 if shape == "cubic" else 1.0)
    phase = float(build.rng.uniform(0, 1))

    def play(t, x):
        if every_s < 1e-6:
            return x
        told = np.arange(-2.0 - phase, t[-1] / every_s + 4) * every_s
        at = np.interp(told, t, x)
        k = np.searchsorted(told, t, side="right") - 1
        part = (t - told[k]) / every_s
        if shape == "dead_reckoning":
            return at[k] + part * (at[k] - at[k - 1])
        # Hermite's cubic with the mean slope of both sides.
        slope, after = (at[k + 1] - at[k - 1]) / 2, (at[k + 2] - at[k]) / 2
        blend = part**2 * (3 - 2 * part)
        bent = part * (1 - part) * ((1 - part) * slope - part * after)
        return at[k] * (1 - blend) + at[k + 1] * blend + bent

    build.plant.play.append(play)
    return {"every": every_s}


@judge_effect("photons", "shot", "parted")
def photons(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell that is read by light: the noise goes with the root of what comes in, and is none where nothing does.

    As an Ornstein–Uhlenbeck process of 8 to 25 ms. `shot`: √p, p of the greatest force. `parted`: between two diodes,
    2 √(p (1 − p)), most at half of 1.1 times that and next to none at its end.
    """
    rng, child, most = build.rng, _child(build.rng), build.force_N
    amplitude, time_s = 0.022 * size * most * spread(rng, 0.8, 1.25), spread(rng, 0.008, 0.025)
    along = _wandering(child, build.plant.duration_s, time_s, 0.001)

    def stage(t, force):
        p = np.maximum(force / most, 0.0)
        if shape == "parted":
            p = np.minimum(p / 1.1, 1.0)
            return force + amplitude * 2 * np.sqrt(p * (1 - p)) * along(t)
        return force + amplitude * np.sqrt(p) * along(t)

    build.sensor(_AMPLIFIER, stage)
    return {"amplitude": amplitude, "time": time_s}


@njit(cache=True)
def ridges(x, wide, keeps):
    """What ridges of grease hold against the motion: one at each turn, of height 1, a bell of deviation `wide`.

    A pass leaves `keeps` of it. Together they hold no more than 1. At rest it stays.
    """
    out, places, heights = np.zeros(x.shape[0]), np.zeros(1024), np.zeros(1024)
    count, side = 0, 0.0
    wears = -np.log(keeps) / (wide * np.sqrt(2 * np.pi))
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        if abs(dx) > 1e-9:
            now = np.sign(dx)
            if now == -side:
                found = False
                for i in range(count):
                    if abs(places[i] - x[k - 1]) < wide / 2:
                        heights[i], found = 1.0, True
                if not found and count < 1024:
                    places[count], heights[count] = x[k - 1], 1.0
                    count += 1
            side = now
        total = 0.0
        for i in range(count):
            off = (x[k] - places[i]) / wide
            if abs(off) < 6:
                bell = np.exp(-0.5 * off * off)
                total += heights[i] * bell
                heights[i] *= np.exp(-wears * bell * abs(dx))
        out[k] = side * min(total, 1.0)
    return out


@njit(cache=True)
def heaps(x, h, over, flows, rests):
    """What a heap of grease on either side holds: 1 where it is pushed, by a way, and less where the carriage rests.

    Where it is not touched it flows after the carriage.
    """
    out = np.zeros(x.shape[0])
    edges, held = np.array([x[0], -x[0]]), np.zeros(2)
    for k in range(1, x.shape[0]):
        for i in range(2):
            at = x[k] if i == 0 else -x[k]
            if at > edges[i]:
                held[i] = 1 + (held[i] - 1) * np.exp((edges[i] - at) / over)
                edges[i] = at
            elif at < edges[i] - 1e-12:
                held[i] = 0.0
                edges[i] = max(edges[i] - flows * h, at)
            else:
                held[i] *= np.exp(-h / rests)
        out[k] = held[0] - held[1]
    return out


@judge_effect("grease", "ridges", "heaps")
def grease(build: Build, shape: str, size: float) -> dict[str, float]:
    """The carriage pushes the grease of its rail about, and is held where it comes upon it, in air too.

    `ridges`: it leaves one where it turns, 0.04 to 0.1 mm wide, and a third to two thirds of it at each pass. `heaps`:
    it pushes one ahead on either side, all of it within 0.05 to 0.15 mm; they flow after it by 0.1 to 0.4 mm/s, and
    give way within 0.5 to 2 s where it rests.
    """
    rng, motion = build.rng, build.plant.motion
    held = 0.05 * size * build.force_N * spread(rng, 0.8, 1.25)
    wide, keeps, over = spread(rng, 0.04, 0.1), float(rng.uniform(0.33, 0.67)), spread(rng, 0.05, 0.15)
    flows, rests, h = spread(rng, 0.1, 0.4), spread(rng, 0.5, 2.0), 2e-4
    grid = np.arange(0.0, build.plant.duration_s + 1.0, h)

    def added(t):
        x = motion.position(grid)
        pushed = ridges(x, wide, keeps) if shape == "ridges" else heaps(x, h, over, flows, rests)
        return held * np.interp(t, grid, pushed)

    _disturb(build, added)
    return {"held": held, "wide": wide, "flows": flows}


@njit(cache=True)
def charges(force, h, level, tau, fills, most):
    """Charge that shows while nothing touches: each touch brings it, and it leaves within a time.

    By the greatest force of the touch, of which `most` is 1, or, where `fills` is not 0, by that share of what lacks.
    """
    out, q, peak, touches = np.zeros(force.shape[0]), 0.0, 0.0, False
    kept = np.exp(-h / tau)
    for k in range(force.shape[0]):
        load = abs(force[k])
        if load > level:
            touches, peak = True, max(peak, load)
        elif touches and load < 0.5 * level:
            q += fills * (1 - q) if fills > 0 else peak / most
            touches, peak = False, 0.0
        q *= kept
        out[k] = 0.0 if touches else q
    return out


@judge_effect("triboelectric", "by_load", "by_count")
def triboelectric(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pad and probe charge each other; as they part the charge shows in the leads, and it leaks away in air.

    `by_load`: as the greatest force of the touch, gone within 0.3 to 1 s, besides what is left of the last. `by_count`:
    each touch brings 0.4 to 0.7 of what lacks, and it is gone within 4 to 12 s. Touched, it does not show.
    """
    rng, most = build.rng, build.force_N
    amplitude, side = 0.06 * size * most * spread(rng, 0.8, 1.25), float(rng.choice([-1.0, 1.0]))
    fills = float(rng.uniform(0.4, 0.7)) if shape == "by_count" else 0.0
    tau = spread(rng, 0.3, 1.0) if shape == "by_load" else spread(rng, 4.0, 12.0)

    def stage(t, force):
        return force + side * amplitude * charges(force, float(t[1] - t[0]), 0.02 * most, tau, fills, most)

    build.sensor(_AMPLIFIER, stage)
    return {"amplitude": amplitude, "time": tau, "fills": fills}
