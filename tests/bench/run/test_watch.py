"""The watchdogs of a run, each alone and on a simulated bench. Numbers are closed forms, never the code's own."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pytest
import yaml

from bench.run import approach, watch
from bench.run.safety import Envelope, Monitor
from bench.run.watch import FrozenWatch, SenseWatch
from bench.shipped import find_file, shipped_names
from drivers.clock import WallClock
from drivers.loadcell import ForceSample
from drivers.motor import MotorSample
from tests.bench.run.benches import merged, once, run
from tests.bench.run.test_stop import BOTH, DEEP, in_hold, in_ramp, stopped_well


def envelope(**changes: Any) -> Envelope:
    given: dict[str, Any] = {
        "force_N": 20.0,
        "tension_N": 5.0,
        "gross_N": 50.0,
        "position_mm": (-5.0, 6.0),
        "speed_mm_s": 200.0,
        "following_error_mm": 0.5,
        "stale_s": 0.05,
    }
    return Envelope(**{**given, **changes})


def force(time_s: float, gross_N: float, *flags: str, late_s: float = 0.001) -> ForceSample:
    return ForceSample(time_s, time_s + late_s, gross_N, flags)


# -- a cell that is frozen -------------------------------------------------------------------------------------------


def frozen_after(readings: np.ndarray, rate_Hz: float = 500.0) -> int | None:
    """Equal readings until it is noticed, having learned from these in air; None where it never is."""
    monitor = FrozenWatch()
    monitor.expect(rate_Hz, 0.05)
    for reading in readings:
        assert monitor.sample(float(reading)) is None, "its own noise is no alarm"
    if not monitor.learned():
        return None
    last = float(readings[-1])
    return next(n for n in range(1, 100_000) if monitor.sample(last) is not None)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("digit_N", "most"), [(0.001, 100), (0.005, 200), (0.01, 1000)])
def test_a_cell_that_repeats_itself_is_frozen(seed, digit_N, most):
    """Noise of 10 mN and digits of 1, 5, 10 mN. Wherever the force lies in a digit, its own repeats are no alarm."""
    noise = np.random.default_rng(seed).normal(0.0, 0.01, 1000)
    n = frozen_after(np.round(noise / digit_N) * digit_N)
    assert n is not None and 25 <= n <= most
    again = np.random.default_rng(seed + 100).normal(0.0, 0.01, 500_000)
    for place in (0.0, 0.25, 0.5):  # of a digit
        counts = np.round(again / digit_N + place)
        ends = np.flatnonzero(np.diff(counts)) + 1
        assert np.diff(ends).max() < n, "a quarter of an hour of its noise never repeats so often"


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("digit_N", [0.03, 0.05])
def test_air_between_two_digits_is_not_taken_for_noise(seed, digit_N):
    """A digit of three to five sigma: in air it may flicker, in the middle of a digit a force stands still for long."""
    noise = np.random.default_rng(seed).normal(0.0, 0.01, 1000)
    assert frozen_after(np.round(noise / digit_N + 0.5) * digit_N) is None


@pytest.mark.parametrize("lag", [5, 50])
def test_a_filtered_cell_repeats_itself_more_often(lag):
    """Neighbours of a slow filter are alike, so that their repeats are not independent."""
    white = np.random.default_rng(3).normal(0.0, 1.0, 401_000)
    slow = np.convolve(white, np.exp(-np.arange(10 * lag) / lag), "full")[1000:401_000]
    counts = np.round(2.0 * slow / slow.std())
    n = frozen_after(counts[:1000])
    assert n is not None
    assert np.diff(np.flatnonzero(np.diff(counts)) + 1).max() < n


def test_a_cell_whose_digit_hides_its_noise_cannot_be_watched():
    assert frozen_after(np.zeros(1000)) is None


@BOTH
def test_a_cell_that_freezes_in_the_ramp(tmp_path, base):
    """Its frames keep coming, each with a good checksum, and say what they said before."""

    def freeze(world: Any, bench_s: float) -> None:
        amplifier = world.devices["load_cell"].amplifier
        last = amplifier.gross(bench_s)
        amplifier.gross = lambda at_s: last

    slow = merged(DEEP, {"steps": [{"to": 2.0, "speed": 4, "hold": 1.0}]})
    done = run(tmp_path, slow, base, hook=once(in_ramp, freeze))
    stopped_well(done, r"^the load cell is frozen: \d+ readings of exactly -?[\d.e-]+ N")
    cell = done.recording.load_cell
    stop = done.events("stopped")[0].time_s
    changes = np.flatnonzero(np.diff(cell.gross_N))
    assert stop - cell.time_s[changes[-1]] < 2.5 * done.bench.limits.stale + 0.05
    (back,) = done.events("retreat") or [None]
    assert back is None or back.data["to_mm"] >= done.surface_mm - 1e-6, "blind no further than the surface"


# -- the clocks ------------------------------------------------------------------------------------------------------


def test_a_step_of_the_wall_clock_is_nothing(monkeypatch):
    clock = WallClock()
    before = clock.now()
    monkeypatch.setattr(time, "time", lambda: 0.0)
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    assert before <= clock.now() < before + 60.0


@pytest.mark.parametrize(("jump_s", "words"), [(0.2, "after it came"), (-0.2, "before the one that came before it")])
def test_stamps_that_jump(jump_s, words):
    monitor = Monitor(envelope())
    for k in range(10):
        monitor.force(force(0.01 * k, 1.0 + 0.01 * k), 1.0)
    assert monitor.cause is None
    monitor.force(ForceSample(0.1 + jump_s, 0.101, 1.2), 1.2)
    assert monitor.cause is not None and "a clock jumped" in monitor.cause and words in monitor.cause


def test_a_computer_that_slept(monkeypatch):
    asleep = [0.0]
    monkeypatch.setattr(watch, "_boot_minus_monotonic_s", lambda: asleep[0])
    host = watch.HostSleep()
    asleep[0] = 3.0
    monitor = Monitor(envelope())
    monitor.turn(0.001, host.slept_s())
    assert monitor.cause == "the computer was suspended for 3.0 s during the run" and monitor.blame == "host"
    assert host.slept_s() == 0.0


@BOTH
def test_a_host_that_stalls(tmp_path, base):
    """Between two turns of the loop the bench's time goes on, and nobody looks."""

    def stall(world: Any, bench_s: float) -> None:
        world.clock.wait([], world.clock.now() + 0.3)

    done = run(tmp_path, DEEP, base, hook=once(in_hold(), stall))
    stopped_well(done, r"^the host stalled: 3\d\d ms between two turns of the loop")
    (late,) = done.events("late_turn")
    assert 0.3 - 1e-9 <= late.data["gap_s"] < 0.33
    assert done.result["late_turns"] == 1


def test_a_short_stall_is_recorded_and_no_more(tmp_path):
    def stall(world: Any, bench_s: float) -> None:
        world.clock.wait([], world.clock.now() + 0.045)

    done = run(tmp_path, DEEP, hook=once(in_hold(), stall))
    assert done.outcome.cause is None
    assert len(done.events("late_turn")) == 1 and done.result["late_turns"] == 1


# -- the tare --------------------------------------------------------------------------------------------------------


def test_a_tare_that_is_too_old(tmp_path, monkeypatch):
    monkeypatch.setattr(approach, "TARE_KEEPS_S", 0.5)  # the way to the pad takes longer
    done = run(tmp_path, merged(DEEP, {"approach": {"speed": 1}}))
    stopped_well(done, r"^the tare is \d min old")
    assert done.recording.surface_mm is None


@BOTH
def test_a_zero_that_moves_after_the_tare(tmp_path, base):
    """Somebody has pressed `zero` with 3 N hanging on the cell: contact would come 3 N late."""

    def zeroed(world: Any, bench_s: float) -> None:
        world.devices["load_cell"].amplifier.zero += round(3.0 / 0.001)

    done = run(tmp_path, DEEP, base, hook=once(lambda s, label: label == "approach", zeroed))
    stopped_well(done, r"^the force fell to -[23]\.\d+ N on the way to the pad: the zero has moved")
    assert done.recording.surface_mm is None
    (back,) = done.events("retreat")
    assert back.data["to_mm"] == pytest.approx(-0.3, abs=0.02), "to where the tare was taken"


def test_a_cell_that_is_wired_the_wrong_way(tmp_path):
    """Pressing reads as pulling, with 3 N on the pad at the most; and the pad is left again."""
    done = run(tmp_path, merged(DEEP, {"approach": {"speed": 1}}), hook=once(lambda s, label: True, turn_over))
    stopped_well(done, "the cell's sign is wrong")
    assert float(done.world.plant.history(0.0)[2].max()) < 3.0
    assert done.events("retreat")[0].data["to_mm"] < done.world.surface_mm


def turn_over(world: Any, bench_s: float) -> None:
    """The two wires of the bridge's signal are swapped."""
    sensed = world.plant.sensed_force_N
    world.plant.sensed_force_N = lambda stamp_s: -sensed(stamp_s)


def test_an_amplifier_that_says_that_it_was_zeroed():
    monitor = Monitor(envelope())
    monitor.force(force(0.0, 0.1, "zeroed"), 0.1)
    monitor.tared()
    monitor.force(force(0.01, 0.11), 0.11)
    monitor.force(force(0.02, 0.12), 0.12)
    assert monitor.cause is None, "as it was at the tare"
    monitor.force(force(0.03, 0.13, "zeroed"), 0.13)
    assert monitor.cause is not None and "was zeroed since the tare" in monitor.cause


# -- numbers that are none -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_force_that_is_no_number(value):
    monitor = Monitor(envelope())
    monitor.force(force(0.0, value), value)
    assert monitor.cause is not None and "as a force" in monitor.cause and monitor.cell_lost


def test_a_position_that_is_no_number():
    monitor = Monitor(envelope())
    monitor.motor(MotorSample(0.0, 0.001, math.nan), 0.0, ())
    assert monitor.cause == "the motor reports nan as its position" and monitor.blame == "motor"


# -- the motor's own sense of force ----------------------------------------------------------------------------------


def judged(pushed_N: float, felt_N: float, seconds: float = 1.0, tolerance_N: float = 6.0) -> str | None:
    """Both from 1 N and 0 N in air to these, at once; the cause if there is one within so long."""
    sense = SenseWatch(tolerance_N)
    sense.motor(0.0, 1.0)
    sense.cell(0.0, 0.0)
    sense.in_air()
    for k in range(1, round(1000 * seconds)):
        sense.cell(1e-3 * k, felt_N)
        cause = sense.motor(1e-3 * k, 1.0 + pushed_N)
        if cause is not None:
            return cause
    return None


@pytest.mark.parametrize(
    ("pushed_N", "felt_N", "words"),
    [
        (8.0, 0.0, "broken cable"),
        (12.0, 0.5, "broken cable"),
        (8.0, -8.0, "wrong sign"),
        (-8.0, 8.0, "wrong sign"),
        (0.2, 9.0, "something other than this motor"),
        (8.0, 7.0, None),
        (12.0, 5.9, None),  # a scale that is wrong, or a channel that is clipped, is not flat
        (5.0, 0.0, None),
        (-4.0, 0.0, None),
    ],
)
def test_motor_and_cell_disagree(pushed_N, felt_N, words):
    cause = judged(pushed_N, felt_N)
    assert cause is None if words is None else (cause is not None and words in cause), cause


def test_a_blow_is_not_a_disagreement():
    assert judged(40.0, 0.0, seconds=0.02) is None


def unplug_bridge(world: Any, bench_s: float) -> None:
    """The cable between cell and amplifier is broken: there is noise, and no force any more."""
    plant = world.plant
    plant.sensed_force_N = lambda stamp_s: 0.0


def test_a_cable_that_breaks_under_load(tmp_path):
    deep = merged(DEEP, {"limits": {"force": 12}, "steps": [{"to": 2.2, "speed": 4, "hold": 1.0}]})
    done = run(tmp_path, deep, hook=once(in_ramp, unplug_bridge))
    stopped_well(
        done, r"^the motor pushes with \+\d\.\d+ N more than in air, the load cell shows [+-]0\.0\d N: a broken"
    )
    (back,) = done.events("retreat")
    assert back.data["to_mm"] == pytest.approx(done.surface_mm, abs=0.01), "blind: to the surface, and no further"
    assert float(done.world.plant.history(0.0)[2].max()) < 12.0


def hastened(name: str) -> dict[str, Any]:
    """A shipped protocol with its holds no longer than two seconds: nothing new happens in the rest of them."""

    def short(part: Any) -> Any:
        if isinstance(part, dict):
            return {k: min(v, 2) if k in ("hold", "rest", "air") else short(v) for k, v in part.items()}
        return [short(item) for item in part] if isinstance(part, list) else part

    protocol: dict[str, Any] = short(yaml.safe_load(find_file("protocol", name).read_text("utf-8")))
    return protocol


ALIKE = {"staircase", "sweep", "long_hold", "precondition", "first_contact", "rich"}
"""Of moves that the others have too."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.long] if n in ALIKE else []) for n in sorted(shipped_names("protocol"))],
)
def test_no_alarm_on_shipped_protocols(tmp_path, name):
    """What a bench has of friction and moving mass is no reason to stop."""
    pad = yaml.safe_load(find_file("pad", "polyurethane").read_text("utf-8"))
    pad["effects"] = [
        {"id": "friction", "form": "coulomb", "coulomb": 0.3},
        {"id": "inertia", "mass": 0.1},
    ]
    file = tmp_path / "pad.yaml"
    file.write_text(yaml.safe_dump(pad), "utf-8")
    done = run(tmp_path, hastened(name), simulation={"pad": str(file)})
    assert done.outcome.cause is None
    assert not done.events("late_turn") and not done.events("frozen_not_watched")
