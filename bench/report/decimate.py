"""Fewer points, the same picture: thinning of long signals to what a screen can show.

A line over time keeps, in every pixel column, its first, last, lowest and highest sample, which draws the same
pixels as the whole line (the "M4" idea: Jugel et al., VLDB 2014). A curve in the plane (force against indentation)
keeps each way from one pixel to another once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def keep(time_s: Array, value: Array, columns: int) -> NDArray[np.intp]:
    """Indices of the samples that draw the same line as all of them.

    `time_s`, `value`: shape (n,), times increasing. NaN in `value` stays as a break in the line. Returns at most
    about 5 · `columns` indices, increasing; the extremes of `value` are always among them.
    """
    n = time_s.size
    if n <= 4 * columns:
        return np.arange(n)
    span = time_s[-1] - time_s[0]
    scale = columns / span if span > 0 else 0.0
    column = np.minimum(((time_s - time_s[0]) * scale).astype(np.intp), columns - 1)
    finite = np.flatnonzero(np.isfinite(value))
    chosen = [np.array([0, n - 1])]
    if finite.size:
        in_column = column[finite]
        first = np.flatnonzero(np.diff(in_column, prepend=-1))
        last = np.append(first[1:], finite.size) - 1
        by_value = finite[np.lexsort((value[finite], in_column))]
        chosen += [finite[first], finite[last], by_value[first], by_value[last]]
    if finite.size < n:
        broken = ~np.isfinite(value)
        chosen.append(np.flatnonzero(broken & ~np.roll(broken, 1))[: 4 * columns])
    return np.unique(np.concatenate(chosen))


def thin(time_s: Array, value: Array, columns: int) -> tuple[Array, Array]:
    """The line `value` over `time_s` with no more points than `columns` pixel columns need (see `keep`)."""
    index = keep(time_s, value, columns)
    return time_s[index], value[index]


def thin_path(x: Array, y: Array, cell_x: float, cell_y: float) -> tuple[Array, Array]:
    """A curve in the plane, shape (n,) each, drawn once wherever it runs over its own pixels again.

    `cell_x`, `cell_y`: the size of a pixel in the units of x and y. Returns the points with NaN between stretches
    that do not join. Every kept point is a sample, and no sample is further than a pixel from a kept one.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < 3 or cell_x <= 0 or cell_y <= 0:
        return x, y
    cells = np.stack([np.round(x / cell_x), np.round(y / cell_y)], axis=1).astype(np.int64)
    moved = np.flatnonzero(np.any(np.diff(cells, axis=0) != 0, axis=1)) + 1
    at = np.concatenate([[0], moved])
    if at.size < 2:
        return x[at], y[at]
    _, number = np.unique(cells[at], axis=0, return_inverse=True)
    number = number.reshape(-1).astype(np.int64)
    low, high = np.minimum(number[:-1], number[1:]), np.maximum(number[:-1], number[1:])
    _, ways = np.unique(low * (number.max() + 1) + high, return_index=True)
    ways = np.sort(ways)
    starts = np.flatnonzero(np.diff(ways, prepend=-2) != 1)
    pieces_x: list[Array] = []
    pieces_y: list[Array] = []
    for stretch in np.split(ways, starts[1:]):
        points = at[np.append(stretch, stretch[-1] + 1)]
        pieces_x += [x[points], np.array([np.nan])]
        pieces_y += [y[points], np.array([np.nan])]
    return np.concatenate(pieces_x[:-1]), np.concatenate(pieces_y[:-1])
