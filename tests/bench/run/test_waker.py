"""A signal wakes a loop that waits: on the wall clock its pipe is among what a wait ends for."""

from __future__ import annotations

import pytest

from bench.config import load_bench
from bench.daily.open_bench import OpenBench
from bench.run.signals import listening
from tests.bench.run.benches import bench_file


@pytest.mark.parametrize(("clock", "wakes"), [("wall", True), ("virtual", False)])
def test_the_pipe_of_signals_ends_a_wait(tmp_path, monkeypatch, clock, wakes):
    with OpenBench(load_bench(bench_file(tmp_path, simulation={"clock": clock}))) as work:
        waited: list[object] = []
        wait = work.clock.wait

        def noted(ports, until_s):
            waited.extend(ports)
            return wait(ports, until_s)

        monkeypatch.setattr(work.clock, "wait", noted)
        with listening(work.operator):
            assert work.operator.waker is not None
            work.loop.run(work.loop.sleep(0.01))
            assert (work.operator.waker in waited) == wakes
