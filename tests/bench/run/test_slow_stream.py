"""A streamed motor on a slow line: it moves as fast as the protocol asks, told as often as it takes it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sim.world
from bench import identify
from bench.config import load_bench
from bench.preflight import check
from bench.protocol import load_protocol
from bench.rates import motor_rate_Hz
from tests.bench.run.benches import AIR, SHORT, Done, bench_file, once, protocol_file, run
from tests.bench.run.test_polled_axis import TRUE

SLOW: dict[str, Any] = AIR | {"steps": [{"to": 2.0, "speed": 4, "hold": 0.5}, {"to": 0.0, "speed": 8, "hold": 0.5}]}


def speeds_mm_s(done: Done) -> list[tuple[float, float]]:
    """(asked, made) of each ramp of the steps, made from a fifth to four fifths of the way."""
    out, motor = [], done.recording.motor
    for mark, end_s in done.stretches():
        if mark.kind != "ramp" or mark.phase != "steps":
            continue
        inside = (motor.time_s >= mark.time_s) & (motor.time_s < end_s)
        t, x = motor.time_s[inside], motor.position_mm[inside]
        way = np.abs(x - x[0]) / np.ptp(x)
        made = (way > 0.2) & (way < 0.8)
        out.append((mark.speed_mm_s, abs(float(np.polyfit(t[made], x[made], 1)[0]))))
    return out


@pytest.mark.parametrize(
    ("baudrate", "gap_us"),
    [(19200, None), (115200, None), (460800, None), (115200, 2000), (115200, 80), (625000, None)],
)
def test_moves_are_as_fast_as_asked_at_any_baud_rate(tmp_path: Any, baudrate: int, gap_us: int | None) -> None:
    done = run(tmp_path, SLOW, motor={"baudrate": baudrate, "gap_us": gap_us})
    for asked, made in speeds_mm_s(done):
        assert made == pytest.approx(asked, rel=0.03)
    motor = done.recording.motor
    planned_Hz = motor_rate_Hz(done.bench, None)
    assert 1.0 / np.median(np.diff(motor.time_s)) == pytest.approx(min(planned_Hz, 1000.0), rel=0.03)
    assert done.outcome.held_up_s < 0.05


def test_a_motor_that_is_slower_than_the_bench_file_knows_is_told_as_often_as_it_takes_it(tmp_path: Any) -> None:
    """Its interframe delay is set in the motor itself."""

    def longer(world: Any, bench_s: float) -> None:
        world.endpoints["motor"].device.delay_s = 0.005

    done = run(tmp_path, SLOW, hook=once(lambda bench_s, label: bench_s > 0.1, longer), motor={"baudrate": 1_000_000})
    for asked, made in speeds_mm_s(done):
        assert made == pytest.approx(asked, rel=0.03)
    *_, slower = done.events("motor_slower")  # the first amid replies that came before
    assert slower.data["period_s"] == pytest.approx(0.0054, rel=0.05)
    assert done.outcome.motor_period_s == slower.data["period_s"]
    assert done.outcome.held_up_s == float(done.result["held_up_s"]) < 0.1


def test_a_motor_far_slower_than_planned_is_held_up_rather_than_left_behind(tmp_path: Any) -> None:
    """As behind an adapter that hands over what has come every 16 ms: in that time a move of 40 mm/s goes 0.64 mm."""

    def longer(world: Any, bench_s: float) -> None:
        world.endpoints["motor"].device.delay_s = 0.016

    slow = once(lambda bench_s, label: bench_s > 0.1, longer)
    far = AIR | {"steps": [{"to": -4.0, "speed": 40, "hold": 0.5}, {"to": 0.0, "speed": 40, "hold": 0.5}]}
    done = run(tmp_path, far, hook=slow, motor={"baudrate": 1_000_000})
    assert done.outcome.cause is None
    for asked, made in speeds_mm_s(done):
        assert asked == 40.0 and made == pytest.approx(0.7 * 0.5 / done.outcome.motor_period_s, rel=0.15)
    assert done.outcome.held_up_s > 0.01
    motor = done.recording.motor
    assert np.nanmax(np.abs(motor.command_mm - motor.position_mm)) < 0.5


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4))])
def test_what_is_felt_amid_stairs_costs_nothing_and_the_pad_is_found(tmp_path: Any, seed: int) -> None:
    done = run(tmp_path, "quick", motor={"baudrate": 115200}, simulation={"seed": seed})
    m = done.recording.measurement()
    assert any("150 times a second" in note for note in m.notes) and 0.5 < sum(b - a for a, b in m.doubtful) < 5.0
    blind, fitted = (
        identify.fit([data], law="exponential", order=2, contact="unilateral") for data in (replace(m, doubtful=[]), m)
    )
    assert fitted.rmse < 1.03 * fitted.noise_floor < 0.9 * blind.rmse
    for name, true in TRUE.items():
        found = fitted.parameters[name]
        assert abs(found.value - true) < 4.0 * found.std < 0.04 * true, name


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4))])
def test_what_is_felt_while_the_computer_is_late_costs_nothing_and_the_pad_is_found(tmp_path: Any, seed: int) -> None:
    """Every so many turns it is away for 4 to 9 ms, as beside other work."""
    rng = np.random.default_rng(seed)

    def away(bench_s: float, label: str) -> None:
        if rng.random() < 0.02:
            world = sim.world._worlds["bench"]
            world.clock.wait([], world.clock.now() + rng.uniform(0.004, 0.009))

    done = run(tmp_path, "quick", hook=away, simulation={"seed": seed})
    m = done.recording.measurement()
    assert 1.0 / np.median(np.diff(m.position_time_s)) > 900.0
    assert any("by a late computer" in note for note in m.notes) and m.doubtful
    blind, fitted = (
        identify.fit([data], law="exponential", order=2, contact="unilateral") for data in (replace(m, doubtful=[]), m)
    )
    assert fitted.rmse < 1.06 * fitted.noise_floor < 0.9 * blind.rmse
    for name, true in TRUE.items():
        found = fitted.parameters[name]
        # what the pad went through meanwhile is known to half a step too: that is in no error, and shifts c_1 the most
        assert abs(found.value - true) < max(4.0 * found.std, 0.005 * true), name
        assert found.std < 0.02 * true, name


def test_a_motor_that_hears_often_enough_makes_no_stairs(tmp_path: Any) -> None:
    assert not run(tmp_path, SHORT, motor={"baudrate": 625000}).recording.measurement().doubtful


@pytest.mark.parametrize(("baudrate", "said"), [(115200, True), (1_000_000, False)])
def test_stairs_that_the_pad_feels_and_no_sample_shows_are_told_before(
    tmp_path: Any, baudrate: int, said: bool
) -> None:
    bench = load_bench(str(bench_file(tmp_path, motor={"baudrate": baudrate})))
    notices = [p for p in check(load_protocol(protocol_file(tmp_path, SHORT)), bench).problems if "stairs" in p.message]
    assert bool(notices) is said
    assert all(p.severity == "notice" and "every 6.67 ms" in p.message and "0.27 mm" in p.message for p in notices)
