"""Effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: L. Lapicque, Recherches quantitatives
sur l'excitation électrique des nerfs, J. Physiol. Pathol. Gén. 9 (1907), and E. Adrian and Y. Zotterman, The impulses
produced by sensory nerve-endings, J. Physiol. 61 (1926); N. Keim and S. Nagel, Generic transient memory formation in
disordered systems with noise, Phys. Rev. Lett. 107 (2011); B. Marshall et al., Direct observation of catch bonds
involving cell-adhesion molecules, Nature 423 (2003), and Y. Pereverzev et al., The two-pathway model for the
catch-slip transition in biological adhesion, Biophys. J. 89 (2005); N. Minorsky, Self-excited oscillations in dynamical
systems possessing retarded actions, J. Appl. Mech. 9 (1942), and I. Flügge-Lotz, Discontinuous Automatic Control
(1953); F. Gadala-Maria and A. Acrivos, Shear-induced structure in a concentrated suspension of solid spheres, J. Rheol.
24 (1980).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _child
from .outside_pad import _added
from .registry import Build, effect, spread


@njit(cache=True)
def _fires(load, h, least, often_Hz, tires, tires_s, needs):
    """Steps at which ∫ f (load − tired − least) dt has come to what the next one needs; `tired` goes after the load."""
    when, n, clock, tired, part = np.zeros(needs.shape[0], dtype=np.int64), 0, 0.0, 0.0, -np.expm1(-h / tires_s)
    for k in range(1, load.shape[0]):
        tired += (tires * load[k] - tired) * part
        clock += often_Hz * max(load[k] - tired - least, 0.0) * h
        if clock > needs[n] and n < needs.shape[0] - 1:
            clock -= needs[n]
            when[n] = k
            n += 1
    return when[:n]


@effect("firing", "steady", "adapts")
def firing(build: Build, shape: str, size: float) -> dict[str, float]:
    """A muscle is stung by its load: it gathers up, and at a threshold it jerks, the oftener the more it bears.

    From a tenth of the greatest force on, up to 2 to 4 Hz at the greatest; each needs 0.75 to 1.25 of the mean. A jerk
    is q e^{1−q} with q = t/τ, τ of 40 to 80 ms. `adapts`: twice as often, but 0.8 of the load is no longer felt after
    1 to 3 s of it.
    """
    rng, law, child = build.rng, build.plant.pad.law, _child(build.rng)
    growth, tau, often_Hz = 0.14 * size * spread(rng, 0.8, 1.25), spread(rng, 0.04, 0.08), spread(rng, 2.0, 4.0)
    tires_s, needs = spread(rng, 1.0, 3.0), child.uniform(0.75, 1.25, 4096)
    tires, often_Hz = (0.0, often_Hz) if shape == "steady" else (0.8, 2 * often_Hz)

    def gain(t, x):
        h, out = float(t[1] - t[0]), np.zeros_like(t)
        q = np.arange(int(12 * tau / h)) * h / tau
        jerk = q * np.exp(1 - q)
        load = law.force(x)
        for first in _fires(load / max(load.max(), 1e-9), h, 0.1, often_Hz, tires, tires_s, needs):
            last = min(first + len(jerk), len(t))
            out[first:last] += jerk[: last - first]
        return 1 + growth * out

    build.plant.gain.append(gain)
    return {"growth": growth, "tau": tau, "often": often_Hz}


@njit(cache=True)
def _marks(x, h, pitch, width, grows_s, fades_s, rubs_mm):
    """Mark at the probe's own depth: it grows where the probe is, as a bell of `width`, and fades or is rubbed out."""
    count = int(x.max() / pitch) + 3
    marks, out, kept = np.zeros(max(count, 3)), np.zeros(x.shape[0]), np.exp(-h / fades_s)
    reach = int(3 * width / pitch) + 1
    for k in range(1, x.shape[0]):
        if kept < 1:
            marks *= kept
        if x[k] <= 0:
            continue
        place, way = x[k] / pitch, abs(x[k] - max(x[k - 1], 0.0))
        i = int(place)
        for j in range(max(i - reach, 0), min(i + reach + 2, marks.shape[0])):
            off = (place - j) * pitch / width
            bell = np.exp(-0.5 * off * off)
            if way > 0:
                marks[j] *= np.exp(-bell * way / rubs_mm)
            marks[j] += (1 - marks[j]) * -np.expm1(-bell * h / grows_s)
        out[k] = marks[i] + (marks[i + 1] - marks[i]) * (place - i)
    return out


@effect("imprint", "fades", "rubbed_out")
def imprint(build: Build, shape: str, size: float) -> dict[str, float]:
    """A disordered pad remembers the depths at which it was held: it is stiffer just there when it passes them again.

    A bell of 0.06 to 0.1 of the depth, within 0.4 to 1.5 s of a hold. `fades`: within 8 to 25 s, whatever is done.
    `rubbed_out`: not by time, but by passing, by e within a way of 0.15 to 0.4 depths at the place.
    """
    rng, depth = build.rng, build.depth_mm
    more, width = 0.18 * size * spread(rng, 0.8, 1.25), depth * float(rng.uniform(0.06, 0.1))
    grows_s, fades_s, rubs = spread(rng, 0.4, 1.5), spread(rng, 8.0, 25.0), depth * spread(rng, 0.15, 0.4)
    fades_s, rubs = (fades_s, np.inf) if shape == "fades" else (np.inf, rubs)

    def gain(t, x):
        return 1 + more * _marks(x, float(t[1] - t[0]), width / 4, width, grows_s, fades_s, rubs)

    build.plant.gain.append(gain)
    return {"more": more, "width": width, "grows": grows_s}


def opens_per_s(load: np.ndarray, quick_per_s: float, catch: float, slip: float) -> np.ndarray:
    """Rate of opening by two ways, one that the load shuts and one that it opens: k (e^{−p/c} + e^{(p − 1)/s})."""
    return quick_per_s * (np.exp(-load / catch) + np.exp((load - 1) / slip))


@njit(cache=True)
def _closed_share(touching, opens, closes, h):
    """B' = k_on (1 − B) − k_off B; all open in air."""
    out, b = np.zeros(touching.shape[0]), 0.0
    for k in range(1, touching.shape[0]):
        total = closes + opens[k]
        b = closes / total + (b - closes / total) * np.exp(-total * h) if touching[k] else 0.0
        out[k] = b
    return out


@njit(cache=True)
def _closed_count(touching, opens, closes, h, waits):
    """The same of single bonds, each of which goes over when the integral of its rate has come to its next wait."""
    out, many = np.zeros(touching.shape[0]), waits.shape[0]
    shut, clock, n = np.zeros(many), np.zeros(many), np.zeros(many, dtype=np.int64)
    for k in range(1, touching.shape[0]):
        for i in range(many):
            if not touching[k]:
                shut[i] = 0.0
                continue
            clock[i] += h * (opens[k] if shut[i] > 0 else closes)
            if clock[i] > waits[i, n[i] % waits.shape[1]]:
                clock[i], shut[i], n[i] = 0.0, 1 - shut[i], n[i] + 1
        out[k] = shut.sum() / many
    return out


@effect("catch_bonds", "many", "few")
def catch_bonds(build: Build, shape: str, size: float) -> dict[str, float]:
    """Bonds across the pad, which bear with it, hold longest under a middling load, and open soon under less or more.

    They close within 0.3 to 1 s of contact and open within a tenth to a half of that without load or at the greatest.
    `many`: their share follows its mean. `few`: six of them, each by chance. In air all are open.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    more, closes = (0.22 if shape == "many" else 0.14) * size * spread(rng, 0.8, 1.25), 1 / spread(rng, 0.3, 1.0)
    quick, catch, slip = closes * spread(rng, 2.0, 10.0), float(rng.uniform(0.1, 0.2)), float(rng.uniform(0.1, 0.2))
    waits = _child(rng).exponential(1.0, (6, 2048))

    def gain(t, x):
        h, opens = float(t[1] - t[0]), opens_per_s(law.force(x) / most, quick, catch, slip)
        if shape == "many":
            return 1 + more * _closed_share(x > 0, opens, closes, h)
        return 1 + more * _closed_count(x > 0, opens, closes, h, waits)

    build.plant.gain.append(gain)
    return {"more": more, "closes": closes, "opens": quick, "catch": catch, "slip": slip}


@njit(cache=True)
def _hunts(u, h, per_s, late_s):
    """y' = −k (u + y)(t − T)."""
    y, back = np.zeros(u.shape[0]), int(np.round(late_s / h))
    for k in range(1, u.shape[0]):
        i = k - 1 - back
        y[k] = y[k - 1] - (per_s * h * (u[i] + y[i]) if i >= 0 else 0.0)
    return y


@njit(cache=True)
def _relay(u, h, vents_at, pumps_at, per_s, leaks_per_s):
    """A valve that lets y down from u + y = `vents_at` to 0, a pump that brings it up from −`pumps_at` to 0; a leak."""
    y, vents, pumps = np.zeros(u.shape[0]), False, False
    for k in range(1, u.shape[0]):
        off = u[k] + y[k - 1]
        vents = off > vents_at or (vents and off > 0)
        pumps = off < -pumps_at or (pumps and off < 0)
        flows = (per_s if pumps else 0.0) - (per_s if vents else 0.0)
        y[k] = y[k - 1] + h * (flows - leaks_per_s)
    return y


@effect("regulated", "hunts", "relay")
def regulated(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad has air in it, and a controller keeps its pressure where it is in air, whatever presses on it.

    `hunts`: it integrates what is too much, 0.25 to 0.6 s late, and overshoots, k T of 0.8 to 1.2. `relay`: a valve
    opens at 0.1 to 0.25 of what the greatest force brings, a pump as far below, and each shuts at no difference; it
    leaks, so that the pump comes back.
    """
    rng, share = build.rng, min(0.1 * size * spread(build.rng, 0.8, 1.25), 0.7)
    late_s, turns = spread(rng, 0.25, 0.6), float(rng.uniform(0.8, 1.2))
    at, per_s, leaks = float(rng.uniform(0.1, 0.25)), spread(rng, 0.5, 1.5), spread(rng, 0.08, 0.2)

    def part(t, depth, u):
        h, most = float(t[1] - t[0]), build.force_N
        if shape == "hunts":
            return share * _hunts(u, h, turns / late_s, late_s)
        return share * _relay(u, h, at * most, at * most, per_s * most, leaks * most)

    _added(build, part)
    return {"share": share, "late": late_s, "turns": turns}


@njit(cache=True)
def _turned(depth, goes_mm, comes_mm, needs_mm):
    """0 to 1: a turn takes a fabric of grains apart within one way and the way after it builds it up within another.

    All of it is taken apart where `needs_mm` is 0, else 1 − e^{−s/needs} after a way of s from the turn before.
    """
    out, w, waits, side, way = np.zeros(depth.shape[0]), 0.0, 0.0, 0, 0.0
    for k in range(1, depth.shape[0]):
        step = depth[k] - depth[k - 1]
        if step != 0.0:
            now = 1 if step > 0 else -1
            if side != 0 and now != side:
                waits = (1 - w) * (1.0 if needs_mm == 0 else -np.expm1(-way / needs_mm))
                way = 0.0
            side = now
            way += abs(step)
            falls = waits * -np.expm1(-abs(step) / goes_mm)
            waits -= falls
            w = (w + falls) * np.exp(-abs(step) / comes_mm)
        out[k] = w
    return out


@effect("fabric", "each_turn", "by_way_before")
def fabric(build: Build, shape: str, size: float) -> dict[str, float]:
    """Grains in a paste form chains along the way they are pressed; a turn takes them apart; new ones build up.

    By rest or by speed nothing changes, nor by how deep it has been. Apart within 0.01 to 0.03 of the depth, together
    within 0.15 to 0.4 of it. `by_way_before`: the more, the longer the way from the turn before was, within 0.5 to 1
    depths.
    """
    rng, depth = build.rng, build.depth_mm
    share = min((0.16 if shape == "each_turn" else 0.22) * size * spread(rng, 0.8, 1.25), 0.8)
    goes, comes, needs = (depth * spread(rng, *part) for part in ((0.01, 0.03), (0.15, 0.4), (0.5, 1.0)))
    needs = 0.0 if shape == "each_turn" else needs
    build.plant.gain.append(lambda t, x: 1 - share * _turned(np.maximum(x, 0.0), goes, comes, needs))
    return {"share": share, "goes": goes, "comes": comes}
