"""The check-up: what it finds on benches that have something, what it measures against the truth, what it leaves."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bench.config import load_bench
from bench.daily.checkup import delay, standing, steps
from bench.daily.checkup.usb import latency_timers
from bench.recording.types import ForceChannel, MotorChannel
from tests.bench.daily.benches import in_the_world, miscalibrated
from tests.bench.daily.test_hand import watch
from tests.bench.run.benches import bench_file

PAD: dict[str, Any] = {
    "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
    "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
    "contact": "unilateral",
}


def pad_file(folder: Path, *effects: dict[str, Any]) -> str:
    path = folder / "truth.yaml"
    path.write_text(yaml.safe_dump({"pad": PAD, "effects": list(effects)}))
    return str(path)


def examined(padbench, path, *words: str) -> dict[str, Any]:
    said = padbench("doctor", path, "--yes", "--json", "-", "--seconds", "3", *words)
    found = json.loads(said.out)
    assert said.status == (0 if found["well"] else 1), said
    return found


def remarked(found: dict[str, Any]) -> set[str]:
    return {finding["check"] for finding in found["findings"] if finding["ok"] is False}


def test_a_bench_in_order_is_well_and_every_figure_is_there(padbench, monkeypatch):
    worlds = in_the_world(monkeypatch)
    found = examined(padbench, "simulated")
    assert found["well"] and not remarked(found)
    figures = found["figures"]
    # The simulation block of the shipped bench: 10 mN, 0.5 µm and steps of 1 µm (Orca), 115 200 baud, 21 characters.
    assert figures["noise"]["rms_N"] == pytest.approx(0.01, rel=0.1)
    assert figures["motor_noise"]["position_mm"] == pytest.approx(np.hypot(0.0005, 0.001 / np.sqrt(12)), rel=0.25)
    assert figures["rates"]["load_cell"]["rate_Hz"] == pytest.approx(115200 / 210, rel=0.01)
    assert figures["values"]["resolution_N"] == pytest.approx(0.001, rel=1e-6)
    assert figures["direction"]["moved_mm"] == pytest.approx(0.1, abs=0.003)
    assert figures["delay"]["in_air"] is None
    assert not worlds[0].plant.servo_on


def test_a_motor_that_counts_speeds_in_whole_millimetres_is_examined(padbench):
    """Its slowest is twice the speed of the check-up's first move."""
    found = examined(padbench, "simulated_smc_lec")
    assert found["well"] and found["figures"]["direction"]["moved_mm"] == pytest.approx(0.1, abs=0.02)
    said = [f["shown"] for f in found["findings"] if f["check"] == "motor rate"]
    assert len(said) == 1 and "(at least " in said[0], "its map has the longest that it may think"


@pytest.mark.parametrize(
    ("late_ms", "std_ms", "ok"), [(0.05, 0.1, True), (1.0, 0.38, None), (0.3, 0.6, None), (1.0, 0.1, False)]
)
def test_a_delay_that_cannot_be_told_from_none_is_not_called_in_order(late_ms, std_ms, ok):
    found = delay.Delay(1e-3 * late_ms, 1e-3 * std_ms, "strokes into the pad", 0.01)
    assert delay.judged(found, 0.0).ok is ok
    assert delay.judged(replace(found, delay_s=found.delay_s + 0.004), 0.004).ok is ok


def tells_the_delay(found, late_s):
    measured = found["figures"]["delay"]["in_contact"]
    assert abs(measured["delay_s"] - late_s) < 4 * measured["std_s"] + 5e-5
    assert 1e-6 < measured["std_s"] < 5e-4
    assert ("delay" in remarked(found)) == (late_s > 0)


@pytest.mark.long
@pytest.mark.parametrize("late_s", [0.0, 0.004])
def test_the_delay_in_a_pad_is_the_true_one(padbench, tmp_path, late_s):
    effects = [{"id": "force_delay", "delay": late_s}] if late_s else []
    path = bench_file(tmp_path, simulation={"pad": pad_file(tmp_path, *effects)})
    tells_the_delay(examined(padbench, path, "--press"), late_s)


def test_the_delay_in_air_is_that_of_the_probes_inertia(padbench, tmp_path):
    truth = pad_file(tmp_path, {"id": "inertia", "mass": 0.05}, {"id": "force_delay", "delay": 0.003})
    found = examined(padbench, bench_file(tmp_path, simulation={"pad": truth, "surface": 4.0}))
    measured = found["figures"]["delay"]["in_air"]
    # The inertia of the simulation itself is late by half its window, a millisecond or less.
    assert measured["delay_s"] == pytest.approx(0.003, abs=0.0015 + 4 * measured["std_s"])


def test_the_delay_in_a_pad_is_measured_and_written_and_nothing_else(padbench, tmp_path):
    truth = pad_file(tmp_path, {"id": "force_delay", "delay": 0.004})
    path = bench_file(tmp_path, simulation={"pad": truth}, timing={"position_delay": 0.001})
    out = tmp_path / "measured.yaml"
    found = examined(padbench, path, "--press", "--write", str(out))
    tells_the_delay(found, 0.004)
    new, old = yaml.safe_load(out.read_text()), yaml.safe_load(path.read_text())
    timing = new.pop("timing")
    assert timing["force_delay"] == pytest.approx(found["figures"]["delay"]["in_contact"]["delay_s"] + 0.001, abs=1e-6)
    assert timing["position_delay"] == pytest.approx(0.001) and timing["measured_on"] is not None
    old.pop("timing")
    assert new == old
    assert load_bench(out).timing.force_delay == timing["force_delay"]
    other = padbench("doctor", path, "--yes", "--write", str(out))
    assert other.status == 2 and "another file than BENCH" in other.err


def test_the_force_stays_under_its_cap(padbench, tmp_path, monkeypatch):
    felt: list[float] = []
    in_the_world(monkeypatch, lambda world: watch(world, felt))
    examined(padbench, bench_file(tmp_path), "--press", "--force-cap", "1.2")
    assert 0.4 * 1.2 < max(felt) < 1.2


def test_a_pad_where_air_should_be_stops_the_check_up(padbench, tmp_path):
    said = padbench("doctor", bench_file(tmp_path, simulation={"surface": -0.02}), "--yes", "--force-cap", "0.1")
    assert said.status == 1 and re.search("force limit|tension limit|touches", said.err)


def test_hum_drift_and_noise_are_named_with_what_to_do(padbench, tmp_path):
    truth = pad_file(tmp_path, {"id": "mains_hum", "amplitude": 0.02, "frequency": 50.0})
    noise = {"force": 0.015, "drift": 0.02}
    found = examined(padbench, bench_file(tmp_path, simulation={"pad": truth, "noise": noise}))
    assert {"mains hum", "noise", "drift"} <= remarked(found)
    hum = found["figures"]["noise"]["hum_amplitude_N"]
    assert hum["50_Hz"] == pytest.approx(0.02, rel=0.15) and max(hum["60_Hz"], hum["100_Hz"]) < 0.003
    assert all(finding["do"] for finding in found["findings"] if finding["ok"] is False)


def test_a_cell_turned_over_is_found_by_the_press(padbench, tmp_path, monkeypatch):
    in_the_world(monkeypatch, miscalibrated(-1.0))
    found = examined(padbench, bench_file(tmp_path), "--press", "--force-cap", "1")
    assert "load cell's sign" in remarked(found)


def test_nobody_confirms_the_direction_and_nothing_more_is_tried(padbench, monkeypatch):
    worlds = in_the_world(monkeypatch)
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    said = padbench("doctor", "simulated", "--press")
    assert said.status == 1 and "turn motor.direction" in said.out and "step" not in said.out
    assert not worlds[0].plant.servo_on


BAD = {
    "cap": (["--force-cap", "30"], "--force-cap: 30 N"),
    "seconds": (["--seconds", "0"], "--seconds: 0 s"),
    "where": (["--write", "/nowhere/b.yaml"], "there is no folder"),
    "shipped": (["--write", "SHIPPED"], "shipped bench"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_check_up_that_cannot_be_meant(padbench, case):
    words, message = BAD[case]
    source = str(load_bench("simulated").source)
    said = padbench("doctor", "simulated", "--yes", *[source if word == "SHIPPED" else word for word in words])
    assert said.status == 2 and re.search(message, said.err)


# -- figures against closed forms --------------------------------------------------------------------------------------


def motor_of(t: np.ndarray, x: np.ndarray, command: np.ndarray) -> MotorChannel:
    return MotorChannel(t, x, command, np.full(t.size, np.nan), t)


@pytest.mark.parametrize("damping", [0.4, 0.7])
def test_a_step_of_second_order_has_the_overshoot_of_the_textbook(damping):
    """Overshoot exp(−πζ/√(1−ζ²)) of a second-order system (any textbook of control, e.g. Franklin, Powell)."""
    omega = 2 * np.pi * 20
    t = np.arange(-0.02, 0.6, 0.0002)
    wd = omega * np.sqrt(1 - damping**2)
    ringing = np.exp(-damping * omega * t) * (np.cos(wd * t) + damping * omega / wd * np.sin(wd * t))
    x = np.where(t > 0, 0.15 * (1 - ringing), 0.0)
    figures = steps.step_figures(motor_of(t, x, np.where(t > 0, 0.15, 0.0)), 0.0, 0.15, 0.0, 0.003)
    expected = 100 * np.exp(-np.pi * damping / np.sqrt(1 - damping**2))
    assert figures["overshoot_percent"] == pytest.approx(expected, rel=0.01)
    assert figures["error_mm"] == pytest.approx(0.0, abs=1e-4)
    # The envelope exp(−ζωt)/√(1−ζ²) bounds the time after which it stays within 2 %.
    assert 0 < figures["settled_s"] <= -np.log(0.02 * np.sqrt(1 - damping**2)) / (damping * omega) + 2e-4


def test_a_ramp_has_the_rise_and_the_lag_it_was_made_with():
    t = np.arange(-0.02, 0.5, 0.001)
    command = np.clip(t / 0.05, 0, 1) * 0.15
    x = np.clip((t - 0.0043) / 0.05, 0, 1) * 0.15
    figures = steps.step_figures(motor_of(t, x, command), 0.0, 0.15, 0.0, 0.003)
    assert figures["rise_s"] == pytest.approx(0.8 * 0.05, abs=1e-6)
    assert figures["lag_s"] == pytest.approx(0.0043, abs=1e-4)
    assert figures["following_error_mm"] == pytest.approx(0.15 * 4.3 / 50, rel=0.01)


@pytest.mark.parametrize("rate_Hz", [549.0, 200.0, 73.0])
def test_a_line_is_found_with_its_amplitude_also_where_it_is_aliased(rate_Hz):
    t = np.arange(0, 5, 1 / rate_Hz)
    force = 0.3 + 0.01 * t + 0.02 * np.sin(2 * np.pi * 60 * t + 0.7)
    found = standing.lines_of(t, force, (50.0, 60.0, 100.0))
    assert found[60.0] == pytest.approx(0.02, rel=0.02) and found[50.0] < 0.002 and found[100.0] < 0.002


def test_inertia_is_timed_to_a_tenth_of_a_millisecond_and_none_is_no_delay():
    rng = np.random.default_rng(5)
    t = np.arange(0, 3, 0.001)

    def place(at: np.ndarray) -> np.ndarray:
        return 0.075 * (1 - np.cos(2 * np.pi * 12 * at)) * np.sin(2 * np.pi * 0.35 * at) ** 2

    at = np.arange(0.05, 2.95, 1 / 549)
    h = 1e-4
    late = at - 0.0021
    acceleration = (place(late + h) - 2 * place(late) + place(late - h)) / h**2
    motor = motor_of(t, place(t) + rng.normal(0, 0.0005, t.size), place(t))
    force = 0.1e-3 * acceleration + rng.normal(0, 0.01, at.size)
    cell = ForceChannel(at, force, force, at, np.zeros(at.size, bool))
    found = delay.in_air(motor, cell)
    assert found is not None and abs(found.delay_s - 0.0021) < 4 * found.std_s and found.std_s < 5e-4
    noise = rng.normal(0, 0.01, at.size)
    assert delay.in_air(motor, ForceChannel(at, noise, noise, at, np.zeros(at.size, bool))) is None


@pytest.mark.parametrize(("timer_ms", "ok"), [(16, False), (1, True)])
def test_an_adapter_that_holds_bytes_back_is_named(tmp_path, timer_ms, ok):
    device = tmp_path / "system" / "ttyUSB7"
    device.mkdir(parents=True)
    (device / "latency_timer").write_text(f"{timer_ms}\n")
    (tmp_path / "ttyUSB7").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "ttyUSB7")
    path = bench_file(tmp_path, motor={"port": str(tmp_path / "by-id")}, load_cell={"port": "socket://10.0.0.1:502"})
    figures, findings = latency_timers(load_bench(path), tmp_path / "system")
    assert figures["motor"]["latency_timer_ms"] == timer_ms and "load_cell" not in figures
    assert [finding.ok for finding in findings] == [ok] and ("echo 1 >" in findings[0].do) == (not ok)


def test_a_line_at_half_the_rate_is_not_made_of_the_jitter_of_the_stamps():
    """A sine of half the rate is nearly 0 at every sample, and could be given any size."""
    rng = np.random.default_rng(3)
    t = np.arange(0, 5, 1 / 200) + rng.normal(0, 1e-7, 1000)
    found = standing.lines_of(t, rng.normal(0, 0.01, t.size), (50.0, 100.0))
    assert found[100.0] < 0.005 and found[50.0] < 0.002


@pytest.mark.parametrize(("answers", "asked"), [("perhaps\n\nn\n", 3), ("NO\n", 1)])
def test_an_answer_that_is_none_is_not_taken_for_a_no(padbench, monkeypatch, answers, asked):
    """A no has `motor.direction` turned over: nobody says it by pressing Enter."""
    monkeypatch.setattr("sys.stdin", io.StringIO(answers))
    said = padbench("doctor", "simulated", "--seconds", "1")
    assert said.err.count("Did it go towards the pad first? [y/n]") == asked
    assert said.status == 1 and "turn motor.direction" in said.out
    monkeypatch.setattr("sys.stdin", io.StringIO("perhaps\n"))
    said = padbench("doctor", "simulated", "--seconds", "1")
    assert said.status == 1 and "nobody answers" in said.err and "motor.direction" not in said.out


def test_a_simulated_bench_is_examined_where_nobody_can_be_asked(padbench, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    said = padbench("doctor", "simulated", "--seconds", "1", "--json", "-")
    assert said.status == 0 and json.loads(said.out)["well"] is True


def test_what_was_found_before_a_failure_is_told_with_it(padbench, tmp_path):
    """There is no pad to press: rates, noise and the rest were measured all the same."""
    path = bench_file(tmp_path, simulation={"surface": 1000.0})
    said = padbench("doctor", path, "--yes", "--press", "--seconds", "3", "--json", "found.json")
    assert said.status == 1 and "no contact" in said.err
    assert "motor rate: " in said.out and "did not come to its end" in said.out
    found = json.loads((tmp_path / "found.json").read_text())
    assert "no contact" in found["stopped"] and not found["well"]
    assert found["figures"]["noise"]["rms_N"] == pytest.approx(0.01, rel=0.1)


def test_a_limit_shorter_than_the_usual_time_between_samples_is_not_the_lines_fault():
    """A run looks when something comes: it may pass, and nothing says that it would have stopped."""
    t = np.arange(0.0, 1.0, 0.002)
    none = np.full(t.size, np.nan)
    motor, cell = MotorChannel(t, 0 * t, none, none, t), ForceChannel(t, 0 * t, 0 * t, t, np.zeros(t.size, bool))
    bench = load_bench("simulated")
    short = bench.model_copy(update={"limits": bench.limits.model_copy(update={"stale": 0.001})})
    gaps = [finding for finding in standing.rates(short, motor, cell)[1] if "gaps" in finding.check]
    assert [finding.check for finding in gaps] == ["motor gaps", "load_cell gaps"]
    assert all("(1 ms)" in f.means and "would have stopped" not in f.means and "limits.stale to" in f.do for f in gaps)
