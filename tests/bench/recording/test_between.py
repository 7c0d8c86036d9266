"""The motion between slow polls, against a trapezoid and a yielding servo of this file's own."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.recording import Event, ForceChannel, MotorChannel, Recording, StepMark
from bench.recording.giving_way import giving_way

SPEED, ACCELERATION = 60.0, 3000.0
COUNT_MM = 0.01
REPLY_S = 0.017
FORCE_HZ = 500.0
HOLD_S = 1.0


def trapezoid(t, start, end, speed=SPEED, acceleration=ACCELERATION):
    """Position at times t after the start, by the three pieces of the textbook."""
    way, sign = abs(end - start), math.copysign(1.0, end - start)
    speed = min(speed, math.sqrt(acceleration * way))
    rise, cruise = speed / acceleration, way / speed - speed / acceleration
    t = np.clip(np.asarray(t, dtype=float), 0.0, 2 * rise + cruise)
    left = 2 * rise + cruise - t
    gone = np.where(t < rise, 0.5 * acceleration * t**2, 0.5 * speed * rise + speed * (t - rise))
    return start + sign * np.where(left < rise, way - 0.5 * acceleration * left**2, gone)


class Axis:
    """Moves between depths, each begun some time after its command; force by a spring of `stiffness` N/mm.

    `compliance` (mm/N): what the servo gives way until it has taken the force up within `tau_s`.
    """

    def __init__(self, depths, seed=0, stiffness=0.0, compliance=0.0, tau_s=0.03, speed=SPEED, taken=True):
        rng = np.random.default_rng(seed)
        self.time_s = np.arange(0.0, HOLD_S * len(depths) + 0.5, 1e-4)
        self.planned = np.full(self.time_s.size, float(depths[0]))
        self.speed = speed
        self.events = []
        self.begun = []
        for i, (start, end) in enumerate(zip(depths, depths[1:], strict=False)):
            commanded = 0.5 + HOLD_S * i
            begun = commanded + rng.uniform(0.002, REPLY_S - 0.002)
            self.begun.append(begun)
            after = self.time_s >= begun
            self.planned[after] = trapezoid(self.time_s[after] - begun, start, end, speed)
            told = {"target_mm": end, "speed_mm_s": speed, "acceleration_mm_s2": ACCELERATION, "waited_s": REPLY_S}
            if taken:
                self.events.append(Event(commanded + REPLY_S, "move", told))
        self.stiffness = stiffness
        self.force = stiffness * np.maximum(self.planned, 0.0)
        given = np.zeros(self.time_s.size)
        for k in range(1, given.size):  # y' = F' − y/τ, by small steps
            rise = self.force[k] - self.force[k - 1]
            given[k] = given[k - 1] + rise - 1e-4 * given[k - 1] / tau_s
        self.position = self.planned - compliance * given
        self.rng = rng

    def at(self, t):
        return np.interp(t, self.time_s, self.position)

    def recording(self, period_s=0.011, stamp_std_s=0.0, noise_N=0.0) -> Recording:
        polls = np.arange(self.rng.uniform(0.0, period_s), self.time_s[-1], period_s)
        read = np.round(self.at(polls) / COUNT_MM) * COUNT_MM
        nan = np.full(polls.size, np.nan)
        t = np.arange(0.0, self.time_s[-1] - 0.02, 1 / FORCE_HZ)
        force = np.interp(t, self.time_s, self.force) + noise_N * self.rng.standard_normal(t.size)
        events = [Event(0.0, "polled", {"period_s": period_s, "stamp_std_s": stamp_std_s}), *self.events]
        cell = ForceChannel(t, force, force, t, np.zeros(t.size, dtype=bool))
        marks = [StepMark(0.2, "steps[0]", "steps", "ramp")]
        return Recording(
            Path("run.mcap"), MotorChannel(polls, read, nan, nan, polls), cell, events, marks, surface_mm=0.0
        )


def errors_um(axis, measurement):
    """Of the measurement's motion, at every instant that counts."""
    t = np.arange(0.3, measurement.position_time_s[-1], 2e-4)
    drawn = np.interp(t, measurement.position_time_s, measurement.position_mm)
    return t, 1e3 * (drawn - axis.at(t))


@pytest.mark.parametrize("seed", range(4))
def test_the_profile_stands_between_the_polls(seed):
    axis = Axis([0.0, 1.0, 1.6, 0.4, 0.0], seed)
    recording = axis.recording()
    polls = recording.motor.position_mm.copy()
    m = recording.measurement()
    _, drawn = errors_um(axis, m)
    t = np.arange(0.3, recording.motor.time_s[-1], 2e-4)
    straight = 1e3 * (np.interp(t, recording.motor.time_s, polls) - axis.at(t))
    assert np.abs(straight).max() > 30, "the premise: lines between polls miss the motion"
    # Three or more polls tell a start to some 60 µs, which at 60 mm/s are 4 µm; a rounding can be half a count.
    assert np.sqrt(np.mean(drawn**2)) < 1.0
    assert np.abs(drawn).max() < 12
    assert np.array_equal(recording.motor.position_mm, polls), "nothing measured is changed"
    assert any("commanded profile" in note for note in m.notes)


def test_outside_the_moves_nothing_is_added():
    axis = Axis([0.0, 1.0])
    recording = axis.recording()
    m = recording.measurement()
    before = m.position_time_s < 0.4
    assert np.array_equal(m.position_time_s[before], recording.motor.time_s[recording.motor.time_s < 0.4])
    assert m.position_time_s.size < recording.motor.time_s.size + 200


@pytest.mark.parametrize("change", [{"period_s": 0.0005}, {"taken": False}])
def test_quick_polls_and_unknown_moves_stay_as_they_are(change):
    axis = Axis([0.0, 1.0, 0.0], stiffness=5.0, taken=change.pop("taken", True))
    recording = axis.recording(**change, stamp_std_s=1e-3)
    m = recording.measurement()
    assert np.array_equal(m.position_time_s, recording.motor.time_s)
    assert np.array_equal(m.position_mm, recording.motor.position_mm)
    assert not m.doubtful and not m.notes and m.stamp_std_s == 0


@pytest.mark.parametrize("compliance", [0.0, 3e-3])
def test_what_the_servo_gives_way(compliance):
    """A few micrometres that the count hides, read from all the moves together."""
    axis = Axis([0.0, 1.0, 2.0, 0.8, 1.8, 0.0], seed=1, stiffness=6.0, compliance=compliance)
    m = axis.recording(noise_N=0.01).measurement()
    t, drawn = errors_um(axis, m)
    after = np.zeros(t.size, dtype=bool)
    for begun in axis.begun:
        after |= (t > begun + 0.05) & (t < begun + 0.3)
    assert np.sqrt(np.mean(drawn[after] ** 2)) < 1.0
    assert any("gives way" in note for note in m.notes) == (compliance > 0)


def test_a_halted_move_ends_where_it_was_halted():
    """Braked as hard as it would have at its end: to the polls it is a shorter trapezoid."""
    axis = Axis([0.0, 0.8], seed=2)
    move = axis.events[0]
    axis.events = [Event(move.time_s, "move", {**move.data, "target_mm": 3.0}), Event(move.time_s + 0.01, "halt", {})]
    _, drawn = errors_um(axis, axis.recording().measurement())
    assert np.abs(drawn).max() < 12


@pytest.mark.parametrize("seed", range(6))
def test_a_slow_move_halted_between_two_counts_stands_there(seed):
    """Several polls are of one count; what they tell while it moves is finer than the count it stands on."""
    way = 0.08 + 0.06 * np.random.default_rng(seed).uniform()
    axis = Axis([0.0, way], seed, speed=0.2)
    move, braked_s = axis.events[0], axis.begun[0] + way / 0.2
    halted_s = braked_s - np.random.default_rng(seed + 50).uniform(0.0, REPLY_S)
    axis.events = [Event(move.time_s, "move", {**move.data, "target_mm": 3.0}), Event(halted_s, "halt", {})]
    recording = axis.recording()
    t, drawn = errors_um(axis, recording.measurement())
    # Half of what a halt waits, at 0.2 mm/s, is 1.7 µm; a count of 10 µm leaves an error of 2.9 µm, and 5 at most.
    assert np.abs(drawn[t > 0.6]).max() < 2.3
    polls = 1e3 * (np.interp(t, recording.motor.time_s, recording.motor.position_mm) - axis.at(t))
    assert np.abs(polls[(t > 0.6) & (t < braked_s)]).max() > 4.0, "the premise: stairs of a count"


def test_what_is_not_known_costs_nothing():
    """0.5 ms at 60 mm/s on 6 N/mm are 0.18 N: such samples do not count, those of holds and of slow motion do."""
    quick = Axis([0.0, 1.0, 2.0, 0.0], seed=3, stiffness=6.0).recording(stamp_std_s=5e-4, noise_N=0.01).measurement()
    assert quick.stamp_std_s >= 5e-4
    counted = quick.counted()
    axis = Axis([0.0, 1.0, 2.0, 0.0], seed=3)
    moving = np.zeros(counted.size, dtype=bool)
    for begun in axis.begun:
        moving |= (quick.force_time_s > begun + 0.01) & (quick.force_time_s < begun + 0.03)
    holding = np.zeros(counted.size, dtype=bool)
    for begun in axis.begun:
        holding |= (quick.force_time_s > begun + 0.4) & (quick.force_time_s < begun + 0.9)
    assert not counted[moving].any() and counted[holding].all()
    assert not counted[quick.force_time_s < 0.2].any(), "before the first step it is history, as ever"
    slow = Axis([0.0, 0.5], stiffness=6.0, speed=0.6).recording(stamp_std_s=5e-4, noise_N=0.01).measurement()
    assert slow.counted()[slow.force_time_s > 0.2].mean() > 0.95


def test_what_an_axis_gives_way_is_known_as_well_as_it_is_said_to_be():
    """A servo's numbers between those of any grid, on polls of a coarse count; the pad's force steps and relaxes."""
    compliance_mm_N, tau_s, later_s, h = 8.2e-3, 0.0335, 0.0042, 2.5e-4
    t = np.arange(0.0, 40.0, h)
    steps_N = np.diff([0.0, 2.0, 6.6, 5.0, 11.0, 3.0, 8.0, 1.0, 0.0])
    since = t[:, None] - (2.0 + 4.5 * np.arange(len(steps_N)))
    rises = np.clip(since / 0.03, 0.0, 1.0) * (0.7 + 0.3 * np.exp(-4.0 * np.maximum(since, 0.0)))
    force = rises @ steps_N
    behind = np.zeros(t.size)  # (1/k) τ x' + x = τ F', by the trapezoidal rule
    for n in range(1, t.size):
        behind[n] = ((2 * tau_s - h) * behind[n - 1] + 2 * tau_s * (force[n] - force[n - 1])) / (2 * tau_s + h)
    true_mm = compliance_mm_N * np.interp(t - later_s, t, behind)
    off = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        polls_s = np.arange(0.5, 39.5, 0.011) + rng.uniform(0.0, 0.001, 3546)
        stands = -np.interp(polls_s, t, true_mm) + 7e-4 * rng.standard_normal(polls_s.size)
        felt_s = np.arange(0.0, 40.0, 0.002)
        felt_N = np.interp(felt_s, t, force) + 0.01 * rng.standard_normal(felt_s.size)
        way = giving_way(polls_s, np.rint(stands / 0.01) * 0.01, felt_s, felt_N, 0.01, 7e-4)
        assert way is not None and way.compliance_mm_N == pytest.approx(compliance_mm_N, rel=0.2)
        off.append(np.mean((way.at(t) - true_mm) ** 2) / np.mean(way.std_at(t) ** 2))
    assert 0.3 < np.sqrt(np.mean(off)) < 2.0
