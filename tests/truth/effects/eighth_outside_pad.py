"""Effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: waves in soft tubes (Moens 1878,
Korteweg 1878, Lighthill, Waves in Fluids); gels that give way after a delay that goes exponentially with the load
(Sprakel, Lindström, Kodger and Weitz 2011); elastic bodies that are pressed elsewhere too (Boussinesq 1885); twitches
of single motor units, alone (fasciculations: Denny-Brown and Pennybacker 1938) or in trains (myokymia); voids that open
as rubber or a wet sponge is let go too fast (Gent and Lindley 1959).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _child
from .outside_pad import _added
from .registry import Build, effect, spread


@effect("echo", "closed_end", "open_end")
def echo(build: Build, shape: str, size: float) -> dict[str, float]:
    """A long soft tube full of water: the wave that a press sends out comes back from its far end, and again.

    After 0.3 to 1 s, as a bump as long as a fifth to a third of that, and 0.6 of it each next time. `closed_end`: a
    press comes back as a press. `open_end`: as its opposite, and the next one as a press.
    """
    rng = build.rng
    share, returns_s = 0.28 * size * spread(rng, 0.8, 1.25), spread(rng, 0.3, 1.0)
    lasts_s, turned = returns_s * float(rng.uniform(0.2, 0.33)), 1.0 if shape == "closed_end" else -1.0

    def part(t, depth, u):
        whole = np.concatenate([[0.0], np.cumsum((u[1:] + u[:-1]) / 2 * np.diff(t))])
        # A step of u comes as a triangle, from the time on that is told.
        bump = [np.interp(t - late, t, whole, left=0.0) for late in (0.0, lasts_s / 2, lasts_s)]
        sent = 2 * (bump[0] - 2 * bump[1] + bump[2]) / lasts_s
        heard = sum(turned**k * 0.6 ** (k - 1) * np.interp(t - k * returns_s, t, sent, left=0.0) for k in range(1, 7))
        return share * heard

    _added(build, part)
    return {"share": share, "returns": returns_s, "lasts": lasts_s}


@njit(cache=True)
def _given_way(load, touches, h, delay_s, per_load, takes_s, heals_s):
    """0 to 1: to 1 within `takes_s` once ∫ e^{−(1 − load)/per_load} dt/delay is 1; it begins anew in air, and heals."""
    out, clock, w = np.zeros(load.shape[0]), 0.0, 0.0
    for k in range(1, load.shape[0]):
        if not touches[k]:
            clock = 0.0
            w *= np.exp(-h / heals_s)
        else:
            clock += h / delay_s * np.exp(-(1 - load[k]) / per_load)
            if clock > 1:
                w += (1 - w) * -np.expm1(-h / takes_s)
        out[k] = w
    return out


@effect("delayed_yield", "at_once", "strand_by_strand")
def delayed_yield(build: Build, shape: str, size: float) -> dict[str, float]:
    """A gel bears its load for a while and then gives way; the more load, the sooner. In air it heals.

    After 0.1 to 0.3 s at the greatest force, e times as late for each 0.3 to 0.5 of it less; within 20 to 80 ms, and
    healed within 1 to 4 s. `strand_by_strand`: four parts alike, with 0.4, 0.8, 1.6 and 3.2 times that delay.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    share, delay_s = min(0.15 * size * spread(rng, 0.8, 1.25), 0.7), spread(rng, 0.1, 0.3)
    per_load, takes_s, heals_s = float(rng.uniform(0.3, 0.5)), spread(rng, 0.02, 0.08), spread(rng, 1.0, 4.0)
    parts = (1.0,) if shape == "at_once" else (0.4, 0.8, 1.6, 3.2)

    def gain(t, x):
        load, h = law.force(x) / most, t[1] - t[0]
        gone = [_given_way(load, x > 0, h, part * delay_s, per_load, takes_s, heals_s) for part in parts]
        return 1 - share * np.mean(gone, axis=0)

    build.plant.gain.append(gain)
    return {"share": share, "delay": delay_s, "per_load": per_load}


@effect("pressed_beside", "rhythm", "comes_and_goes")
def pressed_beside(build: Build, shape: str, size: float) -> dict[str, float]:
    """Another machine presses the same pad beside this one, and the surface sinks here too as long as it does.

    Each change takes 0.1 to 0.3 s. `rhythm`: every 2 to 6 s, 0.35 to 0.6 of the time. `comes_and_goes`: for 1 to 3 s in
    the mean, and as long not, at random.
    """
    rng, duration = build.rng, build.plant.duration_s
    sinks, takes_s = 0.05 * size * build.depth_mm * spread(rng, 0.8, 1.25), spread(rng, 0.1, 0.3)
    period, phase, part = spread(rng, 2.0, 6.0), float(rng.uniform(0, 1)), float(rng.uniform(0.35, 0.6))
    dwell_s, child = spread(rng, 1.0, 3.0), _child(rng)
    count = int(np.ceil(2 * (duration + 10) / dwell_s)) + 20
    lengths = takes_s + child.exponential(dwell_s, 2 * count)
    if shape == "rhythm":
        lengths = np.resize([part * period, (1 - part) * period], 2 * count)
        lengths[0] *= phase
    # At each change the way begins from one to the other.
    changes = np.cumsum(lengths)
    times = np.ravel(np.column_stack([changes, changes + takes_s]))
    levels = np.ravel(np.column_stack([np.resize([1.0, 0.0], 2 * count), np.resize([0.0, 1.0], 2 * count)]))
    build.plant.height.append(lambda t, x: sinks * np.interp(t, times, levels))
    return {"sinks": sinks, "takes": takes_s}


@effect("twitches", "single", "trains")
def twitches(build: Build, shape: str, size: float) -> dict[str, float]:
    """A muscle twitches of itself, pressed or not: q e^{1−q} with q = t/τ, τ of 40 to 90 ms, now more and now less.

    `single`: one to two a second, at random. `trains`: of three to six, 0.1 to 0.16 s apart, each 1.5 to 4 s.
    """
    rng, duration = build.rng, build.plant.duration_s
    growth, tau = 0.12 * size * spread(rng, 0.8, 1.25), spread(rng, 0.04, 0.09)
    every_s, apart_s, pause_s, child = spread(rng, 0.5, 1.0), float(rng.uniform(0.1, 0.16)), 1.5, _child(rng)
    if shape == "single":
        when = np.cumsum(child.exponential(every_s, int(np.ceil(2 * (duration + 10) / every_s)) + 40))
    else:
        begins = np.cumsum(child.uniform(pause_s, 4.0, int(np.ceil((duration + 10) / pause_s))))
        when = np.concatenate([begin + apart_s * np.arange(child.integers(3, 7)) for begin in begins])
    sizes = child.uniform(0.5, 1.5, len(when))

    def gain(t, x):
        out = np.zeros_like(t)
        for begin, much in zip(when, sizes, strict=True):
            first, last = np.searchsorted(t, [begin, begin + 15 * tau])
            q = (t[first:last] - begin) / tau
            out[first:last] += much * q * np.exp(1 - q)
        return 1 + growth * out

    build.plant.gain.append(gain)
    return {"growth": growth, "tau": tau}


@njit(cache=True)
def _voids(x, h, quick_mm_s, opens_mm, fades_s, closes_mm):
    """Share of voids: towards 1 with the way out that is quicker than a speed; they fade, or are pressed out."""
    out, w, kept = np.zeros(x.shape[0]), 0.0, np.exp(-h / fades_s)
    for k in range(1, x.shape[0]):
        way = max(x[k], 0.0) - max(x[k - 1], 0.0)
        if -way > quick_mm_s * h:
            w += (1 - w) * -np.expm1(way / opens_mm)
        elif way > 0:
            w *= np.exp(-way / closes_mm)
        w *= kept
        out[k] = w
    return out


@effect("voids", "dissolve", "pressed_out")
def voids(build: Build, shape: str, size: float) -> dict[str, float]:
    """Let go too fast the pad takes in air, and is softer from then on; let go slowly it is as before.

    From 2 to 6 mm/s on, whole within 0.2 to 0.5 of the depth. `dissolve`: gone within 2 to 8 s. `pressed_out`: with the
    way of the next presses, by half to all of the depth.
    """
    rng, depth = build.rng, build.depth_mm
    share, quick = min(0.22 * size * spread(rng, 0.8, 1.25), 0.8), spread(rng, 2.0, 6.0)
    opens = depth * float(rng.uniform(0.2, 0.5))
    fades_s, closes = spread(rng, 2.0, 8.0), depth * float(rng.uniform(0.5, 1.0))
    fades_s, closes = (fades_s, np.inf) if shape == "dissolve" else (np.inf, closes)
    build.plant.gain.append(lambda t, x: 1 - share * _voids(x, t[1] - t[0], quick, opens, fades_s, closes))
    return {"share": share, "quick": quick}
