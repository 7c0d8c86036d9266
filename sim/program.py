"""Lays a pad and its effects out for the compiled loop: program, parameters, first state (see sim/slots.py)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sim import slots as slot
from sim.effects.base import Active

if TYPE_CHECKING:
    from sim.pad import Pad

Array = NDArray[np.float64]

SOLVED = ("frame", "probe", "depth", "elastic", "rate", "contact", "gap", "load")
"""Places inside the loop between frame and cell."""


@dataclass(frozen=True)
class Layout:
    """`program` and `parameters` are shared by all plants of a model and not written; each starts from `state`."""

    program: NDArray[np.int64]
    parameters: Array
    state: Array

    def has(self, place: str) -> bool:
        """Whether any block stands at the place."""
        start = slot.STARTS + slot.PLACES.index(place)
        return bool(self.program[start] != self.program[start + 1])


def lay_out(pad: Pad, effects: Sequence[Active]) -> Layout:
    """The pad and the effects, in the order given, as arrays."""
    parameters: list[float] = [pad.relaxation.c_0, *pad.relaxation.shares, *pad.relaxation.rates]
    law_at = len(parameters)
    parameters += pad.law.kernel_parameters
    film_at = len(parameters) if pad.film_Ns > 0.0 else 0
    parameters.append(pad.film_Ns)
    bonded_at = len(parameters) if pad.bonded > 0.0 else 0
    parameters.append(pad.bonded)

    r = pad.relaxation.order
    inner = [0.0] * (slot.W + r)
    outer: list[float] = []
    placed: list[tuple[Active, int, bool, int]] = []
    for active in effects:
        solved = any(place in SOLVED for place in active.form.blocks)
        region = inner if solved else outer
        placed.append((active, len(region), solved, len(parameters)))
        region += active.form.state
        parameters += active.form.vector(active.values)

    if bonded_at:
        inner += inner
    cache_at = slot.OUTER + len(outer)
    inner_at = cache_at + 1 + 2 * r
    trial_at = inner_at + len(inner)
    scratch_at = trial_at + len(inner)
    state = np.zeros(scratch_at + len(inner) + 1)  # a block without state at the very end still points inside
    state[slot.SLOPE] = 1.0
    state[slot.OUTER : cache_at] = outer
    state[cache_at] = np.nan
    state[inner_at:trial_at] = inner

    rows: list[tuple[int, int, int]] = []
    starts = [0]
    for place in slot.PLACES:
        if place == "law":
            rows.append((pad.law.block.address, inner_at, law_at))
        for active, offset, solved, parameters_at in placed:
            if place in active.form.blocks:
                base = inner_at if solved else slot.OUTER
                rows.append((active.form.blocks[place].address, base + offset, parameters_at))
        starts.append(len(rows))

    program = np.zeros(slot.ROWS + 3 * len(rows), dtype=np.int64)
    program[slot.MODES] = r
    program[slot.UNILATERAL] = pad.unilateral
    program[slot.FILM] = film_at
    program[slot.ONCE] = pad.film_once
    program[slot.BONDED] = bonded_at
    program[slot.INNER] = inner_at
    program[slot.INNER_SIZE] = len(inner)
    program[slot.TRIAL] = trial_at
    program[slot.SCRATCH] = scratch_at
    program[slot.RELAX] = 0
    program[slot.CACHE] = cache_at
    program[slot.STARTS : slot.ROWS] = starts
    program[slot.ROWS :] = np.array(rows, dtype=np.int64).ravel()
    vector = np.array([*parameters, 0.0])
    return Layout(program, vector, state)
