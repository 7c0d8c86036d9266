"""The axis of the simulated bench: a servo-driven mover with a plant at its tip, in motor-frame coordinates.

`BenchPlant` is what simulated devices read and command. It runs on a fixed grid of substeps and interpolates, so what
it says at a time does not depend on how often it was asked before. A command takes effect at the first grid point not
yet integrated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim import axis_kernel as a
from sim.kernel import as_vector
from sim.model import Model
from sim.slots import Array

GRAVITY_M_S2 = 9.80665
STREAM_GAP_S = 0.05
"""Set-points further apart than this are single commands, not a stream: no speed is read into them."""

_ON_GRID = 1e-6
"""Share of a substep by which a time may miss its grid point and still be on it (rounding of the clock)."""

_MOVING_MM_S = 0.1


@dataclass(frozen=True)
class ServoSettings:
    """The mover, its drive and its rail.

    The servo is a PD controller on position with speed fed forward, and a slow integral that takes up weight and pad
    force; `bandwidth_hz` and `damping_ratio` are those of the free mover under it. Forces of the drive are limited to
    `max_force_N`. `vertical`: the weight pulls into the pad, as on an axis that stands above its sample.
    """

    moving_mass_kg: float = 0.5
    stroke_mm: tuple[float, float] = (-20.0, 20.0)
    vertical: bool = False
    bandwidth_hz: float = 90.0
    damping_ratio: float = 1.0
    integral_per_s: float = 30.0
    max_force_N: float = 150.0
    max_acceleration_mm_s2: float = 100_000.0
    max_speed_mm_s: float = 2000.0
    rail_friction_N: float = 0.2
    substep_s: float = 0.00025

    def __post_init__(self) -> None:
        if not self.moving_mass_kg > 0.0 or not self.substep_s > 0.0:
            raise ValueError("moving_mass_kg and substep_s must be greater than 0")
        if not self.stroke_mm[0] < self.stroke_mm[1]:
            raise ValueError("stroke_mm must be (lower, upper)")
        # the velocity term of the semi-implicit rule swings from a gain of 1 on
        if self.omega * self.substep_s * max(1.0, 2.0 * self.damping_ratio) > 1.0:
            raise ValueError(f"a servo of {self.bandwidth_hz:g} Hz needs substeps shorter than {self.substep_s:g} s")

    @property
    def omega(self) -> float:
        """The servo's natural frequency in rad/s."""
        return 2.0 * math.pi * self.bandwidth_hz


class BenchPlant:
    """Axis and plant together. Starts at `position_mm`, at rest, released, at bench time 0.

    `surface_mm` is the height of the pad in the motor frame: pad-frame position = motor-frame position − surface.
    """

    def __init__(self, settings: ServoSettings, model: Model, surface_mm: float, position_mm: float) -> None:
        low, high = settings.stroke_mm
        if not low <= position_mm <= high:
            raise ValueError(f"position {position_mm:g} mm is outside the stroke {low:g} to {high:g} mm")
        self.settings = settings
        self.surface_mm = surface_mm
        self.plant = model.plant()
        self._cascade = model.cascade
        self._run = a.run_axis.native
        self._setpoint_at = a.setpoint_at.native
        self._h = settings.substep_s
        self._t = 0.0
        self._n = 0
        self._last_setpoint_s = -math.inf
        self._s = np.zeros(a.SETTINGS)
        self._s[a.SUBSTEP] = settings.substep_s
        self._s[a.MASS] = settings.moving_mass_kg
        self._s[a.OMEGA] = settings.omega
        self._s[a.DAMPING] = settings.damping_ratio
        self._s[a.INTEGRAL_RATE] = settings.integral_per_s
        self._s[a.MAX_FORCE] = settings.max_force_N
        self._s[a.MAX_ACCELERATION] = settings.max_acceleration_mm_s2
        self._s[a.MAX_SPEED] = settings.max_speed_mm_s
        self._s[a.LOW], self._s[a.HIGH] = low, high
        self._s[a.RAIL_FRICTION] = settings.rail_friction_N
        self._s[a.WEIGHT] = settings.moving_mass_kg * GRAVITY_M_S2 if settings.vertical else 0.0
        self._s[a.SURFACE] = surface_mm
        self._axis = np.zeros(a.AXIS)
        self._axis[a.POSITION] = self._axis[a.SETPOINT] = position_mm
        force = self.plant.step(0.0, position_mm - surface_mm)
        self._axis[a.FORCE] = force
        self._limit_N = settings.max_force_N
        self._weak_N: dict[object, float] = {}
        self._jammed = self._clamped = False
        self._history = np.zeros((8192, a.HISTORY))
        self._history[0, a.H_POSITION] = self._history[0, a.H_SETPOINT] = position_mm
        self._history[0, a.H_FORCE] = force
        self._history[0, a.H_SENSED] = self.plant.sense(0.0, force)

    # time

    @property
    def time_s(self) -> float:
        """Bench time reached."""
        return self._t

    def advance(self, t_s: float) -> None:
        """Integrate up to bench time t_s; nothing happens when that is in the past."""
        if t_s <= self._t:
            return
        self._t = t_s
        n = math.ceil(t_s / self._h - _ON_GRID)
        if n > self._n:
            plant = self.plant
            self._run(plant.program, plant.parameters, plant.state, self._s, self._axis, self._history, self._n, n)
            self._n = n

    def _at(self, column: int, t_s: float) -> float:
        """A column of the history at a time, linear between substeps; the oldest kept where it is older."""
        rows = self._history.shape[0]
        place = min(max(t_s / self._h, self._n - rows + 1, 0.0), float(self._n))
        low = min(int(place), max(self._n - 1, 0))
        share = place - low
        value = self._history.item  # a Python number at once: half the time of indexing
        before = value(low % rows, column)
        if share == 0.0:
            return before
        return before + share * (value((low + 1) % rows, column) - before)

    # what it is told

    @property
    def _command_s(self) -> float:
        """Time from which a command given now holds: the first substep not yet integrated."""
        return self._n * self._h

    def hold(self, position_mm: float) -> None:
        """Servo on, set-point now. Set-points that come as a stream are followed with their speed fed forward."""
        axis = self._axis
        gap = self._t - self._last_setpoint_s
        streaming = axis[a.MODE] == a.STREAM and gap <= STREAM_GAP_S
        if not streaming:
            axis[a.FEED] = 0.0
        elif gap > 0.0:
            axis[a.FEED] = (position_mm - axis[a.SETPOINT]) / gap
            axis[a.FEED_UNTIL] = self._t + 2.0 * gap
        axis[a.MODE] = a.STREAM
        axis[a.SETPOINT] = position_mm
        self._last_setpoint_s = self._t

    def profile(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """Servo on; a trapezoid made by the device, from the present set-point and its speed to the target.

        Raises ValueError unless speed and acceleration are greater than 0.
        """
        if not speed_mm_s > 0.0 or not acceleration_mm_s2 > 0.0:
            raise ValueError("a move needs a speed and an acceleration greater than 0")
        start, speed = self._motion_now()
        turn = start + speed * abs(speed) / (2.0 * acceleration_mm_s2)  # where braking at once would end
        sign = 1.0 if target_mm >= turn else -1.0
        u0 = sign * speed
        way = sign * (target_mm - start)
        peak = math.sqrt(max(0.0, acceleration_mm_s2 * way + 0.5 * u0 * u0))
        peak = min(peak, speed_mm_s)
        a1 = acceleration_mm_s2 if u0 <= peak else -acceleration_mm_s2
        t1 = (peak - u0) / a1
        rest = way - (u0 + 0.5 * a1 * t1) * t1 - 0.5 * peak * peak / acceleration_mm_s2
        t2 = max(0.0, rest) / peak if peak > 0.0 else 0.0
        self._start_profile(start, target_mm, sign, u0, a1, t1, t2, peak, acceleration_mm_s2)

    def halt(self, deceleration_mm_s2: float) -> None:
        """Bring the set-point to rest and hold there; a released axis is caught. Raises ValueError unless > 0."""
        if not deceleration_mm_s2 > 0.0:
            raise ValueError("a halt needs a deceleration greater than 0")
        start, speed = self._motion_now()
        sign = math.copysign(1.0, speed)
        end = start + speed * abs(speed) / (2.0 * deceleration_mm_s2)
        self._start_profile(start, end, sign, abs(speed), 1.0, 0.0, 0.0, abs(speed), deceleration_mm_s2)

    def _motion_now(self) -> tuple[float, float]:
        """Set-point and its speed where the next command starts; the axis itself when released."""
        if self._axis[a.MODE] in (a.RELEASED, a.PUSH):
            return float(self._axis[a.POSITION]), float(self._axis[a.SPEED])
        position, speed, _ = self._setpoint_at(self._axis, self._command_s)
        return position, speed

    def _start_profile(
        self,
        start: float,
        end: float,
        sign: float,
        u0: float,
        a1: float,
        t1: float,
        t2: float,
        peak: float,
        a3: float,
    ) -> None:
        axis = self._axis
        axis[a.MODE] = a.PROFILE
        axis[a.SETPOINT] = end
        axis[a.P_TIME], axis[a.P_START], axis[a.P_END] = self._command_s, start, end
        axis[a.P_SIGN], axis[a.P_SPEED], axis[a.P_PEAK] = sign, u0, peak
        axis[a.P_A1], axis[a.P_T1], axis[a.P_T2] = a1, t1, t2
        axis[a.P_A3], axis[a.P_T3] = a3, peak / a3

    def release(self) -> None:
        """Servo off: pad, rail friction and (if vertical) weight move the axis."""
        self._axis[a.MODE] = a.RELEASED

    def push(self, force_N: float, damping_N_s_mm: float = 0.0) -> None:
        """Drive with a force instead of to a position, less a damping force against the speed.

        Raises ValueError for a damping below 0, or so strong that it would swing within a substep.
        """
        settings = self.settings
        if not 0.0 <= damping_N_s_mm * settings.substep_s * 1000.0 <= settings.moving_mass_kg:
            limit = settings.moving_mass_kg / settings.substep_s / 1000.0
            raise ValueError(f"damping must be from 0 to {limit:g} N*s/mm, not {damping_N_s_mm:g}")
        self._axis[a.MODE] = a.PUSH
        self._axis[a.PUSH_FORCE], self._axis[a.PUSH_DAMPING] = force_N, damping_N_s_mm

    def limit_force(self, force_N: float) -> None:
        """What the drive can push from now on, N; never more than `settings.max_force_N`."""
        if not force_N >= 0.0:
            raise ValueError("a force limit is 0 or more")
        self._limit_N = force_N
        self._s[a.MAX_FORCE] = self._strength_N

    def brake(self, on: bool) -> None:
        """Clamp the mover, or let it go."""
        self._clamped = on
        self._axis[a.BRAKED] = 1.0 if on or self._jammed else 0.0

    # what goes wrong with it

    def weaken(self, cause: object, force_N: float | None) -> None:
        """The drive can push no more than this from now on (N), whatever it is allowed; None: that cause is gone.

        The least of all causes counts: a hot drive does not free a stalled one.
        """
        if force_N is None:
            self._weak_N.pop(cause, None)
        else:
            self._weak_N[cause] = force_N
        self._s[a.MAX_FORCE] = self._strength_N

    @property
    def _strength_N(self) -> float:
        return min(self.settings.max_force_N, self._limit_N, *self._weak_N.values())

    def jam(self, on: bool) -> None:
        """The mover sticks where it is, or comes free again."""
        self._jammed = on
        self._axis[a.BRAKED] = 1.0 if on or self._clamped else 0.0

    def obstruct(self, position_mm: float | None) -> None:
        """Something stands in the way: the mover gets no further into the pad than here; None: it is gone."""
        high_mm = self.settings.stroke_mm[1]
        self._s[a.HIGH] = high_mm if position_mm is None else min(position_mm, high_mm)

    # what it says

    @property
    def position_mm(self) -> float:
        """True position, motor frame."""
        return self._at(a.H_POSITION, self._t)

    @property
    def reported_position_mm(self) -> float:
        """Position as the encoder reports it, motor frame."""
        return self.plant.reported_mm(self.position_mm - self.surface_mm) + self.surface_mm

    @property
    def speed_mm_s(self) -> float:
        """True speed."""
        return self._at(a.H_SPEED, self._t)

    @property
    def force_N(self) -> float:
        """True force at the cell, before the force path and its noise."""
        return self._at(a.H_FORCE, self._t)

    @property
    def motor_force_N(self) -> float:
        """Force of the drive on the mover."""
        return self._at(a.H_MOTOR, self._t)

    @property
    def setpoint_mm(self) -> float:
        """Set-point; the position itself when released."""
        return self._at(a.H_SETPOINT, self._t)

    @property
    def servo_on(self) -> bool:
        """Whether the drive holds or moves the axis."""
        return bool(self._axis[a.MODE] != a.RELEASED)

    @property
    def braked(self) -> bool:
        """Whether the brake is on."""
        return bool(self._axis[a.BRAKED] != 0.0)

    @property
    def moving(self) -> bool:
        """Whether a move made by the device is under way, or the axis is faster than 0.1 mm/s."""
        axis = self._axis
        under_way = axis[a.MODE] == a.PROFILE and self._t < axis[a.P_TIME] + axis[a.P_T1] + axis[a.P_T2] + axis[a.P_T3]
        return bool(under_way) or abs(self.speed_mm_s) > _MOVING_MM_S

    @property
    def at_end_stop(self) -> int:
        """−1 at the lower stop, 1 at the upper, else 0."""
        return int(self._axis[a.AT_STOP])

    def sensed_force_N(self, stamp_s: float) -> float:
        """Force in the path (lag, resonance, bias …) for a sample stamped so, with late or drifting force clocks.

        For stamps up to the time reached and up to 2 s before it; `plant.sample` makes what is reported of it.
        """
        return self._at(a.H_SENSED, float(self._cascade.felt_at(stamp_s)))

    def history(self, since_s: float) -> tuple[Array, Array, Array]:
        """(time, true position, force at the cell) at the substeps from `since_s` on that are still kept (2 s)."""
        first = max(0, self._n - self._history.shape[0] + 1, math.ceil(since_s / self._h - _ON_GRID))
        n = np.arange(first, self._n + 1)
        rows = self._history[n % self._history.shape[0]]
        return as_vector(n * self._h), rows[:, a.H_POSITION], rows[:, a.H_FORCE]
