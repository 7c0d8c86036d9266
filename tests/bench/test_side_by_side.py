"""The page that holds padbench against other tools: its model, its tools, and how it counts."""

from __future__ import annotations

import numpy as np
import pytest

from docs import side_by_side as page
from docs import side_by_side_tools as tools
from tests.truth import draw
from tests.truth.laws import Exponential
from tests.truth.pad import Pad, simulate

GEL = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35), "bonded")
NUMBERS = (2.24, 0.69, 0.25, 0.15, 4.0, 0.35)


def training(noise_N: float = 0.0, speed_mm_s: float = 10.0, rate_hz: float = 200.0) -> tools.Training:
    motion = page.learned(2.4, speed_mm_s)
    t = np.arange(0, motion.duration_s, 1 / rate_hz)
    force = simulate(GEL, motion, t).force_N + noise_N * np.random.default_rng(0).standard_normal(len(t))
    return tools.Training(t, motion.position(t), force, False)


def test_the_plain_model_is_the_paper_s():
    data = training(rate_hz=500.0)
    off = tools.plain(False, data.time_s, data.depth_mm, *NUMBERS) - data.force_N
    assert np.max(np.abs(off)) < 1e-4 * data.force_N.max()
    assert np.min(tools.plain(True, data.time_s, data.depth_mm, *NUMBERS)) == 0.0 > data.force_N.min()


@pytest.mark.parametrize(("tool", "needs", "within"), [
    (tools.by_curve_fit, "scipy", 0.01),
    (tools.by_lmfit, "lmfit", 0.01),
    (tools.by_padbench, "scipy", 0.01),
    (tools.by_prony, "scipy", 1.0),  # right in kind, wrong by what relaxes within the ramp
])  # fmt: skip
def test_tools_find_the_pad(tool, needs, within):
    pytest.importorskip(needs)
    found = tool(training(0.001)).numbers
    assert max(abs(found[n] / x - 1) for n, x in zip(tools.NAMES, NUMBERS, strict=True)) < within


def test_prony_is_wrong_by_the_ramp_and_less_so_by_a_quick_one():
    c = [tools.by_prony(training(0.001, speed)).numbers["c_1"] for speed in (3.0, 100.0)]
    assert c[0] < c[1] < 0.25 and abs(c[1] - 0.25) < 0.03


def test_the_black_box_follows_the_force_and_has_no_numbers():
    pytest.importorskip("sysidentpy")
    data = training(0.01, 60.0)
    found = tools.by_sysidentpy(data)
    off = found.predict(data.time_s, data.depth_mm) - data.force_N
    assert found.numbers == {} and np.std(off) < 0.05 * data.force_N.max()


def test_it_counts_what_is_lost_and_who_wins():
    def outcome(tool: str, seed: int, unseen: float, seconds: float = 1.0) -> page.Outcome:
        return page.Outcome(0, page.NOISES[0], seed, tool, {"m": 0.02} if unseen < 1 else {}, unseen, seconds)

    mine, other = page.OWN, "scipy `curve_fit`"
    rows = [outcome(mine, 0, 0.010), outcome(other, 0, 0.0101, 0.5), outcome(mine, 1, 0.020), outcome(other, 1, np.inf)]
    rows += [outcome(mine, 2, 0.020), outcome(other, 2, 0.010, 0.5)]
    lines = page.table(rows)
    assert "1 of 3" in lines[2] and lines[2].startswith(f"| {other} ") and "0 of 3" in lines[3]
    won = page.wins(rows)
    assert "| 2 of 3 |" in won[2] and "| 2 of 3 |" in won[3]
    (said,) = page.against_own(rows)
    assert "better than padbench (told the same) in 1 of 3 data sets, as good in 1, worse in 1; 2 times quicker" in said
    assert "Who wins where" in page.page(rows, 3)


def test_the_pads_are_those_of_the_seeds():
    one = draw.pad(np.random.default_rng([page.SEED, 0, 0]), ["exponential"], (2,), ("bonded",))
    assert set(one.pad.parameters()) == set(tools.NAMES)
    assert page.learned(one.depth_mm, 60.0).duration_s > 20 and page.unseen(one.depth_mm).duration_s > 10
