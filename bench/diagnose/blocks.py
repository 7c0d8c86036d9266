"""Blocks of samples that stand in for them in a search: as long as no step of force can hide in one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from sim.jit import compiled

if TYPE_CHECKING:
    from .data import Data

Array = NDArray[np.float64]

SHORT = 1500  # samples that need no stand-in
TARGET, MOST = 4000, 6000  # samples of the stand-in, where its blocks can be that long
FASTEST, WIDEST = 0.12, 8.0  # growth of blocks; times what the travel within one may make of force
RESTS = 81  # samples that make a rest
STEP, LOUD = 3, 8.0  # samples within which a force steps, and by how many times its noise at the least
FINELY = 2e-3  # of the travel, that a block spans at the most: in air no stiffness says how finely


def blocks(
    full: Data, stiffness: float, sigma_force: float, jump_mm: float, corners: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """Blocks that cannot hide a step of force, and grow with the time since the speed last changed. `corners` (n,):
    where a planned move changes its acceleration, which a mass or what rings feels at that very time."""
    n = full.size
    if n <= SHORT:
        return np.arange(n)
    travel = float(np.ptp(full.position_mm))
    late = _late_steps(full, stiffness)
    finest = min(sigma_force / max(stiffness, 1e-9), FINELY * travel)
    between = float(np.sqrt(finest * travel))
    rate, wider = 0.05, 1.0
    while True:
        owner = _grouped(full, wider * finest * (rate / 0.05), rate, jump_mm, between, corners, late)
        if owner[-1] < TARGET or (rate > FASTEST and (owner[-1] < MOST or wider >= WIDEST)):
            return owner
        # within a move the force goes nearly straight with the position: wide blocks hide less there than after corners
        rate, wider = (rate, 2.0 * wider) if rate > FASTEST else (1.4 * rate, wider)


def _late_steps(full: Data, stiffness: float) -> NDArray[np.bool_]:
    """Where the force steps though the position does not (n,): a force whose clock is far off answers long after."""
    out = np.zeros(full.size, dtype=bool)
    felt = np.flatnonzero(full.weight > 0)
    if felt.size > 2 * STEP:
        force = median_filter(full.force_N[felt], 2 * STEP - 1, mode="nearest")
        rise_N = np.abs(force[STEP:] - force[:-STEP])
        position = full.position_mm[felt]
        moved_N = stiffness * np.abs(position[STEP:] - position[:-STEP])
        noise_N = full.total_N[felt]
        steps = (rise_N > LOUD * np.maximum(noise_N[STEP:], noise_N[:-STEP])) & (moved_N < 0.5 * rise_N)
        for k in range(STEP + 1):
            out[felt[k : felt.size - STEP + k]] |= steps
    return out


def _grouped(
    full: Data,
    reach: float,
    rate: float,
    jump_mm: float,
    between: float,
    corners: NDArray[np.bool_],
    late: NDArray[np.bool_],
) -> NDArray[np.intp]:
    """`reach`: travel within a block, mm, and `between` where it has no force and is within a sample's time: there no
    more is asked than that a law's bend be met; `rate`: growth of blocks; `jump_mm`: what noise alone makes of a change
    of speed."""
    position = full.position_mm
    step = np.diff(position, prepend=position[0])
    turns = np.zeros(full.size, dtype=bool)
    turns[0] = True
    for k in (1, 3, 9, 27):  # changes of speed over so many samples, but for those that a sharper one makes
        bent = np.abs(position[2 * k :] - 2 * position[k:-k] + position[: -2 * k]) > max(0.5 * reach, jump_mm)
        sharper = np.convolve(turns, np.ones(2 * k + 1), mode="same")[k:-k] > 0.5
        turns[k:-k] |= bent & ~sharper
    turns |= _rests(position, max(0.5 * reach, jump_mm)) | late
    corner = np.flatnonzero(turns)
    index = np.arange(full.size)
    since = index - corner[np.searchsorted(corner, index, side="right") - 1]
    # history is kept apart from what counts; positions between two forces are not
    counting = index >= int(np.argmax(full.weight > 0))
    apart = (np.diff(full.fold, prepend=-1) != 0) | np.diff(counting, prepend=False)
    apart |= corners | np.append(False, corners[:-1])  # each is a block of its own
    piece = np.cumsum(apart).astype(np.int64)
    nodes = np.where(full.weight > 0, -1.0, full.time_s - full.time_s[0])
    away, between = np.cumsum(np.abs(step)), max(between, reach)
    return _cut(away, since.astype(np.float64), nodes, piece, reach, between, rate, full.sample_s)


def _rests(position_mm: Array, still_mm: float) -> NDArray[np.bool_]:
    """Where a motion comes to rest, however gently (n,): from there on a pad relaxes, as after a corner."""
    out = np.zeros(position_mm.size, dtype=bool)
    if position_mm.size > RESTS:
        half, whole = (np.abs(position_mm[k:] - position_mm[:-k])[: out.size - RESTS] for k in (RESTS // 2, RESTS))
        rests = (half < still_mm) & (whole < still_mm)
        out[1 : rests.size] = rests[1:] & ~rests[:-1]
    return out


@compiled("int64[::1](float64[::1], float64[::1], float64[::1], int64[::1], float64, float64, float64, float64)")
def _cut(
    travelled: Array,
    since: Array,
    nodes: Array,
    piece: NDArray[np.int64],
    reach: float,
    between: float,
    rate: float,
    sample: float,
) -> NDArray[np.intp]:
    """The block of each sample; the first sample, a jump from rest, stays alone. `nodes` (n,): times of those without a
    force, −1 for the others; a block of these may go so far `between` two forces, and takes less time than a `sample`;
    but where the speed changes: a force that is late, or a mass, answers to when that was.
    `piece` (n,): no block has samples of two."""
    n = travelled.shape[0]
    owner = np.zeros(n, dtype=np.int64)
    at, block = 1, 1
    while at < n:
        most = max(1, int(rate * since[at]))
        end = at + 1
        while (
            end < n
            and end - at < most
            and piece[end] == piece[at]
            and travelled[end] - travelled[at] <= reach
            and since[end] > 0
        ):
            end += 1
        while (
            nodes[at] >= 0.0
            and since[at] > 0
            and end < n
            and since[end] > 0
            and nodes[end] >= 0.0
            and piece[end] == piece[at]
            and travelled[end] - travelled[at] <= between
            and nodes[end] - nodes[at] < sample
        ):
            end += 1
        for k in range(at, end):
            owner[k] = block
        block += 1
        at = end
    return owner
