"""Some seeds of the campaign, and that the campaign sees what it is to see."""

from __future__ import annotations

import pytest

from bench.run import safety
from tests.fault_campaign.__main__ import main, span
from tests.fault_campaign.draw import draw
from tests.fault_campaign.judge import again, judge
from tests.faults.faulty import bench_with, press

SEEDS = 200
IN_ONE_TEST = 20

EVERY_DAY = 20
"""Seeds below it; those beyond are of the long tests."""


@pytest.mark.parametrize(
    "first",
    [pytest.param(s, marks=[pytest.mark.long] if s >= EVERY_DAY else []) for s in range(0, SEEDS, IN_ONE_TEST)],
)
def test_what_never_bends(first):
    verdicts = [judge(seed) for seed in range(first, first + IN_ONE_TEST)]
    failed = [f"seed {v.seed}: {'; '.join(v.wrong)}\n{draw(v.seed).text()}" for v in verdicts if v.wrong]
    assert not failed, "\n".join(failed)


@pytest.mark.parametrize("seed", [3, 4])
def test_the_same_seed_writes_the_same_bytes(seed):
    verdict = judge(seed)
    assert verdict.content and not again(verdict)


def test_a_seed_stands_for_the_same_always_and_for_another_thing_than_the_next():
    assert draw(7).text() == draw(7).text()
    assert len({draw(seed).text() for seed in range(50)}) == 50


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_without_faults_none_of_these_runs_stops(tmp_path, seed):
    """Watchdogs that bark at nothing would hide in a campaign of faults."""
    drawn = draw(seed)
    seen = press(tmp_path, bench_with([], drawn.base, seed=seed, surface=drawn.surface_mm), drawn.protocol)
    assert (seen.how, seen.cause) == ("recovered", "")
    assert not seen.unsafe()


def test_a_run_whose_limits_do_nothing_is_found(monkeypatch):
    """A bench without its watchdogs: the campaign must not be content with it."""
    monkeypatch.setattr(safety.Monitor, "violate", lambda self, cause, *blame: None)
    assert any(judge(seed).wrong for seed in range(12))


def test_the_command_names_the_seeds_that_fail(monkeypatch, capsys):
    monkeypatch.setattr("tests.fault_campaign.__main__.tried", _failed)
    assert main(["--seeds", "5:7"]) == 1
    told = capsys.readouterr().out
    assert "seed 5: bent" in told and "--seeds 6 --show" in told and "2 failed" in told


def _failed(seed: int) -> object:
    from tests.fault_campaign.judge import Verdict

    return Verdict(seed, "stopped safely", "", ["bent"])


def test_seeds_as_people_write_them():
    assert list(span("4")) == [4]
    assert list(span("2:5")) == [2, 3, 4]
