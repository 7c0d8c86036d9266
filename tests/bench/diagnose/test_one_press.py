"""One press from far above, without a touch-off: the surface is where the force begins, and not where nobody looked."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.data import prepare
from bench.diagnose.remains import remains
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import null_case
from tests.truth.laws import Power
from tests.truth.motion import Path
from tests.truth.pad import Pad, simulate

HERTZ = Pad(Power(30.0, 0.5), (0.3,), (0.6,))
BELIEVED = Pad(Power(24.0, 0.5), (0.25,), (0.8,))


def pressed(above_mm: float, seed: int) -> Measurement:
    """0.6 mm into a pad at 0.08 mm/s, in positions that begin so far above it, at 8 Hz; 5 mN of noise."""
    motion = Path(-above_mm).to(0.6, 0.08).motion()
    t = np.arange(0.0, motion.duration_s, 0.125)
    force = simulate(HERTZ, motion, t).force_N + 0.005 * np.random.default_rng(seed).standard_normal(len(t))
    x = np.asarray(motion.position(t))
    return Measurement("press", t, x + above_mm, t, force)


@pytest.mark.parametrize(
    ("above_mm", "seed"),
    [(2.0, 0), pytest.param(0.3, 1, marks=pytest.mark.long), pytest.param(3.0, 2, marks=pytest.mark.long)],
)
def test_a_surface_that_nobody_looked_for_is_found(above_mm: float, seed: int) -> None:
    d = diagnose(pressed(above_mm, seed), Model.from_dict(BELIEVED.model()))
    assert d.causes and d.causes[0].id == "contact_offset"
    offset = d.causes[0].parameters["offset"]
    assert abs(offset.value - above_mm) < max(0.01 * above_mm, 3.0 * offset.std)
    assert d.held_out_after < 0.1 * d.held_out_before


def test_what_goes_deeper_than_all_else_is_not_held_out() -> None:
    """A law that was fitted to what is shallower says nothing of it; elsewhere every sample is held out once."""
    m = pressed(1.0, 0)
    fold = prepare(m, np.ones(len(m.force_N), dtype=bool)).full.fold
    assert set(fold.tolist()) == {-1, 0, 1, 2, 3, 4}
    assert np.all(np.flatnonzero(fold == -1) > 0.9 * len(fold))
    for protocol in ("staircase", "rich", "rate_sweep"):
        m = measurement(null_case(3, protocol=protocol))
        assert prepare(m, np.ones(len(m.force_N), dtype=bool)).full.fold.min() == 0


def test_no_test_asks_for_what_a_run_does_not_hold() -> None:
    """One way in at one speed: no way out, no other speed and no rest can differ from it."""
    m = pressed(0.0, 0)
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    residual = 0.1 * np.sin(3.0 * p.full.time_s)
    asked = {r.name for r in remains(p.full, residual, 2, None)}
    assert {"depth", "time", "memory"} <= asked and not asked & {"way", "speed", "phase"}
    m = measurement(null_case(3, protocol="staircase"))
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    asked = {r.name for r in remains(p.full, 0.1 * np.sin(3.0 * p.full.time_s), 2, None)}
    assert asked == {"depth", "way", "time", "speed", "phase", "corner", "memory"}
