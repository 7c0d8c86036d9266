"""Touch-off on a pad that pulls the probe in before it touches: adhesion, or charge.

The force falls towards the surface and turns there: level − P s(g) before contact, g the gap, and level − P +
k r^n + k' r^(n+1) in it, r the depth. The pull is one of a few shapes s(g) with s(0) = 1, and stays in contact as it is
at touch (B. V. Derjaguin, V. M. Muller, Yu. P. Toporov, J. Colloid Interface Sci. 53, 1975, 314–326). Each shape, its
range and the exponent are fitted, and all count that fit.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHAPES: tuple[Callable[[Array], Array], ...] = (
    lambda q: np.exp(-q),
    lambda q: 1.0 / (1.0 + q) ** 2,  # of a sphere: J. N. Israelachvili, Intermolecular and Surface Forces, 2011
    lambda q: np.where(q < 1.0, 1.0, 0.0),  # D. S. Dugdale, J. Mech. Phys. Solids 8, 1960, 100–104
)
"""Pull over the gap in units of its range; the last one ends there at once."""

EXPONENTS = (1.0, 1.5, 2.0, 2.5, 3.5)
"""Of first contact, as in `bench.run.touchoff`; with the next term free, those between are near one of these."""

TOGETHER = 5
"""Samples whose mean tells whether the force falls."""

IN_AIR = 40
"""Samples at the begin of an approach that are in air, however soft the pad: a tenth of a millimetre at least."""

PLACES, RANGES, ROUNDS = 33, 9, 4
"""Surfaces and ranges on a grid, and how often it closes in."""

SHORTEST, LONGEST = 0.005, 0.7
"""Ranges, as shares of the approach."""

OFFSETS = np.geomspace(2e-3, 0.2, 7)
"""Surfaces beside the least force that are tried, as shares of the approach."""

UNTOLD = 0.3
"""Of a range at whose end the pull is there at once: so far from touch a pad that is soft at first is felt."""

SUNK = 0.03
"""Of the depth of an approach, that the touch before it may have left: noise alone tells the turn to less than that."""


@dataclass(frozen=True)
class Contact:
    """A fit of the first contact: surface and its standard deviation if noise is all that is left, χ², how many numbers
    were fitted, the exponent, the force at the end, and what is left of the samples (n,)."""

    x0_mm: float
    std_mm: float
    chi2: float
    free: int
    exponent: float
    end_force_N: float
    left_N: Array


def pulls(force_N: Array, least_N: float) -> bool:
    """Whether the force of an approach (n,) falls below that in air before it rises; `least_N`: what one sample must
    fall by to be no noise."""
    if force_N.size < 4 * TOGETHER:
        return False
    smooth = np.convolve(force_N, np.ones(TOGETHER) / TOGETHER, mode="valid")
    air_N = float(np.mean(force_N[: min(force_N.size // 4, IN_AIR)]))
    return bool(air_N - float(smooth.min()) > least_N * np.sqrt(2.0 / TOGETHER))


def contacts_of_a_pull(
    position_mm: Array, force_N: Array, sigma_N: float, fewest: int
) -> Generator[None, None, list[Contact]]:
    """The fits, one for each shape and exponent. Positions and forces (n,), in the order of time; `fewest`: samples in
    contact. Yields often, as whoever has a motor to feed wants it."""
    out = []
    turns = _lowest_and_edge(position_mm, force_N)
    for shape in SHAPES:
        for exponent in EXPONENTS:
            fit = yield from _fit(position_mm, force_N, sigma_N, turns, shape, exponent)
            if fit is not None and np.count_nonzero(position_mm > fit.x0_mm) >= fewest:
                out.append(fit)
    return out


def _fit(
    x: Array,
    force: Array,
    sigma: float,
    turns: tuple[float, float],
    shape: Callable[[Array], Array],
    exponent: float,
) -> Generator[None, None, Contact | None]:
    """The best surface and range of one shape and exponent. `turns`: as `_lowest_and_edge` finds them."""
    (lowest, edge), deepest = turns, float(x.max())
    span = deepest - float(x.min())
    most = deepest - 1e-3 * span
    beside = lowest + span * np.concatenate([-OFFSETS, [0.0], OFFSETS])
    places = np.union1d(np.linspace(float(x.min()), most, PLACES), beside)
    places = places[(places > x.min()) & (places < most)]
    near = span / PLACES
    ends = shape is SHAPES[-1]
    ranges = np.geomspace(SHORTEST * span, LONGEST * span, RANGES)
    best = np.inf, float(places[0]), float(ranges[0]), np.zeros(4)
    for _ in range(ROUNDS):
        for x0 in places.tolist():
            reaches = np.array([max(x0 - edge, 1e-9)]) if ends else ranges
            costs, c = _costs(x, force, x0, reaches, shape, exponent)
            yield
            depth = deepest - x0
            sane = (c[:, 1] > 0) & (c[:, 2] > 0) & (c[:, 2] + c[:, 3] * depth > 0)
            at = int(np.argmin(np.where(sane, costs, np.inf)))
            if sane[at] and costs[at] < best[0]:
                best = float(costs[at]), x0, float(reaches[at]), c[at]
        if not np.isfinite(best[0]):
            return None
        apart = float(ranges[1] / ranges[0])
        places = np.linspace(best[1] - near, best[1] + near, 9)
        places, near = places[places < most], 0.3 * near
        ranges = best[2] * apart ** np.linspace(-1.0, 1.0, 5)
    _, x0, reach, c = best
    basis = _basis(x, x0, reach, shape, exponent)
    left = force - basis @ c
    step, ratio = 1e-3 * span, 1.02
    by_place = (_basis(x, x0 + step, reach, shape, exponent) - _basis(x, x0 - step, reach, shape, exponent)) @ c
    by_range = (_basis(x, x0, reach * ratio, shape, exponent) - _basis(x, x0, reach / ratio, shape, exponent)) @ c
    jacobian = np.column_stack([basis, by_range, by_place / (2.0 * step)])
    scale = np.maximum(np.abs(jacobian).max(axis=0), 1e-300)
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) * sigma**2
    std = float(np.sqrt(max(covariance[-1, -1], 0.0))) / scale[-1]
    depth = deepest - x0
    std = float(np.hypot(std, SUNK * depth))
    if ends:
        std = float(np.hypot(std, UNTOLD * (x0 - edge)))
    rise = float(c[2] * depth**exponent + c[3] * depth ** (exponent + 1.0))
    return Contact(x0, std, float(left @ left) / sigma**2, jacobian.shape[1], exponent, rise, left)


def _lowest_and_edge(x: Array, force: Array) -> tuple[float, float]:
    """Where the force is least, and where it falls the most within a few samples, mm."""
    kernel = np.ones(TOGETHER) / TOGETHER
    smooth = np.convolve(force, kernel, mode="valid")
    fall = smooth[TOGETHER:] - smooth[:-TOGETHER]
    at = int(np.argmin(fall)) + TOGETHER
    return float(x[int(np.argmin(smooth)) + TOGETHER // 2]), 0.5 * float(x[at - 1] + x[at])


def _basis(x: Array, x0: float, reach: float, shape: Callable[[Array], Array], exponent: float) -> Array:
    """Columns of the level, the pull P, k and k' (n, 4)."""
    r = np.maximum(x - x0, 0.0)
    rise = r**exponent
    return np.column_stack([np.ones_like(x), -shape(np.maximum(x0 - x, 0.0) / reach), rise, rise * r])


def _costs(
    x: Array, force: Array, x0: float, reaches: Array, shape: Callable[[Array], Array], exponent: float
) -> tuple[Array, Array]:
    """Sums of squares (m,) and coefficients as of `_basis` (m, 4) of one surface and ranges of the pull (m,)."""
    r = np.maximum(x - x0, 0.0)
    rise = r**exponent
    fixed = np.vstack([np.ones_like(x), rise, rise * r])
    pull = -shape(np.maximum(x0 - x, 0.0) / reaches[:, None])
    normal = np.empty((reaches.size, 4, 4))
    others = np.array([0, 2, 3])
    normal[:, others[:, None], others] = fixed @ fixed.T
    normal[:, 1, others] = normal[:, others, 1] = pull @ fixed.T
    normal[:, 1, 1] = (pull * pull).sum(axis=1)
    right = np.empty((reaches.size, 4))
    right[:, others], right[:, 1] = fixed @ force, pull @ force
    scale = np.maximum(np.sqrt(np.einsum("mii->mi", normal)), 1e-300)
    unit = normal / (scale[:, :, None] * scale[:, None, :]) + 1e-12 * np.eye(4)
    c = np.linalg.solve(unit, (right / scale)[..., None])[..., 0] / scale
    return np.asarray(force @ force - (c * right).sum(axis=1)), np.asarray(c)
