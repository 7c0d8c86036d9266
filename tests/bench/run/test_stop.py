"""What stops a run: named, recorded once, data kept, motor safe. In virtual time: stops can be told to the ms."""

from __future__ import annotations

import os
import re
import signal
import threading
from typing import Any

import numpy as np
import pytest
import yaml

from bench.errors import InputError
from bench.run import script
from sim.devices import orca_registers
from tests.bench.run.benches import SHORT, Done, falls_silent, is_unplugged, merged, once, run

DEEP = merged(SHORT, {"limits": {"depth": 3}, "steps": [{"to": 2.0, "speed": 60, "hold": 1.0}]})
NOISE_N = 0.01
BOTH = pytest.mark.parametrize("base", ["simulated", "simulated_iai"])


def in_ramp(bench_s: float, label: str) -> bool:
    return label == "steps[0]"


def in_hold() -> Any:
    """Half a second after the first ramp began."""
    began: list[float] = []

    def when(bench_s: float, label: str) -> bool:
        if label == "steps[0]":
            began.append(bench_s)
        return bool(began) and bench_s > began[0] + 0.5

    return when


def stopped_well(done: Done, cause: str) -> None:
    """One cause, in all the places where people look for it, and the motor as the bench file wants it."""
    assert done.outcome.cause is not None and re.search(cause, done.outcome.cause), done.outcome.cause
    assert done.result["status"] == "stopped" and done.result["cause"] == done.outcome.cause
    events = done.events("stopped")
    assert len(events) == 1 and events[0].data == {"cause": done.outcome.cause}
    assert not done.events("stop_incomplete") and not done.outcome.findings.not_safe
    assert done.events("safe_state")[0].time_s >= events[0].time_s
    assert done.is_safe()
    assert done.recording.lost is None


@BOTH
def test_too_much_force_in_mid_motion(tmp_path, base):
    gently = {"approach": {"speed": 1}, "limits": {"force": 2}, "steps": [{"to": 2.0, "speed": 20, "hold": 1.0}]}
    done = run(tmp_path, merged(DEEP, gently), base, simulation={"surface": 0.6})
    stopped_well(done, r"^force limit: 2\.\d+ N measured, 2 N allowed$")
    limits, law = done.bench.limits, done.truth.pad.law
    stop = done.events("stopped")[0].time_s
    motor = done.recording.motor
    # How fast it was on the way there, how late the loop saw it, and the way to stand still after that.
    speed = np.abs(np.diff(motor.command_mm) / np.diff(motor.time_s))[motor.time_s[1:] <= stop].max()
    lag_s = 0.002 if base == "simulated" else 0.02
    way_mm = speed * (done.plan.force_latency_s + lag_s) + speed**2 / (2 * limits.acceleration)
    deepest = float(done.world.plant.history(stop - 0.2)[1].max())
    beyond = float(law.stiffness(deepest - done.world.surface_mm)) * way_mm + 5 * NOISE_N
    assert done.recording.load_cell.force_N.max() < 2 + beyond
    assert done.recording.load_cell.force_N.max() > 2
    assert deepest - done.surface_mm < 1.7, "it never came to the 2 mm of the protocol"


def test_too_much_pull(tmp_path):
    pad = tmp_path / "bonded.yaml"
    law = "{law: exponential, m: 2.24, b: 0.69}"
    pad.write_text(f"pad:\n  elastic: {law}\n  relaxation: {{shares: [0.4], rates: [4.0]}}\n  contact: bonded\n")
    steps = [{"to": 2.0, "speed": 60, "hold": 2}, {"to": -0.3, "speed": 60, "hold": 2}]
    done = run(tmp_path, merged(DEEP, {"steps": steps}), simulation={"pad": str(pad)}, limits={"tension": 0.2})
    stopped_well(done, r"^tension limit: 0\.\d+ N measured, 0\.2 N allowed$")
    assert done.events("stopped")[0].time_s > done.recording.steps[-1].time_s


@BOTH
def test_an_axis_that_does_not_follow(tmp_path, base):
    done = run(tmp_path, DEEP, base, limits={"following_error": 0.02})
    stopped_well(done, r"^following error: commanded -?\d\.\d+ mm, at -?\d\.\d+ mm, allowed 0\.02 mm apart$")


@BOTH
def test_a_surface_that_leaves_too_little_travel(tmp_path, base):
    done = run(tmp_path, DEEP, base, limits={"position": [-5, 2.5]})
    stopped_well(done, r"surface is at 1\.5\d+ mm: the deepest step \(2 mm\) would go beyond limits\.position")
    assert done.recording.load_cell.force_N.max() < 0.3, "said before it was pressed"


def test_a_force_that_does_not_come_within_the_travel(tmp_path):
    steps = [{"to_force": 11, "speed": 5, "hold": 1}]
    done = run(tmp_path, merged(DEEP, {"steps": steps}), limits={"position": [-5, 2.5]})
    stopped_well(done, r"^steps\[0\]: 11 N was not reached: [\d.]+ N at the end of the allowed travel \(2\.50 mm")
    assert done.recording.motor.position_mm.max() < 2.5 + 2e-3


@BOTH
@pytest.mark.parametrize("surface", [-1.0, -0.3])
def test_contact_where_there_should_be_air(tmp_path, base, surface):
    done = run(tmp_path, DEEP, base, simulation={"surface": surface})
    stopped_well(done, "the probe already touches something: .* retract the probe")
    assert not done.events("tare") and done.recording.surface_mm is None
    motor = done.recording.motor
    assert motor.position_mm.size == 0 or motor.position_mm.max() < 0.02, "nothing was pressed"


@BOTH
def test_no_pad_where_one_should_be(tmp_path, base):
    done = run(tmp_path, DEEP, base, simulation={"surface": 5}, limits={"position": [-2, 2]})
    stopped_well(done, r"^no contact: the probe went from -0\.30 to 2\.00 mm and felt less than 0\.05\d? N")
    assert done.recording.motor.position_mm.max() < 2.005


@BOTH
def test_a_load_cell_that_falls_silent(tmp_path, base):
    done = run(tmp_path, DEEP, base, hook=once(in_hold(), falls_silent("load_cell")))
    stale = done.bench.limits.stale
    stopped_well(done, r"^the load cell is silent: no sample for \d+ ms")
    last = done.recording.load_cell.received_s[-1]
    assert stale < done.events("stopped")[0].time_s - last < stale + 0.03
    assert "no answer" in done.events("load_cell_not_stopped")[0].data["message"]


@BOTH
def test_a_motor_that_falls_silent(tmp_path, base):
    """What cannot be made safe is said: the first cause stays the cause, and the failure stands beside it."""
    done = run(tmp_path, DEEP, base, hook=once(in_hold(), falls_silent("motor")))
    stale = done.bench.limits.stale
    assert done.outcome.cause is not None and done.outcome.cause.startswith("the motor is silent: no answer for")
    last = done.recording.motor.received_s[-1]
    assert stale < done.events("stopped")[0].time_s - last < stale + 0.03
    assert "no answer" in done.outcome.findings.not_safe
    assert done.events("safe_state_failed")[0].data["message"] == done.outcome.findings.not_safe
    assert done.result["not_safe"] == done.outcome.findings.not_safe and "safe_state" not in done.result
    if base == "simulated":
        assert not done.world.plant.servo_on, "its own watchdog has let go"
    line = done.world.endpoints["load_cell"].line
    before = line.bytes_to_host
    done.world.clock.wait([], done.world.clock.now() + 0.5)
    assert line.bytes_to_host == before, "the load cell was stopped all the same"


@BOTH
@pytest.mark.parametrize("key", ["motor", "load_cell"])
def test_an_adapter_that_is_pulled_out(tmp_path, base, key):
    done = run(tmp_path, DEEP, base, hook=once(in_ramp, is_unplugged(key)))
    assert done.outcome.cause is not None
    assert re.match(rf"{key}: (the port was lost|cannot write to the port) ", done.outcome.cause)
    if key == "load_cell":
        assert done.is_safe() and not done.outcome.findings.not_safe
    else:
        assert "port" in done.outcome.findings.not_safe


def test_an_overloaded_cell(tmp_path):
    done = run(tmp_path, DEEP, load_cell={"capacity": 3}, limits={"force": 3, "tension": 3})
    stopped_well(done, r"^the load cell reports overload at 3\.\d+ N$")
    flagged = done.recording.load_cell.flagged
    assert flagged.any() and not flagged[: flagged.argmax()].any()


def test_a_fault_that_the_motor_reports(tmp_path):
    def overheats(world: Any, bench_s: float) -> None:
        world.devices["motor"].errors |= 1 << 6  # docs/devices.md 1: bit 6 of the error word

    done = run(tmp_path, DEEP, hook=once(in_ramp, overheats))
    assert done.outcome.cause is not None and done.outcome.cause.startswith("the motor reports a fault: ")
    assert not done.world.plant.servo_on


def test_a_move_that_the_motor_does_not_take(tmp_path):
    """The motor stands, and the plan must not go on without it."""
    done = run(tmp_path, DEEP, "simulated_iai", hook=once(in_ramp, falls_silent("motor")))
    assert done.outcome.cause is not None and re.match("motor: no answer to 'write 9", done.outcome.cause)
    assert done.events("motor_refused")[0].data["message"] == done.outcome.cause
    assert done.events("stopped")[0].time_s - done.recording.steps[-1].time_s < 0.2


def test_an_alarm_of_a_controller(tmp_path):
    def alarm(world: Any, bench_s: float) -> None:
        world.devices["motor"].alarm = 0xC0

    done = run(tmp_path, DEEP, "simulated_iai", hook=once(lambda s, label: label == "tare", alarm))
    assert done.outcome.cause is not None and re.match("the motor reports a fault: .*0x00c0", done.outcome.cause)
    assert not done.events("tare") and not done.world.plant.moving


@BOTH
@pytest.mark.parametrize(
    ("number", "words"),
    [
        (signal.SIGINT, r"^stopped by the operator \(Ctrl-C\)$"),
        (signal.SIGTERM, "^stopped by signal SIGTERM$"),
        pytest.param(signal.SIGHUP, "^stopped by signal SIGHUP$", marks=pytest.mark.long),
    ],
)
def test_the_operator_stops_it(tmp_path, base, number, words):
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals come to the main thread")
    at: list[float] = []

    def strike(world: Any, bench_s: float) -> None:
        at.append(bench_s)
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # whoever is frightened strikes twice

    before = signal.getsignal(number)
    done = run(tmp_path, DEEP, base, hook=once(in_ramp, strike))
    stopped_well(done, words)
    assert done.outcome.strikes == 2
    assert 0 <= done.events("stopped")[0].time_s - at[0] < 0.05
    assert signal.getsignal(number) is before
    stands = done.events("safe_state")[0].time_s
    assert stands - at[0] < 0.3


def test_a_stop_while_it_homes(tmp_path):
    """The axis is on its way to its end, fed by nobody: it has to be stopped all the same."""
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals come to the main thread")
    moved: list[float] = []

    def strike(world: Any, bench_s: float) -> None:
        moved.append(world.plant.speed_mm_s)
        os.kill(os.getpid(), signal.SIGINT)

    began: list[float] = []

    def homing(bench_s: float, label: str) -> bool:
        if label == "homing":
            began.append(bench_s)
        return bool(began) and bench_s > began[0] + 0.4

    done = run(tmp_path, DEEP, "simulated_iai", hook=once(homing, strike), motor={"stroke": [-60, 60]})
    stopped_well(done, "Ctrl-C")
    assert not done.events("homed") and abs(moved[0]) > 1.0
    assert abs(done.world.plant.speed_mm_s) < 0.1


def test_a_stop_before_anything_is_known_commands_nothing(tmp_path):
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals come to the main thread")
    done = run(tmp_path, DEEP, hook=once(lambda *_: True, lambda *_: os.kill(os.getpid(), signal.SIGINT)))
    assert done.outcome.cause == "stopped by the operator (Ctrl-C)"
    motor = done.world.devices["motor"]
    assert not done.world.plant.servo_on and motor.registers[orca_registers.USER_MAX_FORCE] != 42_500  # type: ignore[attr-defined]


@BOTH
@pytest.mark.parametrize("key", ["motor", "load_cell"])
def test_a_device_that_does_not_answer_is_a_fault_of_the_bench_file(tmp_path, base, key):
    with pytest.raises(InputError) as caught:
        run(tmp_path, DEEP, base, hook=once(lambda *_: True, falls_silent(key)))
    lines = (tmp_path / "bench.yaml").read_text().splitlines()
    line = next(i for i, text in enumerate(lines) if text == f"{key}:") + 2
    assert caught.value.place == f"{tmp_path / 'bench.yaml'}:{line}:3"
    assert re.match(rf"{key}: no answer to '.*' within \d+ ms", caught.value.message)
    assert "baudrate" in caught.value.message


def test_a_wrong_baudrate_is_a_fault_of_the_bench_file(tmp_path):
    def other(world: Any, bench_s: float) -> None:
        world.endpoints["load_cell"].line.set_device(9600, "N")

    with pytest.raises(InputError, match="load_cell: .*baudrate"):
        run(tmp_path, DEEP, hook=once(lambda *_: True, other))


@BOTH
def test_a_defect_of_ours_stops_the_motor_too(tmp_path, base, monkeypatch):
    def broken(self: Any, segment: Any) -> Any:
        yield
        raise ZeroDivisionError("made for the test")

    monkeypatch.setattr(script.Run, "segment", broken)
    with pytest.raises(ZeroDivisionError):
        run(tmp_path, DEEP, base)
    import sim.world
    from bench.recording import read_recording

    recording = read_recording(tmp_path / "run")
    assert recording.result is not None and "a defect of padbench: ZeroDivisionError" in recording.result["cause"]
    assert recording.motor.time_s.size > 100
    plant = sim.world._worlds["bench"].plant
    assert plant.servo_on == (base == "simulated_iai") and not (plant.servo_on and plant.moving)


def test_a_retract_after_a_stop_leaves_the_pad(tmp_path):
    done = run(tmp_path, merged(DEEP, {"limits": {"force": 2}}), motor={"safe_state": "retract"})
    assert done.outcome.cause is not None and done.outcome.cause.startswith("force limit")
    assert done.recording.motor.position_mm[-1] - done.surface_mm == pytest.approx(-0.3, abs=0.02)
    assert done.recording.load_cell.force_N[-20:].mean() < 0.02


def test_a_recording_that_cannot_go_on(tmp_path):
    """A full disk is said as the cause, and the motor stands."""
    from bench.recording.store import InlineStore

    real = InlineStore.message

    def full(self: Any, *given: Any) -> None:
        if given[0] == 1 and given[4] > 1500:
            self.problem = "no space left on device"
            return
        real(self, *given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(InlineStore, "message", full)
        done = run(tmp_path, DEEP)
    assert done.outcome.cause == "the recording cannot go on: no space left on device"
    assert done.is_safe()


def test_what_was_measured_before_the_stop_is_a_measurement(tmp_path):
    """The data of a stopped run can be fitted, up to the stop."""
    when = in_hold()
    done = run(tmp_path, DEEP, hook=once(when, falls_silent("load_cell")))
    measured = done.recording.measurement()
    stop = done.events("stopped")[0].time_s
    assert measured.fit_to_s == stop
    assert measured.force_time_s.size > 200
    assert yaml.safe_load(done.recording.attachments["protocol.yaml"])["name"] == "short"
