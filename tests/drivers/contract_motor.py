"""What every motor driver must do, whatever carries its bytes: functions that take an open driver.

The device at the other end stands at a position it can move a few millimetres either way from, with nothing in its way.
"""

from __future__ import annotations

import contextlib
from itertools import pairwise

import pytest

from drivers.errors import DeviceTimeout
from drivers.motor import Motor, MotorLimits, MotorSample
from drivers.wire import Link, call, complete

LIMITS = MotorLimits(
    speed_mm_s=100.0, acceleration_mm_s2=2000.0, force_N=20.0, position_mm=(-10.0, 10.0), watchdog_s=1.0
)
PERIOD_S = 0.02
NEAR_mm = 0.05


def pace(link: Link, until_s: float) -> None:
    """Let time pass, serving the link."""
    while link.clock.now() < until_s:
        link.clock.wait([link.port], min(until_s, link.wake_at()))
        link.service()


def check_identify(motor: Motor) -> None:
    """It says what it is, and commands nothing in doing so."""
    before = call(motor.read(), motor.link)
    identity = complete(motor.connect(), motor.link)
    assert identity.model
    assert identity.details
    after = call(motor.read(), motor.link)
    assert after.position_mm == pytest.approx(before.position_mm, abs=NEAR_mm)


def check_clamps_read_back(motor: Motor) -> None:
    """What is clamped in the device, and what is not, is said: nothing is claimed silently."""
    held = complete(motor.prepare(LIMITS), motor.link)
    if motor.kind == "stream":
        assert held["max_force_N"] == pytest.approx(LIMITS.force_N)
        assert held["watchdog_s"] == pytest.approx(LIMITS.watchdog_s)
    else:
        assert held.keys() - {"not_clamped"} or held["not_clamped"]


def check_energise_does_not_move(motor: Motor) -> None:
    """The loop is closed where the axis is."""
    before = call(motor.read(), motor.link)
    complete(motor.energise(), motor.link)
    after = call(motor.read(), motor.link)
    assert after.position_mm == pytest.approx(before.position_mm, abs=NEAR_mm)
    assert after.fault == 0


def go(motor: Motor, target_mm: float, speed_mm_s: float, *, until_s: float) -> list[MotorSample]:
    """Bring the axis to a position by whatever the motor follows, for at most so long; the samples on the way."""
    link = motor.link
    start = call(motor.read(), link)
    begin_s = link.clock.now()
    samples = [start]
    if motor.kind == "move":
        complete(motor.move(target_mm, speed_mm_s, 1000.0), link)
    while link.clock.now() - begin_s < until_s:
        due_s = link.clock.now() + PERIOD_S
        if motor.kind == "stream":
            way_mm = speed_mm_s * (link.clock.now() - begin_s)
            distance_mm = target_mm - start.position_mm
            share = min(way_mm / abs(distance_mm), 1.0) if distance_mm else 1.0
            # A set-point whose answer came too late (a busy machine) is followed by the next, as in a run.
            with contextlib.suppress(DeviceTimeout):
                samples.append(call(motor.stream(start.position_mm + share * distance_mm), link))
        else:
            samples.append(call(motor.read(), link))
        pace(link, due_s)
    return samples


def check_move(motor: Motor, by_mm: float = 2.0) -> None:
    """It gets there, samples have rising times that lie within their exchange, and it says no fault."""
    start = call(motor.read(), motor.link).position_mm
    samples = go(motor, start + by_mm, 10.0, until_s=0.2 + abs(by_mm) / 10.0 + 0.3)
    assert samples[-1].position_mm == pytest.approx(start + by_mm, abs=NEAR_mm)
    assert all(first.time_s < second.time_s for first, second in pairwise(samples))
    assert all(first.received_s < second.time_s for first, second in pairwise(samples))
    assert all(sample.time_s < sample.received_s for sample in samples)
    assert not any(sample.fault for sample in samples)


def check_stop(motor: Motor, by_mm: float = 5.0) -> None:
    """Stopped half way, it stands, well before the target."""
    start = call(motor.read(), motor.link).position_mm
    go(motor, start + by_mm, 5.0, until_s=0.4)
    complete(motor.stop(), motor.link)
    stopped = hold_for(motor, 0.3)
    later = hold_for(motor, 0.1)
    assert abs(later.position_mm - stopped.position_mm) < NEAR_mm
    assert 0 < (later.position_mm - start) / by_mm < 0.8


def hold_for(motor: Motor, seconds: float) -> MotorSample:
    """Stand for so long, fed as the motor needs it; the last sample."""
    link = motor.link
    sample = call(motor.read(), link)
    target_mm = sample.position_mm
    end_s = link.clock.now() + seconds
    while link.clock.now() < end_s:
        due_s = link.clock.now() + PERIOD_S
        with contextlib.suppress(DeviceTimeout):
            sample = call(motor.stream(target_mm) if motor.kind == "stream" else motor.read(), link)
        pace(link, due_s)
    return sample


def check_safe_states(motor: Motor) -> None:
    """Both states are reached from motion and proven; the proof is of the device, not of what was asked."""
    start = call(motor.read(), motor.link).position_mm
    go(motor, start - 2.0, 5.0, until_s=0.2)
    hold = complete(motor.safe_state("hold"), motor.link)
    assert hold["state"] == "hold"
    assert hold.get("mode", "position") == "position"
    assert hold.get("servo_on", True) is True
    release = complete(motor.safe_state("release"), motor.link)
    assert release["state"] == "release"
    assert release.get("mode", "sleep") == "sleep"
    assert release.get("servo_on", False) is False
    again = complete(motor.safe_state("release"), motor.link)
    assert again["state"] == "release"


def check_traffic(motor: Motor) -> None:
    """The counters move with the bytes, and nothing was bad, late or refused on a good line."""
    traffic = motor.link.traffic
    before = (traffic.exchanges, traffic.bytes_out, traffic.bytes_in)
    for _ in range(5):
        call(motor.read(), motor.link)
    assert traffic.exchanges >= before[0] + 5
    assert traffic.bytes_out >= before[1] + 5 * 8
    assert traffic.bytes_in > traffic.bytes_out - before[1]
    assert (traffic.bad_frames, traffic.refusals) == (0, 0)
    assert traffic.stray_bytes == 0 or traffic.timeouts > 0


def check_all(motor: Motor) -> None:
    """The whole contract, in the order of a run."""
    check_identify(motor)
    check_clamps_read_back(motor)
    if motor.kind == "move":
        complete(motor.energise(), motor.link)
        if not complete(motor.is_homed(), motor.link):
            complete(motor.home(), motor.link)
        assert complete(motor.is_homed(), motor.link) is True
    check_energise_does_not_move(motor)
    check_move(motor)
    check_stop(motor)
    check_safe_states(motor)
    check_traffic(motor)
