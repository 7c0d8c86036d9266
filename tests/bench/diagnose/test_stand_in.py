"""The short stand-in on which causes are searched: what a model makes of it is what it makes of the samples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.diagnose.data import Prepared, prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.numbers import PadNumbers, Structure, cause_of
from bench.diagnose.refit import force_at
from bench.recording.types import Measurement
from sim.effects import effect
from sim.effects.base import Active
from sim.elastic import Exponential
from sim.model import Model
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case

Array = NDArray[np.float64]

PAD = Pad(Exponential(4.0, 0.4), Relaxation((0.2, 0.15), (11.0, 1.6)), unilateral=True)


def _means(p: Prepared, force_N: Array) -> Array:
    """What forces at the samples are over the stand-in's blocks."""
    return np.bincount(p.owner, force_N * p.full.weight) / np.maximum(np.bincount(p.owner, p.full.weight), 1e-9)


@pytest.mark.parametrize("cycles_Hz", [0.7, 1.5])
@pytest.mark.parametrize("seed", [1, 2])
def test_it_hides_no_rest_that_a_motion_without_corners_comes_to(cycles_Hz: float, seed: int) -> None:
    """Cycles that grow, as of a crank, and a hold: blocks grow with the time since the last corner, which is the first
    touch; four of them were all the hold, and an error of 3 σ of a sample in a mean over a thousand."""
    t = np.arange(0.0, 22.0, 1.0 / 1250.0)
    swing = 0.2 + 0.09 * np.clip(t - 1.5, 0.0, None) * 0.5 * (1.0 - np.cos(2 * np.pi * cycles_Hz * (t - 1.5)))
    ends_s = 1.5 + (np.floor(14.0 * cycles_Hz) + 0.5) / cycles_Hz  # at a crest, as the last of the cycles
    crest = float(np.interp(ends_s, t, swing))
    x = np.where(t < ends_s, swing, crest)
    x = np.where(t < 1.5, -0.5 + 0.35 * (1.0 - np.cos(np.pi * np.clip(t - 1.0, 0.0, 0.5) / 0.5)), x)
    x = x - (crest + 0.5) * np.clip((t - ends_s - 3.0) / 0.05, 0.0, 1.0)
    rng = np.random.default_rng(seed)
    force = Cascade(PAD).simulate(t, x) + 0.01 * rng.standard_normal(t.size)
    read = x + 1e-4 * rng.standard_normal(t.size)
    p = prepare(Measurement("crank", t, read, t, force), np.ones(t.size, dtype=bool))
    structure = Structure(PadNumbers(PAD, float(x.max()), float(force.max())))
    full, short = (force_at(data, structure, structure.pad.x()) for data in (p.full, p.short))
    off = np.where(p.short.weight > 0, (short - _means(p, full)) / p.short.total_N, 0.0) * np.sqrt(p.short.weight)
    assert p.short.size < 0.6 * p.full.size
    assert np.sum(off**2) < 0.1 * np.count_nonzero(p.short.weight > 0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_late_force_answers_to_when_a_move_began_between_two_forces(seed: int) -> None:
    """Positions at 1 kHz, forces at 100 Hz as of a balance, late by half a sample: the motion between them counts. A
    stand-in without a move's first milliseconds was off by 2 to 3 σ in some forces here, and by 12 σ on a bench."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 14.0, 1e-3)
    x = np.full(t.size, -0.2)
    for i, way in enumerate((0.8, 0.6, 0.6, -0.6, -0.6)):
        begun = t - (1.0 + 2.0 * i + rng.uniform(0.0, 0.01))
        rise_s, speed = 0.012, 60.0
        cruise_s = abs(way) / speed - rise_s
        ramp = np.clip(begun, 0.0, rise_s) ** 2 / (2 * rise_s) + np.clip(begun - rise_s, 0.0, max(cruise_s, 0.0))
        rest = np.clip(begun - rise_s - max(cruise_s, 0.0), 0.0, rise_s)
        gone = ramp + rest - rest**2 / (2 * rise_s)
        x = x + way * gone / gone[-1]
    fine = np.arange(0.0, 13.9, 1e-4)
    read_s = np.arange(0.0102, 13.8, 0.01)
    late_N = np.interp(read_s - 0.005, fine, Cascade(PAD).simulate(fine, np.interp(fine, t, x)))
    force = late_N + 0.01 * rng.standard_normal(read_s.size)
    m = Measurement("balance", t, x + 5e-4 * rng.standard_normal(t.size), read_s, force)
    p = prepare(m, np.ones(read_s.size, dtype=bool))
    pad = Structure(PadNumbers(PAD, float(x.max()), float(force.max())))
    late = pad.with_cause(cause_of(effect("force_delay"), effect("force_delay").form("constant"), {"delay": 0.005}))
    full, short = (force_at(data, late, late.x(pad.pad.x())) for data in (p.full, p.short))
    off = np.where(p.short.weight > 0, (short - _means(p, full)) / p.short.total_N, 0.0) * np.sqrt(p.short.weight)
    assert p.short.size < 0.4 * p.full.size
    assert np.abs(off).max() < 1.0 and np.sum(off**2) < 0.1 * np.count_nonzero(p.short.weight > 0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_force_whose_clock_is_far_off_steps_long_after_the_position(seed: int) -> None:
    """2000 ppm are 0.1 s after 50 s: blocks of a hold had grown over the force's own step, whose means were far off."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 0.005)
    levels = np.concatenate([[-0.2], rng.permutation(np.arange(0.5, 2.3, 0.3)), [0.95, 1.65, 0.4, 1.2, -0.2]])
    x = np.full(t.size, levels[0])
    for i, (a, b) in enumerate(zip(levels, levels[1:], strict=False)):
        x = x + (b - a) * np.clip((t - 2.0 - 4.5 * i) * 25.0 / abs(b - a), 0.0, 1.0)
    skew = -2000.0
    pad = Structure(PadNumbers(PAD, float(x.max()), 10.0))
    clock = pad.with_cause(cause_of(effect("clock_skew"), effect("clock_skew").form("linear"), {"skew": skew}))
    clean = Cascade(PAD, [Active(c.effect, c.form, {"skew": skew}) for c in clock.causes]).simulate(t, x)
    p = prepare(
        Measurement("clocks", t, x, t, clean + 0.006 * rng.standard_normal(t.size)), np.ones(t.size, dtype=bool)
    )
    full, short = (force_at(data, clock, clock.x(pad.pad.x())) for data in (p.full, p.short))
    off = np.where(p.short.weight > 0, (short - _means(p, full)) / p.short.total_N, 0.0) * np.sqrt(p.short.weight)
    assert p.short.size < 0.5 * p.full.size
    assert np.abs(off).max() < 2.0 and np.sum(off**2) < 0.1 * np.count_nonzero(p.short.weight > 0)


@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (2, 3))])
def test_a_mass_that_rings_feels_a_planned_move_begin_when_it_does(seed: int) -> None:
    """Where the acceleration jumps between two samples, in a block of a rest it would do so a whole block earlier."""
    c = draw_case(seed, (), protocol="random_steps", rate_hz=400.0, jitter="none", own_clock=False, noise_N=0.005)
    m = measurement(c)
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    pad = believed_structure(Model.from_dict(c.believed), p)
    rings = {"mass": 0.1, "share": 0.5, "frequency": 100.0, "damping_ratio": 0.08, "window": 2e-5, "lead": 0.0}
    x = pad.pad.x()
    mass = pad.with_cause(cause_of(effect("inertia"), effect("inertia").form("hung"), rings))
    felt = [force_at(d, mass, mass.x(x)) - force_at(d, pad, x) for d in (p.full, p.short)]
    means = _means(p, felt[0])
    counts = p.short.weight > 0
    assert p.short.size < 0.6 * p.full.size
    assert np.sum((felt[1] - means)[counts] ** 2) < 0.02 * np.sum(means[counts] ** 2)
