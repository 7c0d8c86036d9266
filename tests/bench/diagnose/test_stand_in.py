"""The short stand-in on which causes are searched: what a model makes of it is what it makes of the samples."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.data import prepare
from bench.diagnose.numbers import PadNumbers, Structure
from bench.diagnose.refit import force_at
from bench.recording.types import Measurement
from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation

PAD = Pad(Exponential(4.0, 0.4), Relaxation((0.2, 0.15), (11.0, 1.6)), unilateral=True)


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
    means = np.bincount(p.owner, weights=full * p.full.weight) / np.maximum(np.bincount(p.owner, p.full.weight), 1e-9)
    off = np.where(p.short.weight > 0, (short - means) / p.short.total_N, 0.0) * np.sqrt(p.short.weight)
    assert p.short.size < 0.6 * p.full.size
    assert np.sum(off**2) < 0.1 * np.count_nonzero(p.short.weight > 0)
