"""Where the numbers of a plant stand, and its blocks called place by place.

A plant is a *program* (int64: sizes, then the blocks by place), its *parameters* and its *state* (float64); see
sim/program.py for how they are laid out, and sim/kernel.py for what is done with them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.jit import call_block, compiled

Array = NDArray[np.float64]
Program = NDArray[np.int64]
Ints = Program  # inside the loop these are bare pointers
Doubles = Array

PLACES = (
    "report",
    "play",
    "frame",
    "probe",
    "depth",
    "law",
    "elastic",
    "rate",
    "contact",
    "gap",
    "load",
    "sensor",
    "sampling",
)
REPORT, PLAY, FRAME, PROBE, DEPTH, LAW, ELASTIC, RATE, CONTACT, GAP, LOAD, SENSOR, SAMPLING = range(13)

# program: sizes and offsets, where each place's blocks start, then (address, state, parameters) a block
MODES, UNILATERAL, FILM, ONCE, BONDED, INNER, INNER_SIZE, TRIAL, SCRATCH, RELAX, CACHE, STARTS = range(12)
ROWS = STARTS + len(PLACES) + 1

# state: what the solver keeps …
X, Y, CELL, SLOPE, RESIDUAL, TRIAL_CELL = range(6)
OUTER = 6
# … and the pad's own, at INNER and in its trial copies: w_1 … w_r follow, and the blocks' own; then the same once more,
# where a part of the pad stays bonded
FE, PAD_DEPTH, PAD_FORCE, SURFACE, STEEPNESS, RECOVERS, PULLED, W = range(8)


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, int64, float64, float64)")
def chain(program: Ints, params: Doubles, state: Doubles, shift: int, place: int, dt: float, u: float) -> float:
    """The blocks of a place one after the other; state offsets moved by `shift` (a trial copy)."""
    for k in range(program[STARTS + place], program[STARTS + place + 1]):
        row = ROWS + 3 * k
        u = call_block(program[row], dt, u, state, program[row + 1] + shift, params, program[row + 2])
    return u


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, int64, float64, float64)")
def total(program: Ints, params: Doubles, state: Doubles, shift: int, place: int, dt: float, u: float) -> float:
    """Sum of the blocks of a place."""
    result = 0.0
    for k in range(program[STARTS + place], program[STARTS + place + 1]):
        row = ROWS + 3 * k
        result += call_block(program[row], dt, u, state, program[row + 1] + shift, params, program[row + 2])
    return result


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, int64, float64, float64)")
def product(program: Ints, params: Doubles, state: Doubles, shift: int, place: int, dt: float, u: float) -> float:
    """Product of the blocks of a place."""
    result = 1.0
    for k in range(program[STARTS + place], program[STARTS + place + 1]):
        row = ROWS + 3 * k
        result *= call_block(program[row], dt, u, state, program[row + 1] + shift, params, program[row + 2])
    return result
