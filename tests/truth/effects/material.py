"""The pad itself: contact, adhesion, softening, damage, set, damping. Sources and equations: `kernel`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .registry import Build, effect, spread


@effect("separation", "clean", "late", contact="unilateral")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. `late`: the surface sticks up to a small tension first."""
    build.believed = replace(build.believed, contact="bonded")
    if shape == "late":
        build.plant.numbers["stick_N"] = 0.04 * size
    return {}


@effect("adhesion", "jkr", "neck", "exponential", contact="unilateral")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """−P at contact that snaps off at a gap, a neck that pulls up to P as it stretches, or −P e^{−gap/range}."""
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    form = {"exponential": 1, "jkr": 2, "neck": 3}[shape]
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=reach)
    return {"pull_off": pull_off, "range": reach}


@effect("stress_softening", "exponential", "ogden_roxburgh", "beatty")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s (1 − e^{−(δ_max − δ)/d}), 1 − s erf((W_max − W)/(w + β W_max)), e^{−a √((δ_max − δ)/d)}."""
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)
    deepest = build.depth_mm
    told = {"softening_share": share, "softening_mm": depth}
    form = {"exponential": 1, "ogden_roxburgh": 2, "beatty": 3}[shape]
    if shape == "ogden_roxburgh":
        # w such that the argument is near 1 at `depth` below the deepest point.
        at = np.linspace(deepest - min(depth, 0.8 * deepest), deepest, 101)
        force = build.plant.pad.law.force(at)
        told["softening_Nmm"] = float(np.sum((force[1:] + force[:-1]) / 2) * (at[1] - at[0])) * 0.8
    if shape == "beatty":
        told["softening_share"] = float(-np.log1p(-share) / np.sqrt(2.0))
    build.plant.numbers.update(told, softening_form=form)
    return {"share": share, "depth": depth}


@effect("damage", "exponential", "kachanov", "saturating")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """Per mm of loading λ: e^{−r λ}, dD/dλ = r/(1 − D)², 1 − D_∞ (1 − e^{−r λ/D_∞})."""
    rate = 0.01 * size * spread(build.rng, 0.6, 1.6)
    form = {"exponential": 1, "kachanov": 2, "saturating": 3}[shape]
    build.plant.numbers.update(damage_form=form, damage_per_mm=rate, damage_limit=float(build.rng.uniform(0.1, 0.3)))
    return {"rate": rate}


@effect("permanent_set", "linear", "saturating", "yield")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """s δ_max, s_∞ (1 − e^{−s δ_max/s_∞}), s max(0, δ_max − δ_y)."""
    rate = min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    form = {"linear": 1, "saturating": 2, "yield": 3}[shape]
    limit = {"linear": 1.0, "saturating": rate * build.depth_mm * 0.7, "yield": 0.15 * build.depth_mm}[shape]
    build.plant.numbers.update(set_form=form, set_mm_mm=rate, set_limit_mm=limit)
    return {"set": rate}


@effect("viscous_damping", "linear", "with_depth", "thinning")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v, c v δ/δ_ref with δ_ref half the greatest depth, c v_ref (v/v_ref)^0.7 with v_ref = 20 mm/s."""
    coefficient = size * spread(build.rng, 0.005, 0.02)
    form = {"linear": 1, "with_depth": 2, "thinning": 3}[shape]
    ref = {"linear": 1.0, "with_depth": build.depth_mm / 2, "thinning": 20.0}[shape]
    build.plant.numbers.update(damping_form=form, damping_Ns_mm=coefficient, damping_ref=ref)
    return {"coefficient": coefficient}
