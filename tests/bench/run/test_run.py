"""Runs from the first byte to the safe state, on each simulated bench, judged by the truth behind it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.bench.run.benches import SHORT, Done, merged, once, run

STILL_S = 0.2
BY_FORCE = {
    "name": "by force",
    "approach": {"speed": 4, "retract": 0.3},
    "limits": {"force": 12, "depth": 2.5},
    "steps": [
        {"to_force": 0.5, "speed": 5, "hold": 0.5},
        {"to_force": 4, "speed": 5, "hold": 2.5, "hold_mode": "force"},
        {"to_force": 1.5, "speed": 5, "hold": 0.3},
    ],
    "finish": {"retract": 0.3, "air": 0.5},
}
CASES = [
    pytest.param(("quick", "simulated", "polyurethane"), marks=pytest.mark.long),
    ("quick", "simulated", "silicone"),
    ("quick", "simulated_iai", "polyurethane"),
    ("quick", "simulated_modbus", "silicone"),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(case))
def done(request, tmp_path_factory) -> Done:
    protocol, base, pad = request.param
    return run(tmp_path_factory.mktemp("run"), protocol, base, simulation={"pad": pad})


def quantum_mm(done: Done) -> float:
    """What the motor counts in, as its maker says: 1 µm of an Orca, 10 µm of an IAI."""
    return 0.001 if done.bench.motor.driver == "orca" else 0.01


def test_it_ends_well_and_says_so(done):
    assert done.outcome.cause is None and not done.outcome.findings.not_safe
    assert done.result["status"] == "done" and done.result["cause"] == ""
    assert not done.events("stopped")
    assert done.result["motor_samples"] == done.recording.motor.time_s.size == done.outcome.motor_samples
    assert done.result["force_samples"] == done.recording.load_cell.time_s.size == done.outcome.force_samples


def test_the_surface_is_found_within_the_uncertainty_that_is_stated(done):
    surface = done.outcome.findings.surface
    assert surface is not None and surface.std_mm < 0.02
    assert abs(surface.position_mm - done.world.surface_mm) < 3.5 * surface.std_mm
    assert done.recording.surface_mm == surface.position_mm and done.recording.surface_std_mm == surface.std_mm


def test_the_threshold_of_contact_is_five_sigma_at_least(done):
    touch, air = done.events("touch_off")[0], done.events("tare")[0]
    assert touch.data["threshold_N"] >= max(0.05, 5 * air.data["sigma_N"])
    assert air.data["sigma_N"] == pytest.approx(0.01, rel=0.25), "the noise of the bench file"
    assert abs(air.data["tare_N"]) < 4 * 0.01 / np.sqrt(air.data["samples"])


def test_ramps_reach_what_is_planned_and_holds_stay_there(done):
    held = [(mark, end) for mark, end in done.stretches() if mark.kind in ("hold", "air") and mark.phase != "tare"]
    assert len(held) == 7
    for mark, end in held:
        still = done.depth(end - STILL_S, end)
        assert still.mean() == pytest.approx(mark.target_mm, abs=2e-3 + quantum_mm(done) / 2), mark.name
        assert np.ptp(still) < 8e-3 + 2 * quantum_mm(done), "nothing but noise and the encoder's steps"


def test_every_step_is_marked_in_order_with_its_target(done):
    marks = done.recording.steps
    assert [mark.phase for mark in marks[:2]] == ["tare", "approach"]
    assert [(m.name, m.phase, m.kind) for m in marks[2:]] == [(s.name, s.phase, s.kind) for s in done.plan.segments]
    for mark, segment in zip(marks[2:], done.plan.segments, strict=True):
        assert mark.target_mm == segment.target_mm
        if segment.kind == "ramp":
            assert mark.speed_mm_s == segment.speed_mm_s
    starts = [mark.time_s for mark in marks]
    assert starts == sorted(starts)
    assert done.result["steps"] == len(marks)


def test_ramps_are_as_fast_as_asked_for(done):
    motor = done.recording.motor
    at_mm = -0.5
    for mark, end in done.stretches():
        if mark.kind != "ramp" or mark.phase != "steps":
            continue
        first, last = np.searchsorted(motor.time_s, [mark.time_s, end])
        around = slice(max(first - 1, 0), last + 1)  # a polled axis is asked but once or twice in a ramp
        t, command = motor.time_s[around], motor.command_mm[around]
        way, at_mm = abs(mark.target_mm - at_mm), mark.target_mm
        planned = (mark.speed_mm_s, np.sqrt(way * done.bench.limits.acceleration))
        fastest = np.abs(np.diff(command) / np.diff(t)).max()
        assert fastest <= min(planned) * 1.02
        assert fastest >= min(planned) * (0.9 if done.bench.motor.driver == "orca" else 0.5)


def test_what_was_commanded_and_what_was_measured_are_two_things(done):
    motor = done.recording.motor
    error = motor.command_mm - motor.position_mm
    assert np.isfinite(motor.command_mm).all()
    assert 0.01 < np.abs(error).max() < done.bench.limits.following_error, "an axis lags in a ramp of 60 mm/s"
    hold, end = next((m, e) for m, e in done.stretches() if m.kind == "hold")
    inside = (motor.time_s > end - STILL_S) & (motor.time_s < end)
    assert np.ptp(motor.command_mm[inside]) == 0.0
    assert np.ptp(motor.position_mm[inside]) > 0.0 or quantum_mm(done) == 0.01
    assert hold.target_mm == pytest.approx(motor.command_mm[inside][0] - done.surface_mm, abs=1e-9)


def test_it_finishes_in_air_with_the_force_back_at_zero(done):
    mark, end = done.stretches()[-1]
    assert (mark.phase, mark.kind) == ("finish", "air")
    air = done.force(end - 2.0, end)
    assert abs(air.mean()) < 0.004 and air.std() < 0.013
    assert done.depth(end - STILL_S, end).mean() < -0.45


def test_the_device_itself_is_in_the_safe_state(done):
    assert done.is_safe()
    state = done.outcome.findings.safe_state
    assert state is not None and state["state"] == done.bench.motor.safe_state
    assert done.result["safe_state"] == state
    assert done.events("safe_state")[0].data["asked"] == done.bench.motor.safe_state


def test_the_load_cell_is_left_quiet(done):
    line = done.world.endpoints["load_cell"].line
    before = line.bytes_to_host
    done.world.clock.wait([], done.world.clock.now() + 1.0)
    assert line.bytes_to_host == before


def test_the_counters_are_those_of_the_wire(done):
    for key, endpoint in done.world.endpoints.items():
        counted = done.result["traffic"][key]
        assert counted["bytes_out"] == endpoint.line.bytes_to_device > 0
        assert counted["bytes_in"] == endpoint.line.bytes_to_host > 10_000
        assert (counted["timeouts"], counted["bad_frames"], counted["refusals"]) == (0, 0, 0)


def test_stamps_are_when_it_was_measured(done):
    """The true pad, moved as was measured from where its surface truly is, answers with the force that was measured."""
    recording = done.recording
    for channel in (recording.motor, recording.load_cell):
        assert (np.diff(channel.time_s) > 0).all() and (channel.received_s > channel.time_s).all()
    if done.bench.motor.driver != "orca":
        return  # seventy polls a second do not tell a ramp of 60 mm/s
    motor, cell = recording.motor, recording.load_cell
    force_time = cell.time_s - done.bench.timing.force_delay
    inside = (force_time > motor.time_s[0]) & (force_time < motor.time_s[-1])
    depth = motor.position_mm - done.world.surface_mm
    error = cell.force_N[inside] - done.truth.simulate_at(motor.time_s, depth, force_time[inside])
    assert error.std() < 0.0125, "the noise of 10 mN, and little more"


@pytest.mark.parametrize("base", ["simulated", pytest.param("simulated_iai", marks=pytest.mark.long)])
def test_force_targets_are_met_and_held(tmp_path, base):
    done = run(tmp_path, BY_FORCE, base)
    assert done.outcome.cause is None
    reached = done.events("force_reached")
    assert [event.data["target_N"] for event in reached] == [0.5, 4.0, 1.5]
    for event in reached:
        target = event.data["target_N"]
        felt = done.force(event.time_s - 0.03, event.time_s + 0.03)
        assert felt.mean() == pytest.approx(target, abs=0.05 * target + 3 * 0.01)
        assert event.data["net_N"] == pytest.approx(target, abs=0.05 * target + 0.01)
    creep, end = next((m, e) for m, e in done.stretches() if m.kind == "force_hold")
    held = done.force(creep.time_s + 0.5, end)
    assert held.mean() == pytest.approx(4.0, abs=0.06), "held within 1.5 %"
    depth = done.depth(creep.time_s, end)
    assert depth[-5:].mean() - depth[:5].mean() > 0.03, "the pad creeps: the probe has to follow it"
    hold, end = next((m, e) for m, e in done.stretches() if m.kind == "hold")
    relaxed = done.force(hold.time_s, end)
    assert relaxed[-50:].mean() < relaxed[:50].mean(), "position held: the force relaxes"


def test_a_first_contact_is_gentle(tmp_path):
    """Some tenths of a newton on a pad of which nothing is known, on the motor that can only be polled."""
    steps = [{"to_force": 0.1, "speed": 0.05, "hold": 0.3}, {"to_force": 0.3, "speed": 0.1, "hold": 0.3}]
    slow = {"approach": {"speed": 1.0, "retract": 0.2}, "limits": {"force": 3, "depth": 2}, "steps": steps}
    done = run(tmp_path, merged(SHORT, slow), "simulated_iai", simulation={"pad": "silicone", "surface": 0.8})
    assert done.outcome.cause is None
    for event in done.events("force_reached"):
        felt = done.force(event.time_s - 0.05, event.time_s + 0.05).mean()
        assert felt == pytest.approx(event.data["target_N"], abs=0.02)
    assert done.recording.load_cell.force_N.max() < 0.45


def test_an_air_run_knows_no_surface(tmp_path):
    steps = [{"to": -1.0, "speed": 20, "hold": 0.3}, {"to": 0.5, "speed": 20, "hold": 0.3}]
    air = {"name": "a", "approach": "none", "steps": steps, "finish": {"air": 0.3}}
    done = run(tmp_path, air, simulation={"surface": 2.0})
    assert done.outcome.cause is None and done.outcome.findings.surface is None
    assert done.events("no_surface") and not done.events("touch_off")
    assert np.abs(done.recording.load_cell.force_N).max() < 0.08
    first, end = next((m, e) for m, e in done.stretches() if m.kind == "hold")
    motor = done.recording.motor
    still = motor.position_mm[(motor.time_s > end - 0.1) & (motor.time_s < end)]
    assert still.mean() == pytest.approx(first.target_mm, abs=2e-3), "in the motor frame"


def test_a_bonded_pad_pulls_and_is_not_mistaken(tmp_path):
    pad = tmp_path / "bonded.yaml"
    law = "{law: exponential, m: 2.24, b: 0.69}"
    pad.write_text(f"pad:\n  elastic: {law}\n  relaxation: {{shares: [0.4], rates: [4.0]}}\n  contact: bonded\n")
    steps = [{"to": 1.2, "speed": 40, "hold": 1.5}, {"to": 0.0, "speed": 40, "hold": 0.2}]
    done = run(tmp_path, merged(SHORT, {"steps": steps}), simulation={"pad": str(pad)})
    assert done.outcome.cause is None
    assert done.recording.load_cell.force_N.min() < -0.5


def test_home_outside_of_the_travel_is_left_before_anything_else(tmp_path):
    """The axis homes at the end of its stroke, 3 mm outside of what is allowed, and comes in."""
    done = run(tmp_path, SHORT, "simulated_iai", motor={"stroke": [2, 30]}, limits={"position": [5, 20]},
               simulation={"surface": 6.5})  # fmt: skip
    assert done.outcome.cause is None
    homed = done.events("homed")[0]
    assert homed.data["home_mm"] < 5 <= homed.data["position_mm"] + 0.011
    after = done.recording.motor.time_s > homed.time_s
    assert done.recording.motor.position_mm[after].min() >= 5 - 0.011


def test_a_motor_with_the_other_sign_is_the_same_bench(tmp_path):
    done = run(tmp_path, SHORT, motor={"direction": -1}, load_cell={"sign": -1}, simulation={"seed": 3})
    assert done.outcome.cause is None
    surface = done.outcome.findings.surface
    assert surface is not None and abs(surface.position_mm - done.world.surface_mm) < 3.5 * surface.std_mm
    assert done.recording.load_cell.force_N.max() > 2.0


@pytest.mark.parametrize("state", ["hold", "retract"])
def test_other_safe_states(tmp_path, state):
    done = run(tmp_path, SHORT, "simulated_iai", motor={"safe_state": state}, simulation={"surface": 0.8})
    assert done.outcome.cause is None
    assert done.world.plant.servo_on and not done.world.plant.moving
    assert done.outcome.findings.safe_state is not None and done.outcome.findings.safe_state["servo_on"] is True


def test_preconditioning_and_blocks_come_in_their_order(tmp_path):
    block = {"block": "turn", "repeat": 2, "steps": [{"to": 0.6, "speed": 20}, {"to": 0.2, "speed": 20, "hold": 0.1}]}
    before = {"to": 0.8, "speed": 40, "cycles": 2, "rest": 0.3}
    done = run(tmp_path, merged(SHORT, {"precondition": before, "steps": [block]}), simulation={"surface": 0.6})
    assert done.outcome.cause is None
    names = list(dict.fromkeys(mark.name for mark in done.recording.steps))
    turns = [f"steps[0].turn[{i}].steps[{k}]" for i in range(2) for k in range(2)]
    assert names == ["tare", "approach", "precondition[0]", "precondition[1]", "precondition", *turns, "finish"]
    measurement = done.recording.measurement()
    assert measurement.fit_from_s == next(m.time_s for m in done.recording.steps if m.phase == "steps")


@pytest.mark.parametrize("stall_s", [0.004, 0.03])
def test_a_host_that_is_late_strikes_no_blow(tmp_path, stall_s):
    """The profile goes on where it was when the host comes back, and not where it would be by now."""
    began: list[float] = []

    def in_mid_ramp(bench_s: float, label: str) -> bool:
        if label == "steps[0]":
            began.append(bench_s)
        return bool(began) and bench_s > began[0] + 0.02

    def stall(world, bench_s):
        world.clock.wait([], world.clock.now() + stall_s)

    steps = [{"to": 1.5, "speed": 60, "hold": 0.3}]
    done = run(tmp_path, merged(SHORT, {"steps": steps}), hook=once(in_mid_ramp, stall))
    assert done.outcome.cause is None, done.outcome.cause
    assert int(done.result["overruns"]) >= 1
    ramp, end = next((m, e) for m, e in done.stretches() if m.name == "steps[0]")
    motor = done.recording.motor
    inside = (motor.time_s >= ramp.time_s) & (motor.time_s < end)
    assert np.diff(motor.command_mm[inside]).max() < 2.1 * 60e-3
    assert np.diff(motor.time_s[inside]).max() > 0.9 * stall_s, "there was a stall"
    hold, end = next((m, e) for m, e in done.stretches() if m.kind == "hold")
    assert done.depth(end - 0.1, end).mean() == pytest.approx(1.5, abs=3e-3), "and it arrives all the same"


def test_the_folder_holds_the_recording_alone_until_something_is_made_of_it(tmp_path):
    done = run(tmp_path, merged(SHORT, {"steps": [{"to": 0.3, "speed": 20}]}), simulation={"surface": 0.6})
    assert [path.name for path in Path(done.folder).iterdir()] == ["recording.mcap"]
