"""A controller that makes its own moves is to be where it was sent, some time after; and none is blamed that is."""

from __future__ import annotations

import math

import pytest

from bench.run.safety import ARRIVED_MM, ARRIVES_S, Envelope, Monitor
from drivers.motor import MotorSample
from tests.faults.faulty import bench_with, press


def judged(off_mm: float, over_s: float, watched: bool = True) -> Monitor:
    """What a monitor whose following error is 3 mm makes of an axis that stands so far off."""
    monitor = Monitor(Envelope(20.0, 5.0, 50.0, (-5.0, 6.0), 100.0, 3.0, 0.3))
    monitor.watch_following = watched
    monitor.motor(MotorSample(1.0, 1.0, 2.0 + off_mm, None, 0, False), 2.0, (), 0.0, over_s)
    return monitor


def test_an_axis_that_does_not_get_there_is_not_trusted():
    for off_mm in (1.0, -1.0, 1.01 * ARRIVED_MM):
        monitor = judged(off_mm, 1.01 * ARRIVES_S)
        assert monitor.cause is not None and "did not get where it was sent: 2.000 mm" in monitor.cause
        assert monitor.blame == "motor" and monitor.motor_lost


@pytest.mark.parametrize(("off_mm", "over_s"), [(1.0, 0.0), (1.0, 0.9 * ARRIVES_S), (0.9 * ARRIVED_MM, math.inf)])
def test_one_that_is_on_its_way_or_within_its_band_is(off_mm, over_s):
    assert judged(off_mm, over_s).cause is None


def test_nobody_is_judged_who_moves_by_himself():
    assert judged(1.0, 2.0, watched=False).cause is None


@pytest.mark.parametrize("bench", ["simulated_iai", "simulated_smc_lec"])
@pytest.mark.parametrize("orders", [{}, {"rate_per_s": 3.0}])
def test_a_polled_axis_that_arrives_is_not_blamed(tmp_path, bench, orders):
    """Without a fault, and with messages that are lost now and then, so that its moves begin later."""
    faults = [{"kind": "bytes_lost", "device": "motor", **orders}] if orders else []
    seen = press(tmp_path, bench_with(faults, bench, seed=5))
    assert seen.how == "recovered", seen.cause
