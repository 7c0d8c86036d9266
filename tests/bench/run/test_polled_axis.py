"""An axis that makes its own moves and is polled a hundred times a second, through the wire to the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from bench import identify
from bench.config import load_model
from bench.diagnose import diagnose
from bench.recording import Measurement
from bench.shipped import find_file
from tests.bench.run.benches import SHORT, Done, run

TRUE = {"m": 2.24, "b": 0.69, "c_1": 0.25, "c_2": 0.15, "nu_1": 4.0, "nu_2": 0.35}
"""The shipped polyurethane pad."""


@pytest.fixture(scope="module", params=[1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))])
def quick(request, tmp_path_factory) -> Done:
    folder = tmp_path_factory.mktemp("quick")
    return run(folder, "quick", "simulated_iai", simulation={"seed": request.param})


def fitted(measurement: Measurement) -> identify.FitResult:
    return identify.fit([measurement], law="exponential", order=2, contact="unilateral")


def test_the_fit_is_as_good_as_the_noise(quick):
    """Straight lines between the polls leave twice the noise. What a parameter is known to is its standard error, and
    what it moves by when all stamps are late by their stated doubt."""
    m = quick.recording.measurement()
    fit = fitted(m)
    late = m.stamp_std_s
    assert 0.0005 <= late < 0.001
    spans = [(begin - late, end - late) for begin, end in m.doubtful]
    shifted = fitted(replace(m, position_time_s=m.position_time_s - late, doubtful=spans))
    assert fit.rmse / fit.noise_floor == pytest.approx(1.0, abs=0.05)
    for name, true in TRUE.items():
        found = fit.parameters[name]
        doubt = np.hypot(found.std, shifted.parameters[name].value - found.value)
        assert abs(found.value - true) < 4 * doubt, name  # of 72 in twelve runs one was beyond 3
        assert doubt < 0.02 * true, "a doubt so large would say nothing"


def test_moves_are_recorded_as_the_device_took_them(quick):
    moves = quick.events("move")
    marks = [mark for mark in quick.recording.steps if mark.kind == "ramp" and mark.phase in ("steps", "finish")]
    assert len(moves) >= len(marks) == 7
    for mark in marks:
        (move,) = [m for m in moves if m.time_s - m.data["waited_s"] == pytest.approx(mark.time_s, abs=1e-6)]
        target = move.data["target_mm"]
        assert target == pytest.approx(mark.target_mm + quick.surface_mm, abs=0.005), "rounded to the device's counts"
        assert 100 * target == pytest.approx(round(100 * target), abs=1e-6)
        assert move.data["speed_mm_s"] == mark.speed_mm_s
        assert 0 < move.data["waited_s"] < 0.05
    motor = quick.recording.motor
    for mark in marks[1:]:  # a hold comes before each of them
        before = (motor.time_s > mark.time_s - 0.1) & (motor.time_s < mark.time_s)
        assert np.ptp(motor.position_mm[before]) <= 0.011, "it stands until it is told"
    assert [event.data["stamp_std_s"] for event in quick.events("polled")] == [0.0005]


def test_a_streamed_motor_needs_none_of_it(tmp_path):
    done = run(tmp_path, SHORT)
    assert not done.events("move") and not done.events("polled") and not done.events("halt")
    measurement = done.recording.measurement()
    assert measurement.position_time_s.size == done.recording.motor.time_s.size
    assert not measurement.doubtful and measurement.stamp_std_s == 0


def test_a_flawless_pad_gets_no_cause(quick):
    """What the stamps' doubt makes of fast moves looks like a pad that is damped, or a force that is late."""
    m = quick.recording.measurement()
    assert m.stamp_std_s > 0.0
    said = diagnose(m, load_model("polyurethane"))
    assert said.verdict == "consistent" and not said.causes


@pytest.mark.long
def test_a_late_force_is_found_beyond_the_doubt_of_the_stamps(tmp_path):
    pad = yaml.safe_load(find_file("pad", "polyurethane").read_text("utf-8"))
    (tmp_path / "late.yaml").write_text(yaml.safe_dump(pad | {"effects": [{"id": "force_delay", "delay": 0.005}]}))
    simulation = {"seed": 1, "pad": str(tmp_path / "late.yaml")}
    m = run(tmp_path, "quick", "simulated_iai", simulation=simulation).recording.measurement()
    (cause,) = diagnose(m, load_model("polyurethane")).causes
    delay = cause.parameters["delay"]
    assert cause.id == "force_delay"
    assert abs(delay.value - 0.005) < 3.0 * delay.std and m.stamp_std_s < delay.std < 2.0 * m.stamp_std_s
