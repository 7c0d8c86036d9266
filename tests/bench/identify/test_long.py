"""Very long data: worked on in blocks and pieces, with the same answer and in memory that does not grow."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from bench.identify import fit, long, motion, problem
from bench.identify.long import shortened, stretches
from bench.recording.types import Measurement
from tests.truth.draw import POLYURETHANE
from tests.truth.motion import staircase
from tests.truth.pad import simulate


def data(rate_hz: float = 2000.0) -> Measurement:
    path = staircase([0.6, 1.2, 2.4, 1.2, -0.5], 60.0, 4.0)
    t = np.arange(0, path.duration_s, 1 / rate_hz)
    F = simulate(POLYURETHANE, path, t).force_N + 0.02 * np.random.default_rng(2).standard_normal(len(t))
    return Measurement("long", t, path.position(t), t, F)


def two_clocks() -> Measurement:
    m = data()
    return replace(m, position_time_s=m.position_time_s[::3], position_mm=m.position_mm[::3])


@pytest.fixture
def _short_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "LONG", 15_000)
    monkeypatch.setattr(long, "LONG", 15_000)
    monkeypatch.setattr(problem, "LONG", 15_000)
    monkeypatch.setattr(long, "ROWS", 12_000)
    monkeypatch.setattr(long, "PIECE", 1000)
    monkeypatch.setattr(problem, "PIECE", 1000)


@pytest.mark.usefixtures("_short_is_long")
@pytest.mark.parametrize("make", [data, two_clocks])
def test_pieces_are_the_whole(make) -> None:
    m = make()
    pieces = list(stretches(m))
    assert len(pieces) > 10
    assert [s.forces.start for s in pieces[1:]] == [s.forces.stop for s in pieces[:-1]]
    time = np.concatenate([s.time_s for s in pieces])
    np.testing.assert_allclose(time, np.union1d(m.position_time_s, m.force_time_s), atol=1e-9)
    position = np.concatenate([s.position_mm for s in pieces])
    np.testing.assert_allclose(position, np.interp(time, m.position_time_s, m.position_mm), atol=1e-12)
    at_force = np.concatenate([s.time_s[s.at] for s in pieces])
    np.testing.assert_allclose(at_force, m.force_time_s, atol=1e-9)


@pytest.mark.usefixtures("_short_is_long")
@pytest.mark.parametrize("make", [data, two_clocks])
def test_blocks_weigh_and_mean_the_same(make) -> None:
    m = make()
    run = shortened(m, 2.4, 10.0)
    y = m.force_N / 10.0
    assert run.size < 0.7 * len(np.union1d(m.position_time_s, m.force_time_s)) and np.all(np.diff(run.time_s) > 0)
    assert run.weight.sum() == len(y)
    assert run.weight @ run.y == pytest.approx(y.sum())
    assert run.weight @ run.y**2 < y @ y  # means scatter less


@pytest.mark.usefixtures("_short_is_long")
def test_no_block_is_empty_where_data_begin_in_motion() -> None:
    """The second sample has a block of its own anyway then, beside the first, which stays alone."""
    m = data()
    t, x = m.force_time_s, m.position_mm + 500.0 * np.exp(-m.force_time_s / 1e-3)  # a jump of 200 mm in one sample
    run = shortened(replace(m, position_mm=x), 2.4, 5.0)
    assert all(np.isfinite(column).all() for column in (run.time_s, run.u, run.y))
    assert run.weight.sum() == len(t)


@pytest.mark.parametrize("make", [data, two_clocks])
def test_the_answer_is_the_same(make, request: pytest.FixtureRequest) -> None:
    whole = fit(make(), law="exponential", order=2)
    request.getfixturevalue("_short_is_long")
    blocks = fit(make(), law="exponential", order=2)
    for name, p in whole.parameters.items():
        assert abs(blocks.parameters[name].value - p.value) < 0.5 * p.std, name
        assert blocks.parameters[name].std == pytest.approx(p.std, rel=0.15), name
    assert blocks.samples == whole.samples
    assert blocks.rmse == pytest.approx(whole.rmse, rel=1e-3)
    assert blocks.fit_percent == pytest.approx(whole.fit_percent, abs=0.01)
    assert blocks.noise_floor == pytest.approx(whole.noise_floor, rel=0.05)
    # in fast ramps straight lines between two clocks' samples are a little off; nowhere else
    off = blocks.simulated - whole.simulated
    assert np.sqrt(np.mean(off**2)) < 1e-3 and np.abs(off).max() < 0.03
    chosen = next(e for e in blocks.evidence if e.chosen)
    assert pytest.approx(blocks.V, rel=1e-3) == chosen.V


MEMORY = """
import sys
import numpy as np
from bench.identify import fit
from bench.recording.types import Measurement
from sim.model import Model

PAD = {"elastic": {"law": "exponential", "m": 2.24, "b": 0.69}, "relaxation": {"shares": [0.3], "rates": [2.0]}}

def held() -> float:
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) / 1e3 for line in status if line.startswith("VmHWM"))

def measured(n):
    t = np.arange(n) * 1e-4
    x = np.interp(t, t[-1] * np.array([0, 0.1, 0.11, 0.5, 0.51, 1]), [-0.5, -0.5, 1, 1, 2, 2])
    F = Model.from_dict({"pad": PAD}).simulate(t, x) + 0.01 * np.random.default_rng(1).standard_normal(n)
    return Measurement("long", t, x, t, F)

fit(measured(20_000), law="exponential", order=1)
m = measured(int(sys.argv[1]))
open("/proc/self/clear_refs", "w").write("5")
before = held()
fit(m, law="exponential", order=1)
print(held() - before)
"""


@pytest.mark.long
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak is read from /proc")
def test_memory_does_not_grow_with_the_data() -> None:
    peak = {}
    for samples in (700_000, 2_100_000):
        done = subprocess.run(
            [sys.executable, "-c", MEMORY, str(samples)], capture_output=True, text=True, check=True, timeout=120
        )
        peak[samples] = float(done.stdout)
    # The simulated force and the mask of a sample are 9 bytes in the answer; the input is 24.
    assert peak[2_100_000] - peak[700_000] < 1.4 * 20
