"""Reading steps for foreign data: each does what it says, and leaves a note."""

from __future__ import annotations

import numpy as np
import pytest

from bench.errors import InputError
from bench.identify import fit
from bench.identify.prepare import baseline_removed, contact_of, force_zeroed, indentation, surface_at
from bench.recording.types import Measurement
from tests.truth.laws import Power
from tests.truth.motion import Path
from tests.truth.pad import Pad, simulate

PAD = Pad(Power(2.0, 0.5), (0.3,), (1.0,))


def curve(noise: float = 0.002) -> Measurement:
    """An approach from far away, a hold, back again; N and mm of size one."""
    motion = Path(-3.0).hold(0.2).to(1.0, 1.0).hold(4).to(-3.0, 1.0).motion()
    time = np.arange(0, motion.duration_s, 0.005)
    F = simulate(PAD, motion, time).force_N + noise * np.random.default_rng(0).standard_normal(len(time))
    return Measurement("curve", time, motion.position(time), time, F)


def test_an_afm_curve_from_raw_to_fit() -> None:
    """Height from an arbitrary zero, a tilted baseline, a soft cantilever: all three come off."""
    m = curve()
    stiffness = 3.0
    raw = Measurement("raw", m.position_time_s, m.position_mm + m.force_N / stiffness + 8.0, m.force_time_s,
                      m.force_N + 0.4 + 0.02 * m.position_mm)  # fmt: skip
    first = contact_of(raw)
    assert first == pytest.approx(8.0, abs=0.06)
    bent = indentation(baseline_removed(raw, first), stiffness)
    ready = surface_at(bent, contact_of(bent))
    assert len(ready.notes) == 3
    result = fit(ready, law="power", order=1)
    assert result.parameters["q"].value == pytest.approx(0.5, abs=0.1)
    assert result.parameters["nu_1"].value == pytest.approx(1.0, rel=0.1)


def test_zero_of_the_force() -> None:
    m = curve()
    shifted = Measurement("m", m.position_time_s, m.position_mm, m.force_time_s, m.force_N + 0.7)
    assert np.mean(force_zeroed(shifted, 100).force_N[:100]) == pytest.approx(0, abs=1e-12)
    with pytest.raises(InputError):
        force_zeroed(shifted, 2)


def test_no_contact_is_refused() -> None:
    m = curve()
    air = Measurement("air", m.position_time_s, m.position_mm, m.force_time_s, 0.01 * np.sin(37 * m.force_time_s**2))
    with pytest.raises(InputError, match="never rises"):
        contact_of(air)
    with pytest.raises(InputError, match="out of contact"):
        baseline_removed(m, -3.5)
