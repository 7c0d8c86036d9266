from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from bench.recording.types import Event, ForceChannel, MotorChannel, Recording, StepMark
from bench.report import Evidence, Plan, plots, write_report
from bench.report.page import report_page
from bench.report.plots import fastest_ramp
from tests.bench.diagnose.small import made_up

from . import samples
from .html_check import check


@pytest.fixture(scope="module")
def run() -> Recording:
    return samples.recording()


@pytest.fixture(scope="module")
def seen(run: Recording):  # type: ignore[no-untyped-def]
    return check(report_page(run, samples.fit(run)))


def test_the_page_says_what_a_reader_asks_first(seen) -> None:  # type: ignore[no-untyped-def]
    words = seen.shown
    assert "Exponential elastic law with 2 relaxation modes, unilateral contact" in words
    assert "off by 30.7 mN rms, 2.5 times the noise floor of 12.1 mN" in words
    assert "98.7 % fit" in words
    for part in ("staircase", "PU-07", "K. Ito", "second day, after a night at rest", "temperature 23.1 °C"):
        assert part in words
    assert "simulated bench" in words
    assert "3.2170 mm in the motor frame, ± 3.1 µm" in words


def test_axes_name_their_units(seen) -> None:  # type: ignore[no-untyped-def]
    for label in ("depth, mm", "force, N", "residual, mN", "time, s", "elastic response Fᵉ, N", "time after a step, s"):
        assert label in seen.words, label


def test_parameters_with_doubt(seen) -> None:  # type: ignore[no-untyped-def]
    words = seen.shown
    assert "m 2.241 0.010 N/mm 0.46 % stiffness at the surface" in words
    assert "ν₁ 4.010 0.034 1/s 0.85 % rate of relaxation mode 1, time constant 0.249 s" in words
    assert "c₀ 0.6004" in words  # 1 − 0.2507 − 0.1489


def test_traffic_retries_and_overruns_are_shown(seen) -> None:  # type: ignore[no-untyped-def]
    words = seen.shown
    assert "exchanges retries crc errors lines" in words
    assert "motor 43000 7 0" in words
    assert "overruns 3" in words
    assert "retry 7×" in words


def test_undetermined_is_said_in_words(run: Recording) -> None:
    words = check(report_page(run, samples.fit(run, undetermined=["nu_2"]))).shown
    assert "do not determine nu_2" in words
    assert "undetermined by these data" in words


@pytest.mark.parametrize(
    ("changes", "tone", "said"),
    [
        ({"rmse": 0.0122}, "good", "down to the noise"),
        ({"rmse": 0.0132}, "good", "close to the noise"),
        ({"rmse": 0.0122, "converged": False}, "bad", "did not converge"),
        ({"rmse": 0.0122, "physical": False}, "bad", "is not a relaxation"),
        ({"rmse": 0.0122, "undetermined": ["b"]}, "fair", "do not determine b"),
        ({"rmse": 1.5, "fit_percent": 40.0}, "bad", "does not explain these data"),
        ({"noise_floor": None}, "plain", "noise of these data is not known"),
    ],
)
def test_verdicts(run: Recording, changes: dict[str, object], tone: str, said: str) -> None:
    from bench.report.verdict import fit_verdict

    verdict = fit_verdict(samples.fit(run, **changes), "")
    assert verdict.tone == tone
    assert said in verdict.headline + " ".join(verdict.sentences)


def test_a_stopped_run_shows_its_first_cause(run: Recording) -> None:
    stopped = dataclasses.replace(
        run, result={"status": "stopped", "cause": "force 20.4 N over the limit of 20 N in steps[3]"}
    )
    page = report_page(stopped, None, fit_problem="steps[3] was not finished")
    words = check(page).shown
    assert "The run was stopped before its protocol ended" in words
    assert "First cause: force 20.4 N over the limit of 20 N in steps[3]" in words
    assert "No model was fitted" in words and "Steps[3] was not finished." in words
    assert 'class="verdict bad"' in page


def test_an_unfinished_run_takes_its_cause_from_the_earliest_stop(run: Recording) -> None:
    events = [
        Event(30.0, "stopped", {"cause": "the load cell went silent"}),
        Event(20.0, "limit", {"cause": "tension 6 N over the limit of 5 N"}),
        *run.events,
    ]
    torn = dataclasses.replace(run, result=None, events=events, lost="the last chunk is torn")
    words = check(report_page(torn, None)).shown
    assert "The run is unfinished" in words
    assert "First cause: tension 6 N over the limit of 5 N (at 20.000 s)" in words
    assert "the last chunk is torn" in words


def test_unfinished_without_any_cause_is_still_said(run: Recording) -> None:
    words = check(report_page(dataclasses.replace(run, result=None), None)).shown
    assert "The run is unfinished" in words
    assert "the recording ends before the run did" in words


def test_what_comes_from_outside_is_escaped(run: Recording) -> None:
    evil = "</style></svg><script>alert(1)</script><img src=x onerror=alert(2)>$x_1$"
    marks = [dataclasses.replace(mark, name=evil, phase=evil, kind=evil) for mark in run.steps]
    hostile = dataclasses.replace(
        run,
        run=dict.fromkeys(run.run, evil) | {evil: evil},
        result={"status": evil, "traffic": f'{{"{evil}": {{"{evil}": "{evil}"}}}}', evil: evil},
        events=[Event(1.0, evil, {evil: evil}), Event(2.0, "tare", {evil: evil})],
        steps=marks,
        attachments={f"{evil}.yaml": evil.encode()},
        lost=evil,
    )
    fit = dataclasses.replace(
        samples.fit(run, law=evil, contact=evil, method=evil, undetermined=[evil]),
        evidence=[Evidence(evil, 1, 0.1, remark=evil, contact=evil)],
        notes=[evil],
    )
    fit.json["parameters"][evil] = {"value": 1.0, "std": 0.1, "unit": evil}  # type: ignore[index]
    page = report_page(hostile, fit, fit_problem=evil, title=evil)
    seen = check(page)  # no script, no handler, balanced
    assert "img" not in seen.tags
    assert evil in seen.shown  # shown as it was written, dollar signs too


def test_the_same_input_gives_the_same_bytes(run: Recording, tmp_path: Path) -> None:
    fit = samples.fit(run)
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, run, fit)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_users_matplotlib_settings_neither_reach_the_page_nor_are_changed(run: Recording) -> None:
    import matplotlib as mpl

    plain = report_page(run, None)
    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 30.0, "axes.facecolor": "red", "svg.fonttype": "path"}):
        before = dict(mpl.rcParams)
        assert report_page(run, None) == plain
        assert dict(mpl.rcParams) == before


@pytest.mark.long
def test_long_and_noisy_recordings_stay_under_two_megabytes(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    run = samples.recording(2500.0, 2500.0)
    run.load_cell.force_N = run.load_cell.force_N + 2.0 * random.standard_normal(run.load_cell.time_s.size)
    run.motor.position_mm = run.motor.position_mm + 0.2 * random.standard_normal(run.motor.time_s.size)
    fit = samples.fit(run, noise_floor=2.0, rmse=2.1)
    assert run.load_cell.time_s.size > 100_000
    write_report(tmp_path / "report.html", run, fit)
    assert (tmp_path / "report.html").stat().st_size < 2_000_000
    seen = check((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert any(link.startswith("data:image/png") for link in seen.links)  # the cloud is a picture by then


def test_many_steps_and_events_stay_under_two_megabytes(run: Recording) -> None:
    marks = [StepMark(0.01 * i, f"cycle[{i}].steps[0]", "steps", "ramp", 1.0, 5.0) for i in range(4000)]
    events = [Event(0.004 * i, ("retry", "odd")[i % 2], {"count": i}) for i in range(10_000)]
    page = report_page(dataclasses.replace(run, steps=marks, events=events), None)
    assert len(page.encode()) < 2_000_000
    words = check(page).shown
    assert "odd 4960×" in words and "retry 5000×" in words
    assert "3600 more in the recording" in words


def nothing(n: int = 0, **changes: object) -> Recording:
    t = np.arange(float(n))
    motor = MotorChannel(t, t * 0, t * np.nan, t * np.nan, t)
    cell = ForceChannel(t, t * 0, t * 0, t, np.zeros(n, dtype=bool))
    return dataclasses.replace(Recording(Path("data.csv"), motor, cell), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [0, 1, 2, 5])
@pytest.mark.parametrize("surface", [None, 0.0])
def test_next_to_no_data_still_makes_a_page(n: int, surface: float | None) -> None:
    words = check(report_page(nothing(n, surface_mm=surface), None, fit_problem="no sample")).shown
    assert "data.csv" in words and "No sample." in words
    assert "unfinished" not in words  # a file of data is no run of ours


def test_a_channel_of_nan_is_survived() -> None:
    run = nothing(50, surface_mm=0.0)
    run.motor.position_mm[:] = np.nan
    run.load_cell.force_N[:] = np.nan
    check(report_page(run, None))


def test_expected_force_and_plan_are_drawn(run: Recording) -> None:
    t = np.linspace(8, 40, 500)
    seen = check(report_page(run, None, plan=Plan(t, np.sin(t), np.cos(t))))
    assert "planned" in seen.words and "expected before the run" in seen.words


def test_flagged_samples_are_marked(run: Recording) -> None:
    flagged = np.zeros(run.load_cell.time_s.size, dtype=bool)
    flagged[100:110] = True
    cell = dataclasses.replace(run.load_cell, flagged=flagged)
    seen = check(report_page(dataclasses.replace(run, load_cell=cell), None))
    assert "flagged by the cell" in seen.words and "The load cell flagged 10 samples." in seen.shown


def test_files_beside_the_page_are_linked(run: Recording, tmp_path: Path) -> None:
    (tmp_path / "fit.json").write_text("{}")
    (tmp_path / "private.txt").write_text("")
    write_report(tmp_path / "report.html", run, None)
    seen = check((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "fit.json" in seen.links
    assert not any("private" in link or "mcap" in link for link in seen.links)


def test_rates_are_those_of_the_stamps(run: Recording, seen) -> None:  # type: ignore[no-untyped-def]
    words = seen.shown
    assert f"motor {run.motor.time_s.size} 1000 1000 1.00 at" in words
    assert f"load cell {run.load_cell.time_s.size} 550.0 550.0 1.82 at" in words
    # the position lags by 1.2 ms: at 80 mm/s that is 0.096 mm
    assert "mm rms, 0.09" in words


def test_the_fastest_ramp_is_found_with_and_without_marks(run: Recording) -> None:
    ramps = [mark for mark in run.steps if mark.kind == "ramp" and mark.phase == "steps"]
    start, end = fastest_ramp(run) or (0.0, 0.0)
    assert start in [mark.time_s for mark in ramps]
    assert end - start == pytest.approx(0.6 / 80.0)
    unmarked = fastest_ramp(dataclasses.replace(run, steps=[]))
    assert unmarked is not None
    t, x, _ = samples.corners()
    speeds = np.abs(np.diff(x) / np.diff(t))
    fast = [(a, b) for a, b, v in zip(t[:-1], t[1:], speeds, strict=True) if v > 79.0]
    middle = (unmarked[0] + unmarked[1]) / 2
    assert any(a < middle < b + 0.003 for a, b in fast)


def test_the_date_comes_from_host_folder_or_a_real_clock(run: Recording) -> None:
    from bench.report.facts import started

    assert started(run, {"started": "2026-11-21T09:51:00+01:00"}) == "2026-11-21 09:51:00+01:00"
    assert started(run) == "2026-11-21 09:50:12"
    elsewhere = dataclasses.replace(run, source=Path("/data/a/recording.mcap"))
    assert started(elsewhere) == ""  # the epoch of a virtual clock is no date
    real = dataclasses.replace(elsewhere, run={"simulated": "false", "epoch_ns": "946684800000000000"})
    assert started(real) == "2000-01-01 00:00:00 UTC"


def test_an_air_run_speaks_of_no_surface(run: Recording) -> None:
    air = dataclasses.replace(
        run, surface_mm=0.0, surface_std_mm=0.0, events=[Event(0.1, "no_surface", {"surface_mm": 0.0})]
    )
    seen = check(report_page(air, None, fit_problem="there was no pad (air run)"))
    assert "No surface was looked for" in seen.shown
    assert "motor position, mm" in seen.words and "depth, mm" not in seen.words and "pad surface" not in seen.words
    assert "Force against indentation" not in seen.shown


def test_structures_are_ranked_and_the_far_ones_folded(run: Recording) -> None:
    rows = [Evidence(f"law{i}", 1 + i % 3, 0.1 + i, criterion=float(100 - i), chosen=i == 0) for i in range(30)]
    words = check(report_page(run, dataclasses.replace(samples.fit(run), evidence=rows))).shown
    shown = words[words.index("Structures tried law order") : words.index("21 further structures")]
    assert "law29 3 29.1" in shown and "chosen" in shown and "law15" not in shown
    assert shown.index("law29") < shown.index("law28") < shown.index("law0")


def test_figures_have_units_and_no_more_digits_than_a_bench_tells(run: Recording) -> None:
    events = [
        Event(0.1, "tare", {"tare_N": -0.000686703, "drift_N_s": 0.00079252}),
        Event(0.2, "contact", {"position_mm": 1.545612345, "net_N": 12.345678, "threshold_N": 0.0535333}),
    ]
    about = {"probe": '{"id": "s5", "shape": "sphere", "radius": 5}', "timing": '{"force_delay": 0.0}'}
    shown = check(report_page(dataclasses.replace(run, events=events, run={**run.run, **about}), None)).shown
    for said in ("radius 5 mm", "force delay 0 s", "tare −0.000687 N", "drift 0.000793 N/s", "position 1.5456 mm",
                 "net 12.346 N", "threshold 0.0535 N"):  # fmt: skip
        assert said in shown, said


def test_the_plan_shows_beside_a_run_that_follows_it(run: Recording) -> None:
    """A line under another of its width would be in the legend alone."""
    at, motor, zero = np.isfinite(run.motor.command_mm), run.motor, run.surface_mm or 0.0
    page = plots.trajectory(run, Plan(motor.time_s[at], motor.command_mm[at] - zero), [])
    drawn = re.findall(r"clip-path[^>]*stroke: var\(--(\w+)\); stroke-width: ([\d.]+)", page)
    width = {name: float(points) for name, points in drawn}
    assert width["expected"] > 2 * width["commanded"]


def test_fit_and_diagnosis_with_other_figures_say_why(run: Recording) -> None:
    fit, told = samples.fit(run), made_up(noise_floor=0.0101, held_out_before=0.0102)
    same = dataclasses.replace(fit, json={**fit.json, "noise_floor": 0.01012, "held_out_rmse": 0.0102})
    other = dataclasses.replace(fit, json={**fit.json, "noise_floor": 0.0105, "held_out_rmse": 0.0102})
    said = [
        "motion as the pad felt it" in check(report_page(run, view, diagnosis=told)).shown
        for view in (same, other, None)
    ]
    assert said == [False, True, False]
