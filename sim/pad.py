"""The pad as a Hammerstein plant, equations (5) to (14), with its effects: streaming and over arrays.

Both forms run the same compiled step (sim/kernel.py) on the same layout, so they agree to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import kernel as k
from sim import slots as slot
from sim.effects.base import Active
from sim.elastic import ElasticLaw
from sim.grid import Grid, check_times, checked, of_one_length, steps, union
from sim.program import Layout, lay_out
from sim.relaxation import Relaxation

Array = NDArray[np.float64]


_PRESSED, _RESTED = 40, 4
"""Steps of a second's way in, and at rest, before a run that begins amid the pad's load: sliders lie as after that."""


@dataclass(frozen=True)
class Pad:
    """Elastic response, relaxation, and whether the pad lets go (`unilateral`) or pulls (`bonded`)."""

    law: ElasticLaw
    relaxation: Relaxation
    unilateral: bool
    film_Ns: float = 0.0
    """Impulse of tension that a film bears before a `unilateral` pad lets go."""
    film_once: bool = False
    """Whether that is the impulse it bears in all: a bond that is broken does not heal."""
    bonded: float = 0.0
    """Share of its face that stays bonded where a `unilateral` pad lets go: columns beside each other, as in a Winkler
    foundation."""


@dataclass(frozen=True)
class Past:
    """What is left of the time before the first sample in modes of some rates, in 1/s: forces beyond those of a pad
    just pressed, N, that fade as c_i · left_i e^(−ν_i t). Modes of other rates have what stands between. Of what does
    not fade within a run of `run_s` nothing is said: it is a force that is always there."""

    rates: tuple[float, ...]
    left_N: tuple[float, ...]
    run_s: float = math.inf

    def at(self, rates: Sequence[float]) -> Array:
        """Forces left in modes (r,), N, as far as they fade; none of which a pad without relaxation has."""
        if not self.rates:
            return np.zeros(len(rates))
        order, asked = np.argsort(self.rates), np.array(rates)
        left = np.interp(np.log(asked), np.log(np.array(self.rates)[order]), np.array(self.left_N)[order])
        return np.asarray(-left * np.expm1(-asked * self.run_s))


class Cascade:
    """A pad with its effects, ready to run. Immutable; plants made from it have their own state. `past`: of a run that
    begins amid another; else it begins at rest."""

    def __init__(self, pad: Pad, effects: Sequence[Active] = (), past: Past | None = None) -> None:
        for active in effects:
            if active.form.amend is not None:
                pad = active.form.amend(pad, active.values)
        self.pad = pad
        self.effects = tuple(effects)
        self.past = past

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != "layout"}  # has addresses in it

    @cached_property
    def layout(self) -> Layout:
        """The arrays that the compiled loop reads; compiles what is not compiled yet."""
        return lay_out(self.pad, self.effects)

    def plant(self) -> Plant:
        """A plant at rest, never touched."""
        return Plant(self.layout)

    @property
    def shifts_time(self) -> bool:
        """Whether some effect separates a force's stamp from when it was felt."""
        return any(active.form.time_shift is not None for active in self.effects)

    def felt_at(self, stamp_s: ArrayLike) -> Array:
        """When a force reported with a stamp was felt, s; the stamp itself without delays or drifting clocks."""
        t = np.asarray(stamp_s, dtype=np.float64)
        for active in self.effects:
            if active.form.time_shift is not None:
                t = active.form.time_shift(active.values, t)
        return t

    def simulate(self, time_s: ArrayLike, position_mm: ArrayLike) -> Array:
        """Force as reported, N, shape (n,), for reported pad-frame positions (n,) at times (n,) that do not fall.

        The first position is reached in an instant from rest out of contact: a depth there at the start is a step.
        Raises ValueError for arrays that do not match, are not finite, or times that fall.
        """
        if self.shifts_time:
            return self.simulate_at(time_s, position_mm, time_s)
        return self.simulate_on(Grid(time_s), position_mm)

    def simulate_on(self, grid: Grid, position_mm: ArrayLike) -> Array:
        """As `simulate`, for times that are checked already: a fit runs over the same ones again and again."""
        if self.shifts_time:
            return self.simulate_at(grid.time_s, position_mm, grid.time_s)
        reported = of_one_length(grid.time_s, position_mm)
        forms = [(a.form, a.values) for a in self.effects if "report" in a.form.blocks]
        reports = tuple((form.blocks["report"].address, form.vector(values)) for form, values in forms)
        force, _ = self._run(grid, grid.true_mm(reports, reported, self._true) if reports else reported)
        return self._sampled(grid.dt_s, force)

    def simulate_at(self, position_time_s: ArrayLike, position_mm: ArrayLike, force_time_s: ArrayLike) -> Array:
        """Force as reported at force times (m,), for positions (n,) at their own times, linear between them.

        The plant runs on the union of both grids, so neither channel is resampled. Before the first and after the
        last position stamp the position stands still. Of positions with one stamp the last holds.
        """
        time, position = checked(position_time_s, position_mm)
        force_time = k.as_vector(force_time_s)
        check_times(force_time, "force")
        if time.size == 0:
            raise ValueError("no position samples")
        last = np.append(np.diff(time) > 0.0, True)
        time, position = time[last], self._true(position[last])
        felt = k.as_vector(self.felt_at(force_time))
        every, index = union(time, felt)
        force, _ = self._run(Grid(every), np.interp(every, time, position))
        return self._sampled(steps(force_time), force[index])

    def probe(self, time_s: ArrayLike, position_mm: ArrayLike) -> tuple[Array, Array]:
        """(force at the cell, N; probe position, mm), both (n,), before the force path; else as `simulate`."""
        grid = Grid(time_s)
        return self._run(grid, self._true(of_one_length(grid.time_s, position_mm)), felt_by_cell=True)

    def _true(self, reported: Array) -> Array:
        """True positions from reported ones."""
        true = reported.copy()
        if self.layout.has("report"):
            k.unreport(self.layout.program, self.layout.parameters, self.layout.state.copy(), true)
        return true

    def _run(self, grid: Grid, position: Array, felt_by_cell: bool = False) -> tuple[Array, Array]:
        """(force after the sensor's dynamics, or as the cell feels it; the probe), for true positions."""
        layout = self.layout
        state = layout.state.copy()
        if self.past is not None and position.size:
            self._begin(state, float(position[0]), self.past)
        force, probe = np.empty(position.size), np.empty(position.size)
        # where a block changes the rates they are worked out step by step
        decay, gain = grid.fades(() if layout.has("rate") else self.pad.relaxation.rates)
        k.run(layout.program, layout.parameters, state, grid.dt_s, position, force, probe, decay, gain)
        if layout.has("sensor") and not felt_by_cell:
            k.run_chain(layout.program, layout.parameters, state, slot.SENSOR, grid.dt_s, force)
        return force, probe

    def _begin(self, state: Array, at_mm: float, past: Past) -> None:
        """The state where a run begins amid a pad's load: it was pressed to that depth, and what it has gone through
        has left something in its modes."""
        way = np.concatenate([np.linspace(min(0.0, at_mm), at_mm, _PRESSED), np.full(_RESTED, at_mm)])
        dt = np.append(0.0, np.full(way.size - 1, 1.0 / _PRESSED))
        program, r = self.layout.program, self.pad.relaxation.order
        spare, none = np.empty((2, way.size)), np.empty((0, way.size))
        k.run(program, self.layout.parameters, state, dt, way, spare[0], spare[1], none, none)
        twins = (0, int(program[slot.INNER_SIZE]) // 2) if program[slot.BONDED] else (0,)
        for pad in (int(program[slot.INNER]) + twin for twin in twins):
            state[pad + slot.W : pad + slot.W + r] = state[pad + slot.FE] + past.at(self.pad.relaxation.rates)

    def _sampled(self, dt: Array, force: Array) -> Array:
        """What sampling makes of a force at its samples, `dt` apart."""
        layout = self.layout
        if layout.has("sampling"):
            force = k.as_vector(force)
            k.run_chain(layout.program, layout.parameters, layout.state.copy(), slot.SAMPLING, dt, force)
        return force


class Plant:
    """The streaming form: one sample in, one force out. Give the first step dt_s = 0."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self.program = layout.program
        self.parameters = layout.parameters
        self.state = layout.state.copy()
        self._step = k.step.native
        self._chain = k.chain_step.native
        self._pad = int(layout.program[slot.INNER])

    def __reduce__(self) -> str:
        raise TypeError("a plant belongs to its process; send the model, and make a plant of it there")

    def step(self, dt_s: float, motor_side_mm: float) -> float:
        """Move to a true pad-frame position within dt_s (linearly); force at the cell in N, before the sensor."""
        return self._step(self.program, self.parameters, self.state, dt_s, motor_side_mm)

    def sense(self, dt_s: float, force_N: float) -> float:
        """The force path (lag, resonance, bias …) over one step: force at the cell → force in the path, N."""
        return self._chain(self.program, self.parameters, self.state, slot.SENSOR, dt_s, force_N)

    def sample(self, dt_s: float, force_N: float) -> float:
        """One sample of the force path: what is reported, dt_s after the last sample (limits, stuck values …)."""
        return self._chain(self.program, self.parameters, self.state, slot.SAMPLING, dt_s, force_N)

    def reported_mm(self, position_mm: float) -> float:
        """Position as the encoder reports it, for a true one."""
        return self._chain(self.program, self.parameters, self.state, slot.REPORT, 0.0, position_mm)

    @property
    def probe_mm(self) -> float:
        """Where the probe is: motor side less play and deflection."""
        return float(self.state[slot.Y])

    @property
    def force_N(self) -> float:
        """Force at the cell after the last step."""
        return float(self.state[slot.CELL])

    @property
    def pad_force_N(self) -> float:
        """Force between probe and pad after the last step."""
        return float(self.state[self._pad + slot.PAD_FORCE])

    @property
    def depth_mm(self) -> float:
        """Depth that the pad's law sees (probe less offsets and set)."""
        return float(self.state[self._pad + slot.PAD_DEPTH])

    @property
    def elastic_force_N(self) -> float:
        """F^e after the last step; where the pad has let go, the one that gives no force."""
        return float(self.state[self._pad + slot.FE])

    @property
    def residual_mm(self) -> float:
        """What was left of y + Σ frame(F) − x in the last step; 0 without a frame effect."""
        return float(self.state[slot.RESIDUAL])

    def reset(self) -> None:
        """Back to rest, never touched."""
        self.state[:] = self._layout.state

    def copy(self) -> Self:
        """A second plant in the same state."""
        twin = type(self)(self._layout)
        twin.state[:] = self.state
        return twin
