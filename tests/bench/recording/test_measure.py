"""What a fit may see of a recording."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bench.errors import InputError
from bench.recording import Event, ForceChannel, MotorChannel, Recorder, Recording, StepMark, read_recording
from bench.recording.truth_block import without_truth
from tests.bench.recording.made import StillClock, force_at, position_at, write_run


def recording_of(position, force, **more) -> Recording:
    """A recording of two (time, value) channels with the surface at 0."""
    pt, p = (np.array(a, dtype=float) for a in position)
    ft, f = (np.array(a, dtype=float) for a in force)
    nan = np.full(pt.size, np.nan)
    motor = MotorChannel(pt, p, nan, nan, pt)
    flagged = more.pop("flagged", np.zeros(ft.size, dtype=bool))
    return Recording(Path("data.csv"), motor, ForceChannel(ft, f, f, ft, flagged), **{"surface_mm": 0.0, **more})


def test_a_run_becomes_a_measurement(tmp_path):
    folder = tmp_path / "2026-01-01_made"
    folder.mkdir()
    write_run(folder / "recording.mcap")
    for path in (folder, folder / "recording.mcap"):
        m = read_recording(path).measurement()
        assert m.name == "2026-01-01_made"
        i, j = np.arange(3000), np.arange(0, 3000, 2)
        np.testing.assert_allclose(m.position_time_s, 1e-3 * i - 7e-4, atol=1e-9)
        np.testing.assert_allclose(m.position_mm, position_at(i) - 1.5, atol=1e-12)
        # sample 1500 is an overload; the first lies before the first position once both delays are taken off
        j = j[(j != 1500) & (j != 0)]
        np.testing.assert_allclose(m.force_time_s, 1e-3 * j + 3e-4 - 2e-3, atol=1e-9)
        np.testing.assert_allclose(m.force_N, force_at(j), atol=1e-12)
        assert m.fit_from_s == 1.0, "the first mark of phase steps"
        assert m.fit_to_s == np.inf
        assert m.surface_std_mm == 0.004
        assert [mark.kind for mark in m.marks] == ["ramp", "ramp", "hold"]
        said = "; ".join(m.notes)
        assert "overload" in said and "force 2 ms, position 0.5 ms" in said
        assert "outside" not in said, "how every run begins is not worth a word"


def test_forces_before_the_tare_are_on_the_zero_that_it_set():
    t, gross = np.arange(40) / 10, 0.3 + 0.001 * np.arange(40)
    net = gross - np.where(t < 2.0, 0.0, 0.2304)
    nan = np.full(t.size, np.nan)
    motor, cell = MotorChannel(t, t, nan, nan, t), ForceChannel(t, net, gross, t, np.zeros(t.size, dtype=bool))
    events = [Event(2.0, "tare", {"tare_N": 0.2304})]
    m = Recording(Path("data.csv"), motor, cell, surface_mm=0.0, events=events).measurement()
    np.testing.assert_allclose(m.force_N, gross - 0.2304, atol=1e-12)


@pytest.mark.parametrize(
    ("result", "said"), [(None, True), ({"status": "done"}, False), ({"status": "stopped"}, False)]
)
def test_a_run_without_an_end_is_called_one(result, said):
    times = np.arange(4.0)
    recording = recording_of((times, times), (times, times), run={"protocol": "quick"}, result=result)
    notes = recording.measurement().notes
    assert any("did not come to its end: it is there to 3 s" in note for note in notes) is said


def test_csv_counts_throughout(tmp_path):
    path = tmp_path / "pad 3.csv"
    path.write_text("time_s,position_mm,force_N\n0,0,0.1\n0.1,1,0.2\n0.2,2,0.3\n")
    m = read_recording(path).measurement()
    assert (m.name, m.fit_from_s, m.fit_to_s, m.surface_std_mm) == ("pad 3", -np.inf, np.inf, 0.0)
    assert m.position_mm.tolist() == [0, 1, 2] and m.force_N.tolist() == [0.1, 0.2, 0.3] and m.notes == []


def test_equal_stamps_are_averaged_and_disorder_is_put_right():
    r = recording_of(([0, 1, 1, 2, 4, 3], [0, 10, 20, 30, 50, 40]), ([0, 1, 2, 2, 3], [1, 2, 3, 5, 6]))
    m = r.measurement()
    assert m.position_time_s.tolist() == [0, 1, 2, 3, 4] and m.position_mm.tolist() == [0, 15, 30, 40, 50]
    assert m.force_time_s.tolist() == [0, 1, 2, 3] and m.force_N.tolist() == [1, 2, 4, 6]
    said = "; ".join(m.notes)
    assert "position: 1 stamp lies before" in said and "position: 1 sample with a stamp" in said
    assert "force: 1 sample with a stamp" in said


def test_samples_that_are_missing_are_left_out_and_gaps_are_told():
    t = np.arange(0, 1, 0.01)
    t[50:] += 0.5
    f = np.sin(t)
    f[10] = np.nan
    m = recording_of((t, t), (t, f)).measurement()
    assert m.force_time_s.size == 99 and np.isfinite(m.force_N).all()
    assert any(n.startswith("position: 1 gaps in the samples, the longest 0.51 s at 0.49 s") for n in m.notes)


def test_isolated_drop_outs_are_told_and_not_repaired():
    rng = np.random.default_rng(5)
    t = np.arange(2000) * 1e-3
    triangle = 2 * np.abs((t * 4) % 1 - 0.5) + rng.normal(0, 1e-5, t.size)
    dropped = triangle.copy()
    dropped[[333, 1200]] = 0.0
    m = recording_of((t, triangle), (t, dropped)).measurement()
    assert [n for n in m.notes if "drop-out" in n] == ["force: 2 isolated drop-outs, the first at 0.333 s"]
    assert m.force_N[333] == 0.0


def test_the_end_of_a_stopped_run_does_not_count(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, StillClock()) as recorder:
        recorder.begin({}, {})
        recorder.surface(0.1, 2.0, 0.01)
        recorder.step(StepMark(0.2, "steps[0]", "steps", "hold"))
        for i in range(100):
            recorder.motor(i * 0.01, i * 0.01, 3.0)
            recorder.force(i * 0.01, i * 0.01, 1.0, 1.0)
        recorder.event(0.8, "stopped", {"cause": "force limit"})
    m = read_recording(path).measurement()
    assert (m.fit_from_s, m.fit_to_s) == (0.2, 0.8)
    assert m.position_mm.tolist() == [1.0] * 100


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"surface_mm": None}, "has no touch-off"),
        ({"steps": [StepMark(0.0, "approach", "approach", "ramp")]}, "before its first step .in its approach"),
        ({"steps": [StepMark(2.9, "steps[0]", "steps", "ramp")]}, "holds 1 force samples that count"),
        ({"flagged": np.array([True, True, True, False])}, "holds 1 force samples that count"),
    ],
)
def test_what_holds_nothing_to_fit(change, message):
    r = recording_of(([0, 1, 2, 3], [0, 1, 2, 3]), ([0, 1, 2, 3], [0, 1, 2, 3]), **change)
    with pytest.raises(InputError, match=message):
        r.measurement()


def test_an_empty_recording_says_what_was_lost():
    r = recording_of(([], []), ([0], [1]), lost="a chunk is cut off (9 bytes from byte 100 on)")
    with pytest.raises(InputError) as caught:
        r.measurement()
    assert caught.value.message == "holds no position sample" and "cut off" in caught.value.cure


def test_the_surface_is_that_of_the_last_touch_off_before_the_steps(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, StillClock()) as recorder:
        recorder.begin({}, {})
        recorder.surface(0.1, 1.0, 0.02)
        recorder.surface(0.2, 1.5, 0.01)
        recorder.step(StepMark(0.3, "steps[0]", "steps", "hold"))
        recorder.surface(0.9, 1.9, 0.03)
    recording = read_recording(path)
    assert (recording.surface_mm, recording.surface_std_mm) == (1.5, 0.01)
    assert recording.events[0] == Event(0.1, "touch_off", {"surface_mm": 1.0, "surface_std_mm": 0.02})


def test_a_run_without_approach_counts_from_the_motors_zero(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, StillClock()) as recorder:
        recorder.begin({}, {})
        recorder.event(0.0, "no_surface", {"surface_mm": 0.0})
        for i in range(10):
            recorder.motor(i * 0.01, i * 0.01, 3.0)
            recorder.force(i * 0.01, i * 0.01, 1.0, 1.0)
    m = read_recording(path).measurement()
    assert m.position_mm[0] == 3.0 and any("motor's own zero" in note for note in m.notes)


@pytest.mark.parametrize(
    ("text", "rest", "block"),
    [
        (
            "a: 1  # one\nsimulation:\n  seed: 1\n  pad: x\n\n# limits\nlimits: {}\n",
            "a: 1  # one\n\n# limits\nlimits: {}\n",
            "simulation:\n  seed: 1\n  pad: x\n",
        ),
        ("simulation: {seed: 1}\nb: 1e-3\n", "b: 1e-3\n", "simulation: {seed: 1}\n"),
        ("a: 1\nsimulation:\n  seed: 1", "a: 1\n", "simulation:\n  seed: 1"),
        ("{a: 1, simulation: {seed: 1}, b: 2}\n", "a: 1\nb: 2\n", "simulation: {seed: 1}"),
        ("a: 1\n", "a: 1\n", None),
        ("x: [", "x: [", None),
    ],
)
def test_the_bench_file_without_its_truth(text, rest, block):
    assert without_truth(text) == (rest, block)


def test_the_truth_cannot_be_seen(tmp_path):
    """Two runs that differ in the truth alone give the same recording to whoever fits."""
    seen = []
    for n, truth in enumerate(({"friction": 1}, {"friction": 2, "seed": 9})):
        path = tmp_path / str(n) / "run.mcap"
        path.parent.mkdir()
        with Recorder(path, StillClock()) as recorder:
            bench = f"name: a\nsimulation: {json.dumps(truth)}\n"
            recorder.begin({"seed": 1}, {}, simulation=truth, attachments={"bench.yaml": bench})
            recorder.motor(0.0, 0.0, 1.0)
        recording = read_recording(path)
        recording.source = path.parent.parent
        seen.append(repr(recording))
    assert seen[0] == seen[1]


def test_forces_without_motion_beside_them_are_told():
    m = recording_of(([0, 1, 2], [0, 1, 2]), ([0.5, 1, 2, 2.5, 3], [1, 2, 3, 4, 5])).measurement()
    assert m.force_time_s.tolist() == [0.5, 1, 2]
    assert any("2 force samples outside" in note for note in m.notes)
