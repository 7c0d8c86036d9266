"""A load cell that jumps in the middle of a slow ramp, below every limit."""

from __future__ import annotations

import pytest

from tests.faults.faulty import SHORT, bench_with, press

SLOWLY = SHORT | {"steps": [{"to": 1.2, "speed": 1.0, "hold": 0.1}]}


@pytest.mark.parametrize("bench", ["simulated", "simulated_laumas", "simulated_balance", "simulated_iai"])
def test_it_is_noticed(tmp_path, bench):
    fault = {"kind": "force_jump", "step": "steps[0]", "after_s": 0.9, "by_N": -1.5}
    seen = press(tmp_path, bench_with([fault], bench), SLOWLY)
    assert seen.how == "stopped safely"
    assert "jumped" in seen.cause and "while the axis moved evenly" in seen.cause
    assert not seen.unsafe(deceived=True)


@pytest.mark.parametrize("bench", ["simulated", "simulated_laumas", "simulated_balance", "simulated_iai"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in (1, 2))])
def test_and_the_ramp_alone_is_no_jump(tmp_path, bench, seed):
    seen = press(tmp_path, bench_with([], bench, seed=seed), SLOWLY)
    assert seen.how == "recovered", seen.cause
