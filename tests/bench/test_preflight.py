"""Plans and preflight: what the pad will answer, and what is refused before anything moves."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.config import Bench, load_bench, load_model
from bench.errors import InputError, Refused, Stopped
from bench.plan import allowed_force_speed, plan
from bench.preflight import Preflight, check
from bench.protocol import Protocol, load_protocol
from bench.rates import force_latency_s, force_rate_Hz, motor_rate_Hz
from bench.run.foresight import Foresight
from bench.shipped import shipped_names
from bench.trajectory import Profile
from sim.model import Model
from tests.bench.run.benches import bench_file

LINEAR_N_mm = 4.0


def model(elastic: dict[str, Any] | None = None, contact: str = "unilateral", **relaxation: list[float]) -> Model:
    """A pad; by default a linear spring of 4 N/mm."""
    law = elastic or {"law": "polynomial", "alpha": [0.0, LINEAR_N_mm]}
    return Model.from_dict({"pad": {"elastic": law, "relaxation": relaxation, "contact": contact}})


def protocol(tmp_path: Path, *steps: str, head: str = "") -> Protocol:
    path = tmp_path / "p.yaml"
    path.write_text(f"name: p\n{head}steps:\n" + "".join(f"  - {step}\n" for step in steps))
    return load_protocol(path)


@pytest.fixture(scope="module")
def bench() -> Bench:
    return load_bench("simulated")


def refusal(found: Preflight) -> str:
    error = found.refusal()
    assert error is not None
    return str(error)


# -- what is shipped -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bench_name", shipped_names("bench"))
@pytest.mark.parametrize("pad", ["polyurethane", "silicone"])
@pytest.mark.parametrize("name", shipped_names("protocol"))
def test_shipped_protocols_are_clean_on_both_pads(name: str, pad: str, bench_name: str) -> None:
    found = check(load_protocol(name), load_bench(bench_name), load_model(pad))
    if (name, bench_name) == ("first_contact", "simulated_smc_lec"):  # steps of 0.2 mm/s and less, in whole mm/s
        refusal = found.refusal()
        assert refusal is not None and "its slowest is 1 mm/s" in str(refusal)
        return
    assert found.refusal() is None
    assert found.ok
    if name != "air":
        peak = max(o.peak_N for o in found.outcomes)
        assert 1.0 < peak < 0.9 * found.plan.limits.force_N


@pytest.mark.parametrize("bench_name", shipped_names("bench"))
def test_quick_is_under_a_minute(bench_name: str) -> None:
    found = check(load_protocol("quick"), load_bench(bench_name), load_model("polyurethane"))
    assert found.duration_s + found.approach_s < 60.0


def test_the_staircase_is_the_paper_s() -> None:
    steps = [flat.step for flat in load_protocol("staircase").flatten()]
    depths = [step.to for step in steps]  # type: ignore[union-attr]
    assert all(step.hold == 4 and step.speed == 80 for step in steps)
    assert np.allclose(np.abs(np.diff([0.0, *depths])), 0.6)
    assert max(depths) == 2.4 and depths[-1] == 0.0


# -- plan ------------------------------------------------------------------------------------------------------


def test_segments_follow_each_other_from_above_the_surface(tmp_path: Path, bench: Bench) -> None:
    read = protocol(
        tmp_path,
        "{to: 1, speed: 10, hold: 2}",
        "{to_force: 3, speed: 0.5, hold: 1, hold_mode: force}",
        "{to: 0, speed: 10}",
        head="approach: {retract: 0.4}\nprecondition: {to: 2, speed: 20, cycles: 2, rest: 5}\n",
    )
    planned = plan(read, bench)
    assert planned.start_mm == -0.4
    assert [(s.name, s.phase, s.kind) for s in planned.segments] == [
        ("precondition[0]", "precondition", "ramp"),
        ("precondition[0]", "precondition", "ramp"),
        ("precondition[1]", "precondition", "ramp"),
        ("precondition[1]", "precondition", "ramp"),
        ("precondition", "precondition", "hold"),
        ("steps[0]", "steps", "ramp"),
        ("steps[0]", "steps", "hold"),
        ("steps[1]", "steps", "force_ramp"),
        ("steps[1]", "steps", "force_hold"),
        ("steps[2]", "steps", "ramp"),
        ("finish", "finish", "ramp"),
        ("finish", "finish", "air"),
    ]
    starts = [s.start_mm for s in planned.segments]
    assert starts[:8] == [-0.4, 2.0, -0.4, 2.0, -0.4, -0.4, 1.0, 1.0]
    assert math.isnan(starts[9]) and starts[10] == 0.0
    assert planned.segments[9].profile(1.5).end_mm == 0.0


def test_a_ramp_that_cannot_be_made_is_said_with_its_numbers(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to: 0.1, speed: 80}", "{to: 0.7, speed: 80}", "{to: 3, speed: 80}")
    said = [p for p in plan(read, bench).problems if "reaches" in p.message]
    assert len(said) == 1
    assert said[0].severity == "notice"
    assert said[0].step == "steps[0], steps[1]"  # both are 0.6 mm: sqrt(5000 · 0.6) = 54.8; the third reaches 80
    assert "54.8 of 80 mm/s" in said[0].message


@pytest.mark.parametrize(
    ("head", "step", "words", "at"),
    [
        ("", "{to: 1, speed: 250}", "steps[0]: speed: 250 mm/s is beyond the bench's limits.speed 200", "3:20"),
        (
            "acceleration: 6000\n",
            "{to: 1, speed: 5}",
            "6000 mm/s² is beyond the bench's limits.acceleration 5000",
            "2:15",
        ),
        ("finish: {speed: 500}\n", "{to: 1, speed: 5}", "finish: speed: 500 mm/s is beyond", "2:17"),
        ("approach: {speed: 300}\n", "{to: 1, speed: 5}", "approach: speed: 300 mm/s is beyond", "2:19"),
        ("", "{to_force: 30, speed: 5}", "steps[0]: to_force: 30 N is beyond the bench's limits.force 20 N", "3:16"),
        ("", "{to: 30, speed: 5}", "from -0.5 to 30 mm is more than the bench's limits.position [-5, 6] has", "3:5"),
        ("approach: none\n", "{to: -5.5, speed: 5}", "steps[0]: goes to -5.5 mm in the motor frame", "4:5"),
        ("approach: {speed: 150}\n", "{to: 1, speed: 5}", "a stiff sample (50 N/mm) is touched with", "2:19"),
    ],
)
def test_contradictions_between_the_files(
    tmp_path: Path, bench: Bench, head: str, step: str, words: str, at: str
) -> None:
    found = check(protocol(tmp_path, step, head=head), bench, model())
    assert words in refusal(found)
    error = found.refusal()
    assert isinstance(error, InputError)
    assert error.place == f"{tmp_path / 'p.yaml'}:{at}"


def test_an_s_curve_needs_a_streamed_motor(tmp_path: Path) -> None:
    read = protocol(tmp_path, "{to: 1, speed: 5}", head="profile: s_curve\n")
    assert check(read, load_bench("simulated"), model()).ok
    assert "`iai` makes its own trapezoids" in refusal(check(read, load_bench("simulated_iai"), model()))


def test_a_step_that_a_block_repeats_is_named_once(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{block: a, repeat: 9, steps: [{to: 1, speed: 300}, {to: 0, speed: 1}]}")
    errors = check(read, bench, model()).errors
    assert [e.step for e in errors] == ["steps[0].a[0].steps[0]"]


# -- force targets ---------------------------------------------------------------------------------------------


def test_the_speed_to_a_force_is_what_latency_and_braking_allow() -> None:
    speed = allowed_force_speed(5.0, 8.0, 0.005, 5000.0)
    assert 8.0 * (speed * 0.005 + speed**2 / (2 * 5000.0)) == pytest.approx(0.05 * 5.0, rel=1e-9)
    # At a small target the noise says what can be seen.
    speed = allowed_force_speed(0.1, 8.0, 0.005, 5000.0, noise_N=0.01)
    assert 8.0 * (speed * 0.005 + speed**2 / (2 * 5000.0)) == pytest.approx(0.03, rel=1e-9)


def test_a_slower_speed_than_asked_is_said(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to_force: 5, speed: 60}")
    for believed, words in ((model(), "4 N/mm"), (None, "50 N/mm (taken for want of a model)")):
        planned = plan(read, bench, believed)
        ramp = next(s for s in planned.segments if s.kind == "force_ramp")
        assert ramp.speed_mm_s < ramp.asked_mm_s == 60
        said = [p for p in planned.problems if p.step == "steps[0]"]
        assert [p.severity for p in said] == ["notice"]
        assert "asked for" in said[0].message and words in said[0].message
    slow = protocol(tmp_path, "{to_force: 5, speed: 0.5}")
    assert not plan(slow, bench, model()).problems


def test_latency_and_rates_follow_from_the_wire(bench: Bench) -> None:
    assert motor_rate_Hz(bench) == 1000.0
    assert force_rate_Hz(bench) == pytest.approx(115200 / 210)  # 21 bytes of 10 bits: 549 a second (docs/devices.md 6)
    assert force_latency_s(bench) == pytest.approx(2 * 210 / 115200 + 1e-3)
    # the wire alone takes 374 a second (docs/devices.md 6); host and motor keep 2 ms of silence each as delivered (7.3)
    for gap_us, most_Hz in ((0, 374.0), (None, 1.0 / (1.0 / 374.0 + 2 * 2e-3))):
        slow = bench.model_copy(update={"motor": bench.motor.model_copy(update={"baudrate": 115200, "gap_us": gap_us})})
        assert motor_rate_Hz(slow) == pytest.approx(most_Hz, abs=0.5)


def test_a_force_target_ends_where_the_pad_says(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to_force: 6, speed: 2, hold: 1}", "{to_force: 2, speed: 2, hold: 1}")
    found = check(read, bench, model())
    latency = force_latency_s(bench)
    over = 2.0 * latency + 2.0**2 / (2 * 5000.0)
    up, down = found.outcomes[0], found.outcomes[2]
    # It stops at the first sample at or beyond the target: up to one grid step (1 ms at 2 mm/s) late.
    assert up.deepest_mm == pytest.approx(6.0 / LINEAR_N_mm + over, abs=2e-3 + 1e-9)
    assert up.deepest_mm >= 6.0 / LINEAR_N_mm + over - 1e-9
    assert down.highest_mm == pytest.approx(2.0 / LINEAR_N_mm - over, abs=2e-3 + 1e-9)
    assert found.ok


def test_a_held_force_creeps(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to_force: 4, speed: 2, hold: 30, hold_mode: force}")
    found = check(read, bench, model(shares=[0.3], rates=[1.0]))
    prediction = found.prediction
    hold = prediction.segment == 1
    assert prediction.force_N[hold][-1] == pytest.approx(4.0, rel=0.01)
    # At rest the force is c_0 K δ.
    assert prediction.position_mm[hold][-1] == pytest.approx(4.0 / (0.7 * LINEAR_N_mm), rel=0.01)


def test_without_a_model_a_force_target_may_go_as_deep_as_allowed(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to_force: 1, speed: 1, hold: 1}", head="limits: {depth: 2.5}\n")
    found = check(read, bench, None)
    assert found.ok
    assert found.outcomes[0].deepest_mm == 2.5
    assert np.isnan(found.prediction.force_N).all()
    assert any("no pad model" in p.message for p in found.notices)
    assert any(line.startswith("at most") for line in found.lines())


# -- predictions -----------------------------------------------------------------------------------------------


def test_the_peak_of_a_purely_elastic_pad_is_the_law_s(tmp_path: Path, bench: Bench) -> None:
    believed = model({"law": "exponential", "m": 2.24, "b": 0.69})
    found = check(protocol(tmp_path, "{to: 1.5, speed: 80, hold: 1}", "{to: 0, speed: 5}"), bench, believed)
    expected = 2.24 / 0.69 * math.expm1(0.69 * 1.5)  # (9)
    assert max(o.peak_N for o in found.outcomes) == pytest.approx(expected, rel=1e-9)


def test_a_force_limit_is_refused_with_step_value_and_limit(tmp_path: Path, bench: Bench) -> None:
    read = protocol(
        tmp_path,
        "{to: 1, speed: 20}",
        "{block: deep, repeat: 3, steps: [{to: 0.5, speed: 5}, {to: 3, speed: 5}]}",
        head="limits: {force: 9}\n",
    )
    found = check(read, bench, model())
    error = found.refusal()
    assert isinstance(error, Refused) and error.status == 1
    assert str(error).startswith("steps[1].deep[0].steps[1]: 12 N are expected")
    assert "limits.force 9 N" in str(error)
    assert len(found.errors) == 1
    assert any(line.startswith("refused: steps[1].deep[0].steps[1]") for line in found.lines())


def test_the_bench_s_force_limit_holds_too(tmp_path: Path, bench: Bench) -> None:
    found = check(protocol(tmp_path, "{to: 5.5, speed: 5}"), bench, model())
    assert "22 N are expected" in refusal(found) and "limits.force 20 N" in refusal(found)


def test_a_pull_beyond_the_limit_is_refused(tmp_path: Path, bench: Bench) -> None:
    # A bonded pad that has relaxed by 80 % pulls when it is brought back: 0.8 · 4 N/mm · 3 mm less than what recovers.
    read = protocol(tmp_path, "{to: 3, speed: 80, hold: 60}", "{to: 0, speed: 80}")
    found = check(read, bench, model(contact="bonded", shares=[0.8], rates=[1.0]))
    assert "steps[1]: a pull of 9." in refusal(found)
    assert "limits.tension 5 N" in refusal(found)
    assert check(read, bench, model(contact="unilateral", shares=[0.8], rates=[1.0])).ok


def test_a_target_that_is_never_reached_is_refused(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to_force: 10, speed: 1}", head="limits: {depth: 2}\n")
    assert "steps[0]: 10 N are not expected before 2 mm" in refusal(check(read, bench, model()))


def test_travel_is_exact_once_the_surface_is_known(tmp_path: Path, bench: Bench) -> None:
    read = protocol(tmp_path, "{to: 3, speed: 5}")
    assert check(read, bench, model(), surface_mm=3.0).ok  # 3 + 3 = 6, the end of limits.position
    found = check(read, bench, model(), surface_mm=3.2)
    assert "steps[0]: goes to 6.2 mm in the motor frame (surface at 3.2 mm)" in refusal(found)
    assert isinstance(found.refusal(), Refused)
    assert "goes to -5.2 mm" in refusal(check(read, bench, model(), surface_mm=-4.7))
    assert check(read, bench, model()).surface_mm == (-4.5, 3.0)


def test_the_surface_is_met_within_the_travel_however_far_from_it_the_steps_keep(tmp_path: Path, bench: Bench) -> None:
    lowest, highest = bench.limits.position
    read = protocol(tmp_path, "{to: -4, speed: 5}")
    assert check(read, bench, model()).surface_mm == (lowest + 4.0, highest)


def test_arrays_belong_together(bench: Bench) -> None:
    found = check(load_protocol("staircase"), bench, load_model("polyurethane"))
    prediction = found.prediction
    n = prediction.time_s.size
    assert prediction.position_mm.shape == prediction.force_N.shape == prediction.segment.shape == (n,)
    assert (np.diff(prediction.time_s) > 0).all()
    assert prediction.time_s[-1] == pytest.approx(found.duration_s)
    assert prediction.starts_s.shape == (len(prediction.segments),)
    # 8 holds of 4 s, a rest of 10 s, 3 s of air, and ramps of less than a second in all but the precondition's
    assert 45.0 < found.duration_s < 48.0
    assert found.samples["motor"] == pytest.approx(1000 * (found.duration_s + found.approach_s), abs=1)


def test_a_vertical_axis_that_is_let_go_is_said(tmp_path: Path, bench: Bench) -> None:
    vertical = bench.model_copy(update={"motor": bench.motor.model_copy(update={"orientation": "vertical"})})
    found = check(protocol(tmp_path, "{to: 1, speed: 5}"), vertical, model())
    assert any("falls on the sample" in p.message for p in found.notices)


def test_the_summary_has_a_row_a_step(bench: Bench) -> None:
    lines = check(load_protocol("rich"), bench, load_model("polyurethane")).lines(width=90)
    assert all(len(line) <= 90 for line in lines[:20])
    row = next(line for line in lines if line.startswith("steps[3].cycle[*].steps[0]"))
    assert row.split()[1:5] == ["4", "1.4", "mm", "20"]


# -- a force that is no number ---------------------------------------------------------------------------------


@pytest.mark.parametrize("relaxation", [{}, {"shares": [0.25], "rates": [4.0]}])
def test_a_pad_whose_force_is_no_number_is_refused(tmp_path: Path, bench: Bench, relaxation: Any) -> None:
    """With modes infinity less infinity is no number, and no number is greater than a limit."""
    steep = model({"law": "exponential", "m": 2.0, "b": 1e6}, **relaxation)
    found = check(protocol(tmp_path, "{to: 1.0, speed: 40}", head="limits: {force: 9}\n"), bench, steep)
    assert isinstance(found.refusal(), Refused) and "no finite force" in refusal(found)


def test_nothing_is_simulated_with_a_force_that_is_no_number(padbench, csv) -> None:
    Path("steep.yaml").write_text(
        "pad:\n  elastic: {law: exponential, m: 2, b: 1e6}\n  relaxation: {shares: [0.25], rates: [4.0]}\n"
    )
    for motion in (("--like", csv), ("--protocol", "quick")):
        said = padbench("simulate", "steep.yaml", *motion, "--out", "out.csv")
        assert said.status == 2 and "no finite force" in said.err and not Path("out.csv").exists()


def test_a_foreseen_force_that_is_no_number_stops_the_run(tmp_path: Path, bench: Bench) -> None:
    planned = check(protocol(tmp_path, "{to: 1.0, speed: 40}", head="limits: {force: 9}\n"), bench).plan
    steep = model({"law": "exponential", "m": 2.0, "b": 1e6}, shares=[0.25], rates=[4.0])
    foresight = Foresight(steep, planned.limits)
    foresight.start(0.0)
    with pytest.raises(Stopped, match="not begun"):
        foresight.allow("steps[0]", Profile(-0.1, 1.0, 40.0, 1000.0))


# -- without end -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "head", "line"),
    [
        (["{to: 1, speed: 5}", "{to: 2, speed: 5, hold: 1e12}"], "", 4),
        (["{to: 2, speed: 5, hold: 1e10}"], "", 3),
        (["{to: 2, speed: 1e-8}"], "", 3),
        (["{to_force: 2, speed: 1e-9}"], "limits: {depth: 2.5}\n", 4),
        (["{to_force: 2, speed: 1, hold: 1e11, hold_mode: force}"], "limits: {depth: 2.5}\n", 4),
        (["{to: 1, speed: 5}"], "finish: {air: 1e12}\n", 2),
        (["{block: day, repeat: 30, steps: [{to: 1, speed: 5, hold: 86400}]}"], "", 3),
    ],
)
def test_more_than_a_week_is_refused_where_it_stands(tmp_path, bench, steps, head, line) -> None:
    """Whether it is one wait, a motion that hardly moves, or what is repeated."""
    with pytest.raises(InputError, match="more than a week") as refused:
        check(protocol(tmp_path, *steps, head=head), bench, model())
    assert f"p.yaml:{line}:" in str(refused.value)


def test_a_day_of_waiting_is_a_protocol(tmp_path: Path, bench: Bench) -> None:
    assert check(protocol(tmp_path, "{to: 1, speed: 5, hold: 86400}"), bench).duration_s > 86400


# -- rates that a run could not live with --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sampling", "words"), [("{motor: 0.001}", "a motor sample every 1e.06 ms"), ("{load_cell: 2}", "make no tare")]
)
def test_rates_with_which_a_run_would_stop(tmp_path: Path, bench: Bench, sampling: str, words: str) -> None:
    found = check(protocol(tmp_path, "{to: 1, speed: 5}", head=f"sampling: {sampling}\n"), bench, model())
    error = found.refusal()
    assert isinstance(error, InputError) and re.search(words, str(error)) and "p.yaml:2:" in str(error)


@pytest.mark.parametrize(("speed", "passes"), [(5, True), (80, False)])
def test_a_streamed_motor_that_hears_too_seldom(tmp_path: Path, speed: float, passes: bool) -> None:
    """28 bytes of 11 bits at 19 200 baud are 16 ms at the least: 80 mm/s are 1.3 mm then, 0.5 mm allowed."""
    slow = load_bench(bench_file(tmp_path, motor={"baudrate": 19200}))
    found = check(protocol(tmp_path, f"{{to: 2, speed: {speed}}}", head="limits: {force: 15}\n"), slow, model())
    assert (found.refusal() is None) == passes
    assert passes or "behind: limits.following_error is 0.5 mm" in refusal(found)


def test_a_plan_needs_no_recordings_nor_what_reads_them() -> None:
    code = "import sys, bench.preflight; print([m for m in ('scipy', 'mcap', 'bench.recording') if m in sys.modules])"
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]", done.stderr
