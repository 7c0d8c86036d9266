"""How a run stops: softly, hard, without a force to go by, in a bonded pad; and what is refused before it begins."""

from __future__ import annotations

import os
import select
import signal
import threading
import time
from typing import Any

import numpy as np
import pytest
import yaml

from bench.cli import main
from bench.config import load_bench, load_model
from bench.preflight import check
from bench.protocol import load_protocol
from bench.recording import read_recording
from bench.run import script
from bench.run.axis import SEGMENT_S
from bench.run.loop import LONGEST_WAIT_S
from bench.run.runner import _foresight, run_protocol
from bench.run.signals import Operator, listening
from bench.trajectory import Profile
from drivers.clock import WallClock
from drivers.errors import ReadbackError
from sim.devices import orca_registers
from tests.bench.run.benches import SHORT, bench_file, falls_silent, merged, once, protocol_file, run
from tests.bench.run.test_stop import BOTH, DEEP, in_hold, in_ramp, stopped_well

MAIN = pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread(), reason="signals come to the main thread"
)


def strike(times: int = 1) -> Any:
    def action(world: Any, bench_s: float) -> None:
        for _ in range(times):
            os.kill(os.getpid(), signal.SIGTERM)

    return action


def in_stopping(bench_s: float, label: str) -> bool:
    return label == "stopping"


def both_hooks(*hooks: Any) -> Any:
    def hook(bench_s: float, label: str) -> None:
        for one in hooks:
            one(bench_s, label)

    return hook


# -- soft ------------------------------------------------------------------------------------------------------------


@MAIN
@BOTH
def test_a_soft_stop_leaves_the_pad_on_a_falling_force(tmp_path, base):
    done = run(tmp_path, DEEP, base, hook=once(in_hold(), strike()))
    stopped_well(done, "^stopped by signal SIGTERM$")
    assert done.events("stop")[0].data == {"manner": "soft", "why": ""}
    (back,) = done.events("retreat")
    assert back.data["ended"] == "out of the pad"
    assert back.data["to_mm"] == pytest.approx(done.surface_mm - 0.3, abs=0.02)
    began = done.events("stopped")[0].time_s
    force = done.force(began + 0.1, back.time_s)
    smooth = np.convolve(force, np.ones(20) / 20, "valid")
    assert np.all(np.diff(smooth[::20]) < 0.02), "it falls all the way"
    assert abs(force[-10:].mean()) < 0.05


@MAIN
def test_in_air_there_is_nothing_to_leave(tmp_path):
    done = run(tmp_path, "air", hook=once(lambda s, label: s > 3, strike()))
    assert done.outcome.cause == "stopped by signal SIGTERM" and done.is_safe()
    assert not done.events("retreat")


@BOTH
def test_without_a_cell_no_further_than_the_surface(tmp_path, base):
    done = run(tmp_path, DEEP, base, hook=once(in_hold(), falls_silent("load_cell")))
    stopped_well(done, "^the load cell is silent")
    (back,) = done.events("retreat")
    assert back.data["ended"] == "at the surface, without a force to go by"
    assert back.data["to_mm"] == pytest.approx(done.surface_mm, abs=0.005)


def test_a_cell_that_is_lost_on_the_way_out(tmp_path):
    hook = both_hooks(
        once(in_hold(), lambda world, s: os.kill(os.getpid(), signal.SIGTERM)),
        once(in_stopping, falls_silent("load_cell")),
    )
    done = run(tmp_path, DEEP, hook=hook)
    stopped_well(done, "^stopped by signal SIGTERM$")
    (back,) = done.events("retreat")
    assert back.data["ended"] == "the load cell was lost"
    assert back.data["to_mm"] == pytest.approx(done.surface_mm, abs=0.005)


def test_a_cell_lost_before_there_is_a_surface(tmp_path):
    """Back to where the tare was taken, through what was air on the way there."""
    done = run(
        tmp_path,
        merged(DEEP, {"approach": {"speed": 1}}),
        hook=once(lambda s, label: s > 2.6, falls_silent("load_cell")),
    )
    stopped_well(done, "^the load cell is silent")
    assert done.recording.surface_mm is None
    (back,) = done.events("retreat")
    assert back.data["to_mm"] == pytest.approx(-0.3, abs=0.005) and back.data["from_mm"] > 0.0


@MAIN
def test_a_bonded_pad_is_left_where_it_begins_to_pull(tmp_path):
    """It has relaxed for two seconds, so that it pulls long before the surface."""
    pad = tmp_path / "bonded.yaml"
    law = "{law: exponential, m: 2.24, b: 0.69}"
    pad.write_text(f"pad:\n  elastic: {law}\n  relaxation: {{shares: [0.4], rates: [4.0]}}\n  contact: bonded\n")
    steps = [{"to": 2.0, "speed": 60, "hold": 5}]
    when = once(lambda s, label: s > 6.0, strike())
    done = run(tmp_path, merged(DEEP, {"steps": steps}), simulation={"pad": str(pad)}, hook=when)
    stopped_well(done, "^stopped by signal SIGTERM$")
    (back,) = done.events("retreat")
    assert back.data["ended"] == "the pad pulls"
    assert done.surface_mm < back.data["to_mm"] < back.data["from_mm"]
    assert -0.3 < done.force(done.events("stopped")[0].time_s, back.time_s).min() < -0.05


# -- hard ------------------------------------------------------------------------------------------------------------


@MAIN
@BOTH
def test_a_second_signal_is_harder(tmp_path, base):
    hook = both_hooks(once(in_hold(), strike()), once(in_stopping, strike()))
    done = run(tmp_path, DEEP, base, hook=hook)
    stopped_well(done, "^stopped by signal SIGTERM$")
    assert done.events("stop")[0].data["manner"] == "hard"
    assert done.events("stop")[0].time_s - done.events("stopped")[0].time_s < 0.1
    assert not done.events("retreat")


@MAIN
def test_a_signal_makes_the_stop_at_a_limit_harder(tmp_path):
    hook = once(in_stopping, strike())
    done = run(tmp_path, merged(DEEP, {"limits": {"force": 2}}), hook=hook)
    stopped_well(done, "^force limit: ")
    assert done.events("stop")[0].data["manner"] == "hard"


@MAIN
@BOTH
def test_any_number_of_signals_leaves_a_whole_recording(tmp_path, base):
    """One in every turn of the loop from the stop on, the end of the recording included."""
    before = signal.getsignal(signal.SIGTERM)

    def hook(bench_s: float, label: str) -> None:
        if label in ("stopping", "safe state") or (label == "steps[0]" and bench_s > 4.0):
            os.kill(os.getpid(), signal.SIGTERM)

    done = run(tmp_path, DEEP, base, hook=hook)
    stopped_well(done, "^stopped by signal SIGTERM$")
    assert signal.getsignal(signal.SIGTERM) is before


@MAIN
def test_a_signal_while_the_recording_is_finished(tmp_path, monkeypatch):
    from bench.recording.writer import Recorder

    finish = Recorder.finish

    def struck(self: Any, *given: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        result = finish(self, *given)
        os.kill(os.getpid(), signal.SIGINT)
        return result

    monkeypatch.setattr(Recorder, "finish", struck)
    done = run(tmp_path, SHORT)
    assert done.recording.lost is None and done.recording.result is not None


@BOTH
def test_an_axis_that_does_not_follow_is_not_sent_anywhere(tmp_path, base):
    done = run(tmp_path, DEEP, base, limits={"following_error": 0.02})
    stopped_well(done, "^following error")
    assert done.events("stop")[0].data == {
        "manner": "hard",
        "why": "the motor is not to be trusted with a motion",
    }
    assert not done.events("retreat")


def test_an_axis_that_gets_stuck_on_its_way_out(tmp_path):
    """The first cause was another one; the way out ends all the same."""

    def jam(world: Any, bench_s: float) -> None:
        world.plant.brake(True)

    out: list[float] = []

    def on_its_way(bench_s: float, label: str) -> bool:
        if label == "stopping":
            out.append(bench_s)
        return bool(out) and bench_s > out[0] + 0.15

    hook = both_hooks(once(in_hold(), strike()), once(on_its_way, jam))
    done = run(tmp_path, DEEP, hook=hook)
    assert done.outcome.cause == "stopped by signal SIGTERM"
    assert done.events("stop")[0].data["manner"] == "hard" and not done.events("retreat")
    assert done.events("stop")[0].time_s - out[0] < 0.4


def test_an_axis_that_is_stuck_is_not_pushed_on(tmp_path):
    """`hold` holds where it stands, not where it should have gone: the servo rests."""

    def jam(world: Any, bench_s: float) -> None:
        world.plant.brake(True)

    slow = merged(DEEP, {"steps": [{"to": 2.0, "speed": 4, "hold": 1.0}]})
    done = run(tmp_path, slow, hook=once(in_ramp, jam), motor={"safe_state": "hold"})
    assert done.outcome.cause is not None
    assert done.outcome.cause.startswith(("following error", "the motor reports a fault: force limit exceeded"))
    assert done.events("stop")[0].data["manner"] == "hard" and not done.events("retreat")
    world = done.world
    world.clock.wait([], world.clock.now() + 0.02)
    world.plant.advance(world.clock.now())
    assert world.plant.servo_on and abs(world.plant.motor_force_N) < 5.0, "it does not push on against what blocks it"


# -- a signal is noticed at once -------------------------------------------------------------------------------------


@MAIN
def test_a_signal_ends_the_wait_of_the_loop():
    """Without the pipe a select goes on after the handler until its time is up (PEP 475)."""
    operator = Operator()
    with listening(operator):
        assert operator.waker is not None
        timer = threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGTERM))
        timer.start()
        ready = WallClock().wait([operator.waker], 30.0)
        timer.join()
        assert list(ready) == [operator.waker] and operator.waker.read(8) == bytes([signal.SIGTERM])
        assert operator.wish == "stopped by signal SIGTERM" and operator.strikes == 1
        assert not select.select([operator.waker], [], [], 0)[0], "read empty, it lets the loop wait again"
    assert operator.waker is None


@MAIN
@BOTH
def test_the_stop_goes_out_within_one_turn(tmp_path, base):
    at: list[float] = []

    def now(world: Any, bench_s: float) -> None:
        at.append(world.clock.now())
        os.kill(os.getpid(), signal.SIGTERM)

    done = run(tmp_path, DEEP, base, hook=once(in_hold(), now))
    assert 0.0 <= done.events("stopped")[0].time_s - at[0] <= LONGEST_WAIT_S


# -- the first cause -------------------------------------------------------------------------------------------------


@BOTH
def test_a_second_failure_does_not_hide_the_first(tmp_path, base):
    """The motor falls silent while the axis is still braking after a force limit."""
    hook = once(in_stopping, falls_silent("motor"))
    gently = {"approach": {"speed": 1}, "limits": {"force": 2}}
    done = run(tmp_path, merged(DEEP, gently), base, hook=hook)
    assert done.outcome.cause is not None and done.outcome.cause.startswith("force limit")
    assert done.result["cause"] == done.outcome.cause
    assert [event.data["cause"] for event in done.events("stopped")] == [done.outcome.cause]
    assert "no answer" in done.outcome.findings.not_safe


# -- clamps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("register", "words"),
    [(orca_registers.USER_MAX_FORCE, "force limit: wrote"), (orca_registers.USER_COMMS_TIMEOUT, "watchdog: wrote")],
)
def test_a_clamp_that_does_not_read_back_refuses_to_start(tmp_path, register, words):
    """A motor that keeps its own value is never energised."""

    def stubborn(world: Any, bench_s: float) -> None:
        motor = world.devices["motor"]
        read = motor.read_registers

        def other(address: int, count: int, at_s: float) -> list[int]:
            values = list(read(address, count, at_s))
            if address <= register < address + count:
                values[register - address] ^= 1
            return values

        motor.read_registers = other

    energised: list[bool] = []

    def hook(bench_s: float, label: str) -> None:
        import sim.world

        energised.append(sim.world._worlds["bench"].plant.servo_on)
        first(bench_s, label)

    first = once(lambda *_: True, stubborn)
    done = run(tmp_path, DEEP, hook=hook)
    assert done.outcome.cause is not None and words in done.outcome.cause
    assert not any(energised)


def test_the_motor_is_clamped_before_it_is_energised(tmp_path):
    order: list[str] = []

    def hook(bench_s: float, label: str) -> None:
        import sim.world

        world = sim.world._worlds["bench"]
        motor: Any = world.devices["motor"]
        if motor.registers[orca_registers.USER_COMMS_TIMEOUT] == 100 and "clamped" not in order:
            order.append("clamped")
        if world.plant.servo_on and "energised" not in order:
            order.append("energised")

    run(tmp_path, SHORT, hook=hook)
    assert order == ["clamped", "energised"]


# -- a motor without a watchdog --------------------------------------------------------------------------------------


def test_a_motor_without_a_watchdog_is_told_short_segments(tmp_path):
    """At no time does it know of more than a fifth of a second of its way, and the way to stand still after it."""
    ahead: list[float] = []

    def look(bench_s: float, label: str) -> None:
        import sim.world

        world = sim.world._worlds["bench"]
        mover: Any = world.devices["motor"].mover  # type: ignore[attr-defined]
        if label == "approach" and mover.target_mm is not None:
            ahead.append(abs(mover.target_mm - world.plant.position_mm))

    done = run(tmp_path, DEEP, "simulated_iai", hook=look, simulation={"surface": 4.0}, limits={"position": [-5, 7]})
    assert done.outcome.cause is None
    speed, acceleration = 4.0, done.bench.limits.acceleration
    assert max(ahead) < SEGMENT_S * speed + speed**2 / (2 * acceleration) + 0.1 * speed + 0.11
    assert len(ahead) > 100 and max(ahead) > 0.3


def test_segments_make_the_motion_of_the_whole_move(tmp_path):
    """It never brakes in between: the plant's speed on a slow long ramp is the ramp's."""
    slow = merged(DEEP, {"steps": [{"to": 2.0, "speed": 1, "hold": 0.5}]})
    speeds: list[float] = []

    def look(bench_s: float, label: str) -> None:
        import sim.world

        if label == "steps[0]":
            speeds.append(sim.world._worlds["bench"].plant.speed_mm_s)

    done = run(tmp_path, slow, "simulated_iai", hook=look)
    assert done.outcome.cause is None
    fast = np.array(speeds)
    ramp = fast[np.flatnonzero(fast > 0.9)[0] : np.flatnonzero(fast > 0.9)[-1]]
    assert len(ramp) > 100 and ramp.min() > 0.8


# -- ahead of the motion ---------------------------------------------------------------------------------------------


def started(folder: Any, protocol: Any, believed: str, **changes: Any) -> tuple[Any, Any]:
    """A run whose preflight did not know the pad, as one that a step by force has brought elsewhere than planned."""
    bench = load_bench(bench_file(folder, **changes))
    loaded = load_protocol(protocol_file(folder, protocol))
    plan = check(loaded, bench, None).plan
    out = folder / "run"
    out.mkdir()
    return run_protocol(loaded, bench, plan, out, believed_text=believed), read_recording(out)


def believed_pad(m: float | str, contact: str = "unilateral") -> str:
    return (
        f"pad:\n  elastic: {{law: exponential, m: {m}, b: 0.69}}\n"
        f"  relaxation: {{shares: [0.25], rates: [4.0]}}\n  contact: {contact}\n"
    )


@pytest.mark.parametrize("m", ["010", "10e0"])
def test_the_believed_pad_is_read_as_every_command_reads_it(tmp_path, m):
    """YAML 1.1 has the first as eight, and the second as a word."""
    plan = check(load_protocol(protocol_file(tmp_path, SHORT)), load_bench(bench_file(tmp_path)), None).plan
    foreseen, wanted = (_foresight(believed_pad(value), plan) for value in (m, "10"))
    assert foreseen is not None and wanted is not None
    curve = Profile(0.0, 1.0, 10.0, 100.0, None)
    for foresight in (foreseen, wanted):
        foresight.start(0.0)
    assert foreseen.extremes(curve) == wanted.extremes(curve)


def test_a_ramp_that_is_expected_to_cross_the_limit_is_not_begun(tmp_path):
    steps = [{"to": 0.5, "speed": 20, "hold": 0.2}, {"to": 2.0, "speed": 20, "hold": 0.2}]
    outcome, recording = started(tmp_path, merged(DEEP, {"steps": steps, "limits": {"force": 5}}), believed_pad(2.24))
    assert outcome.cause is not None
    assert outcome.cause.startswith("steps[1]: not begun: the believed pad would answer with ")
    # (9) at 2 mm, less what a tenth of a second relaxes of a quarter, is more than the 5 N allowed.
    assert recording.motor.position_mm.max() - recording.surface_mm < 0.52, "the first step was made, the second not"
    assert recording.load_cell.force_N.max() < 2.0


def test_a_pull_that_is_expected_is_not_begun(tmp_path):
    steps = [{"to": 2.0, "speed": 20, "hold": 2}, {"to": -0.3, "speed": 20, "hold": 0.2}]
    given = merged(DEEP, {"steps": steps})
    outcome, recording = started(tmp_path, given, believed_pad(2.24, "bonded"), limits={"tension": 0.3})
    assert outcome.cause is not None and "the believed pad would pull with" in outcome.cause
    assert recording.load_cell.force_N.min() > -0.3


def test_a_ramp_that_comes_back_from_beyond_a_limit_is_allowed(tmp_path):
    steps = [{"to": 0.5, "speed": 20, "hold": 0.2}, {"to": 0.0, "speed": 20, "hold": 0.2}]
    outcome, _ = started(tmp_path, merged(DEEP, {"steps": steps, "limits": {"force": 5}}), believed_pad(2.24))
    assert outcome.cause is None


# -- bench files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing", ["limits", "force", "position", "speed", "acceleration"])
def test_a_bench_without_limits_does_not_run(tmp_path, capsys, missing):
    content = yaml.safe_load(bench_file(tmp_path).read_text("utf-8"))
    content["motor"]["port"], content["load_cell"]["port"] = "/dev/ttyUSB7", "/dev/ttyUSB8"
    if missing == "limits":
        del content["limits"]
    else:
        del content["limits"][missing]
    real = tmp_path / "real.yaml"
    real.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")
    assert main(["run", "quick", "--bench", str(real), "--attended", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert missing in said and "real.yaml" in said
    assert not (tmp_path / "out").exists()


def test_a_vertical_axis_that_would_drop_is_said_before(tmp_path):
    file = bench_file(tmp_path, motor={"orientation": "vertical", "safe_state": "release"})
    found = check(load_protocol("quick"), load_bench(file), load_model("polyurethane"))
    assert any("falls on the sample" in problem.message for problem in found.notices)


def test_a_driver_error_is_what_was_read_back(tmp_path, monkeypatch):
    """`ReadbackError` of a map's clamp, as of an Orca's: nothing is energised."""

    def refuse(self: Any, limits: Any) -> Any:
        raise ReadbackError("motor", "speed: wrote [1], the device holds [2]")
        yield

    from drivers.registers import RegisterMotor

    monkeypatch.setattr(RegisterMotor, "prepare", refuse)
    done = run(tmp_path, DEEP, "simulated_iai")
    assert done.outcome.cause == "motor: speed: wrote [1], the device holds [2]"
    assert not done.world.plant.servo_on or not done.world.plant.moving


def test_the_way_out_is_part_of_a_defect_too(tmp_path, monkeypatch):
    def broken(self: Any, segment: Any) -> Any:
        yield from self.loop.sleep(0.01)
        if segment.kind == "hold":
            raise ZeroDivisionError("made for the test")
        yield from self.mover.go(self._motor_frame(segment.target_mm), segment.speed_mm_s)

    monkeypatch.setattr(script.Run, "segment", broken)
    with pytest.raises(ZeroDivisionError):
        run(tmp_path, DEEP)
    recording = read_recording(tmp_path / "run")
    (back,) = [event for event in recording.events if event.name == "retreat"]
    assert back.data["ended"] == "out of the pad"


def test_waiting_costs_no_processor(tmp_path):
    """The pipe of the signals is no port that is always ready."""
    operator = Operator()
    with listening(operator):
        clock = WallClock()
        ports = [operator.waker] if operator.waker is not None else []
        started_s, before = clock.now(), time.process_time()
        assert not clock.wait(ports, started_s + 0.3)
        assert clock.now() - started_s >= 0.3
        assert time.process_time() >= before
