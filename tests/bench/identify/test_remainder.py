"""What is left of a fit, in words: a pattern put into the data is the one that is told."""

from __future__ import annotations

import numpy as np
import pytest

from bench.identify import fit
from bench.identify.remainder import gist, is_foreign, patterns, sentence
from bench.recording.types import Measurement
from tests.truth.laws import Exponential, Tanh
from tests.truth.motion import Path
from tests.truth.pad import Pad, simulate

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35), "bonded")


def cycles(pad: Pad = PAD, noise_N: float = 0.005) -> Measurement:
    path = Path(-0.5).hold(1)
    for speed in (5.0, 0.7, 2.0, 5.0, 1.0):
        path.to(2.0, speed).hold(2).to(-0.5, speed).hold(2)
    motion = path.motion()
    time = np.arange(0, motion.duration_s, 0.01)
    F = simulate(pad, motion, time).force_N + noise_N * np.random.default_rng(0).standard_normal(len(time))
    return Measurement("cycles", time, motion.position(time), time, F)


def strongest(m: Measurement, **options: object) -> str:
    return patterns(fit(m, order=2, **options))[0].name  # type: ignore[arg-type]


def test_nothing_is_left_of_a_good_fit() -> None:
    result = fit(cycles(), law="exponential", order=2)
    assert patterns(result) == [] and gist(result) == "" and sentence(result).startswith("Nothing plain")


def test_friction() -> None:
    m = cycles()
    m.force_N = m.force_N + 0.3 * np.sign(np.gradient(m.position_mm, m.force_time_s).round(6))
    assert strongest(m, law="exponential") == "direction"


def test_drift_and_offset() -> None:
    m = cycles()
    m.force_N = m.force_N + 0.01 * m.force_time_s
    assert strongest(m, law="exponential") in ("drift", "level")


def test_law_of_another_shape() -> None:
    m = cycles(Pad(Tanh(3.0, 0.5, 0.6), (0.25, 0.15), (4.0, 0.35), "bonded"))
    assert strongest(m, law="exponential") == "depth"


def test_late_force() -> None:
    m = cycles()
    m.force_N = np.interp(m.force_time_s - 0.05, m.force_time_s, m.force_N)
    assert strongest(m, law="exponential", contact="bonded") in ("late", "speed")


def test_softening() -> None:
    m = cycles()
    m.force_N = m.force_N * (1 - 0.004 * m.force_time_s)
    assert strongest(m, law="exponential") == "cycles"


def test_what_is_no_pad_is_said_to_be_none() -> None:
    m = cycles()
    m.force_N = 5 * np.sign(np.gradient(m.position_mm, m.force_time_s).round(6)) + 0.01 * m.force_N
    result = fit(m, order=1)
    assert is_foreign(result)
    assert "does not describe" in sentence(result) and "direction of motion" in sentence(result)


def test_places_where_no_pattern_fits() -> None:
    m = cycles()
    moving = np.abs(np.gradient(m.position_mm)) > 1e-4
    shake = np.random.default_rng(1).standard_normal(len(moving))
    m.force_N = m.force_N + np.where(moving, 0.2 * shake, 0.0)
    assert "lies in the moves" in gist(fit(m, law="exponential", order=2))


@pytest.mark.parametrize("most", [1, 2])
def test_gist_is_short(most: int) -> None:
    m = cycles()
    m.force_N = m.force_N + 0.3 * np.sign(np.gradient(m.position_mm)) + 0.02 * m.force_time_s
    assert gist(fit(m, law="exponential", order=2), most).count(" % ") <= most
