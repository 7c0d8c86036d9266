"""Round trips: arrays to CSV, run to CSV, CSV to MCAP and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.errors import InputError
from bench.recording import convert, read_recording, write_csv
from tests.bench.recording.made import force_at, position_at, write_run

numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda x: x if abs(x) > 1e-12 else 0.0)


def channel(seed: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Strictly increasing times and the values at them."""
    unique = dict(sorted(seed))
    return np.array(list(unique)), np.array(list(unique.values()))


samples = st.lists(st.tuples(st.floats(-1e4, 1e5), numbers), min_size=2, max_size=30, unique_by=lambda s: s[0]).map(
    channel
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(position=samples, force=samples, extra=samples)
def test_what_is_written_is_read_back(tmp_path, position, force, extra):
    """Any two channels on any stamps: times come back exactly, values to twelve digits, nothing is resampled."""
    path = tmp_path / "data.csv"
    write_csv(path, *position, *force, {"temperature_C": extra})
    recording = read_recording(path)
    assert np.array_equal(recording.motor.time_s, position[0])
    assert np.array_equal(recording.load_cell.time_s, force[0])
    np.testing.assert_allclose(recording.motor.position_mm, position[1], rtol=1e-11)
    np.testing.assert_allclose(recording.load_cell.force_N, force[1], rtol=1e-11)
    kept = ~np.isnan(recording.extra["temperature_C"])
    assert np.array_equal(recording.extra_time_s[kept], extra[0])
    again = tmp_path / "again.csv"
    convert(path, again)
    assert again.read_text() == path.read_text()


microseconds = st.lists(st.tuples(st.integers(-(10**10), 10**11), numbers), min_size=2, max_size=30).map(
    lambda pairs: channel([(us / 1e6, value) for us, value in pairs])
)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(position=microseconds.filter(lambda c: c[0].size > 1), force=microseconds.filter(lambda c: c[0].size > 1))
def test_through_mcap_and_back(tmp_path, position, force):
    """MCAP keeps whole nanoseconds; values stay what they were."""
    made, packed, back = tmp_path / "a.csv", tmp_path / "b.mcap", tmp_path / "c.csv"
    write_csv(made, *position, *force)
    direct = read_recording(made)
    convert(made, packed)
    through = read_recording(packed)
    assert through.lost is None and through.result is not None and through.surface_mm == 0.0
    np.testing.assert_allclose(through.motor.time_s, direct.motor.time_s, atol=0.6e-9, rtol=1e-15)
    assert np.array_equal(through.motor.position_mm, direct.motor.position_mm)
    assert np.array_equal(through.load_cell.force_N, direct.load_cell.force_N)
    convert(packed, back)
    again = read_recording(back)
    np.testing.assert_allclose(again.motor.time_s, direct.motor.time_s, atol=0.6e-9, rtol=1e-15)
    assert np.array_equal(again.load_cell.force_N, direct.load_cell.force_N)


def test_a_run_as_csv(tmp_path):
    """Pad frame, stamps corrected by the bench's timing (force 2 ms, position 0.5 ms late), everything recorded."""
    folder = tmp_path / "run"
    folder.mkdir()
    write_run(folder / "recording.mcap")
    notes = convert(folder, tmp_path / "run.csv")
    assert any("timing" in note for note in notes)
    assert any("no place for the doubt of the surface" in note for note in notes)
    recording = read_recording(tmp_path / "run.csv")
    i = np.arange(3000)
    np.testing.assert_allclose(recording.motor.time_s, 1e-3 * i - 2e-4 - 5e-4, atol=1e-9)
    np.testing.assert_allclose(recording.motor.position_mm, position_at(i) - 1.5, atol=1e-9)
    np.testing.assert_allclose(recording.motor.command_mm[100:], position_at(i[100:]) + 0.01 - 1.5, atol=1e-9)
    assert np.isnan(recording.motor.command_mm[:100]).all()
    j = np.arange(0, 3000, 2)
    np.testing.assert_allclose(recording.load_cell.time_s, 1e-3 * j + 3e-4 - 2e-3, atol=1e-9)
    np.testing.assert_allclose(recording.load_cell.force_N, force_at(j), atol=1e-9)
    np.testing.assert_allclose(recording.load_cell.gross_N, force_at(j) + 0.5, atol=1e-9)
    assert np.flatnonzero(recording.load_cell.flagged).tolist() == [750]


def test_extra_columns_go_through_mcap(tmp_path):
    source = tmp_path / "a.csv"
    source.write_text('time_s,position_mm,force_N,gap_mm,phase\n0,0,1,17.5,down\n1,1,2,,down\n2,2,3,15.5,"a, b"\n')
    convert(source, tmp_path / "a.mcap")
    convert(tmp_path / "a.mcap", tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == (
        'time_s,position_mm,force_N,gap_mm,phase\n0.0,0,1,17.5,down\n1.0,1,2,,down\n2.0,2,3,15.5,"a, b"\n'
    )


def test_foreign_columns_become_ours(tmp_path):
    source = tmp_path / "a.csv"
    source.write_text("t;x;f\n0;0;1\n1;0,001;2\n")
    convert(source, tmp_path / "b.csv", {"time": "t", "position": "x", "force": "f"}, {"position": "m"})
    assert (tmp_path / "b.csv").read_text() == "time_s,position_mm,force_N\n0.0,0,1\n1.0,1,2\n"


def test_what_cannot_be_converted(tmp_path):
    run = tmp_path / "run.mcap"
    write_run(run, seconds=0.6)
    with pytest.raises(InputError, match="ends neither in"):
        convert(run, tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="is MCAP already"):
        convert(run, tmp_path / "other.mcap")
    source = tmp_path / "a.csv"
    source.write_text("time_s,position_mm,force_N\n0,0,1\n1,1,2\n")
    with pytest.raises(InputError, match="is the input itself"):
        convert(source, source)
    with pytest.raises(InputError, match="cannot be written"):
        convert(source, tmp_path / "nowhere" / "b.csv")
    with pytest.raises(InputError, match="are for CSV files"):
        convert(run, tmp_path / "b.csv", {"time": "t"})


def test_times_that_do_not_increase_are_refused(tmp_path):
    with pytest.raises(ValueError, match="increase"):
        write_csv(tmp_path / "a.csv", np.array([0.0, 0.0]), np.zeros(2), np.array([0.0, 1.0]), np.zeros(2))


@pytest.mark.parametrize("there", [False, True])
def test_a_disk_that_fills_leaves_no_part_of_a_table(tmp_path, monkeypatch, there):
    path = tmp_path / "out.csv"
    if there:
        path.write_text("mine")

    def fills(self, text, **_):
        self.write_bytes(b"time_s,posi")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_text", fills)
    with pytest.raises(InputError, match=r"out\.csv: cannot be written \(No space left"):
        write_csv(path, np.arange(3.0), np.zeros(3), np.arange(3.0), np.zeros(3))
    assert path.exists() == there
