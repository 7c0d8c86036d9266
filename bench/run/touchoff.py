"""Where does the pad begin? The surface, extrapolated from a slow approach, with its uncertainty.

Near first contact every elastic law looks like F = k (x − x0)^n with n between 1 (exponential law, flat punch) and
3.5 (steep power laws), bent a little by its next term and by relaxation; a few hundredths of a newton cannot tell
which. So each exponent is fitted, with a free next term k' (x − x0)^(n+1), and the surface is the average over them
weighted by how well they fit: the doubt about the law is part of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pull import Contact, contacts_of_a_pull, pulls

Array = NDArray[np.float64]

EXPONENTS = (1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.5)
"""Exponents n of first contact: 1 flat punch or exponential law (9), 1.5 sphere (Hertz), 2 cone, 2.5 power law."""

SIGMAS = 5.0
"""A touch must stand so many standard deviations of the air noise above the air level."""

MIN_SAMPLES_IN_CONTACT = 4


@dataclass(frozen=True)
class Air:
    """The load cell in free air: `mean_N`, `sigma_N` (one sample, trend removed), `drift_N_s`; `moving_N`: by how much
    more it reads on the way to the pad, where friction is felt; `turns_N`: what it changes by where motion turns."""

    mean_N: float
    sigma_N: float
    drift_N_s: float
    samples: int
    moving_N: float = 0.0
    turns_N: float = 0.0


@dataclass(frozen=True)
class Surface:
    """The pad's surface in the motor frame and one standard deviation of it, mm.

    `exponent` is the best-fitting n of first contact, `stiffness_N_mm` the secant stiffness of the approach's end.
    """

    position_mm: float
    std_mm: float
    exponent: float
    stiffness_N_mm: float


def air_of(time_s: Array, force_N: Array) -> Air:
    """Level, noise and drift of force samples taken in air, both of shape (n,), n >= 8.

    The noise is the spread about a straight line, by the median (1.4826 MAD), so that one bad sample does not count,
    but never less than what quantisation leaves (step / sqrt 12).
    """
    t = time_s - time_s.mean()
    slope, level = np.polyfit(t, force_N, 1)
    rest = force_N - (level + slope * t)
    sigma = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    values = np.unique(force_N)
    step = float(np.diff(values).min()) if values.size > 1 else 0.0
    return Air(
        mean_N=float(level),
        sigma_N=max(sigma, step / np.sqrt(12.0)),
        drift_N_s=float(slope),
        samples=int(force_N.size),
    )


def unsteady_N(force_N: Array) -> float:
    """So far the force may wander through a tare by noise and digits alone; samples of shape (n,), n >= 8.

    By what it changes from sample to sample, so that a jump or a drift does not count as the noise that excuses it.
    """
    steps = np.abs(np.diff(force_N))
    digit = float(steps[steps > 0].min()) if steps.any() else 0.0
    return max(SIGMAS * float(steps.mean()) * float(np.sqrt(np.pi)) / 2.0, 2.0 * digit)


def threshold_N(asked_N: float, air: Air) -> float:
    """The force that counts as contact: what the protocol asks, but at least five sigma of the air noise; either beyond
    what friction makes of the way there."""
    return air.moving_N + max(asked_N, SIGMAS * air.sigma_N)


def turned(force_N: Array, air: Air) -> int:
    """The first sample of an approach (n,) at which friction has turned round, as a servo that settles lets go of it:
    three in a row are no more below the level that the first quarter has. 0 where no friction shows."""
    early = force_N[: force_N.size // 4]
    if air.turns_N <= 0.0 or early.size < 8:
        return 0
    up = early >= np.median(early) - 2.0 * air.sigma_N
    return int(np.argmax(up[:-2] & up[1:-1] & up[2:]))


def find_surface(position_mm: Array, force_N: Array, sigma_N: float, position_sigma_mm: float = 0.0) -> Surface | None:
    """The surface from one approach, at once (see `surface_in_pieces`)."""
    pieces = surface_in_pieces(position_mm, force_N, sigma_N, position_sigma_mm)
    while True:
        try:
            next(pieces)
        except StopIteration as end:
            found: Surface | None = end.value
            return found


def surface_in_pieces(
    position_mm: Array, force_N: Array, sigma_N: float, position_sigma_mm: float = 0.0
) -> Generator[None, None, Surface | None]:
    """The surface from one approach: positions and net forces of shape (n,), in the order of time.

    Yields after every half millisecond or so of computing: whoever has a motor to feed meanwhile, feeds it.

    The part in air fixes the level (a constant, so that what drifted since the tare does not move the surface), the
    part in contact the rise. Where the force falls before it rises the pad pulls: `bench.run.pull`. Returns None when
    too little of the approach was in contact to say.
    `position_sigma_mm` (encoder noise, jitter of stamps) adds to the result's standard deviation.
    """
    sigma = max(sigma_N, 1e-12)
    if not np.ptp(position_mm) > 0.0:
        return None
    fits: list[Contact] = []
    for n in EXPONENTS:
        fit = yield from _fit_exponent(position_mm, force_N, sigma, n)
        if fit is not None:
            fits.append(fit)
    if pulls(force_N, SIGMAS * sigma):
        fits += yield from contacts_of_a_pull(position_mm, force_N, sigma, MIN_SAMPLES_IN_CONTACT)
    # whoever never felt the pad has no surface to tell
    fits = [fit for fit in fits if fit.end_force_N > SIGMAS * sigma]
    if not fits:
        return None
    lost = np.array([fit.chi2 + 2.0 * fit.free for fit in fits])
    top = fits[int(np.argmin(lost))]
    astray = _astray(top)
    weight = np.exp(-0.5 * (lost - lost.min()) / astray)
    weight /= weight.sum()
    x0 = np.array([fit.x0_mm for fit in fits])
    mean = float(weight @ x0)
    within = np.ptp(position_mm) ** 2 / 12.0  # where the data say nothing: anywhere there alike
    own = np.minimum(np.array([fit.std_mm for fit in fits]) ** 2 * astray, within)
    variance = float(weight @ (own + (x0 - mean) ** 2))
    depth = float(position_mm.max() - mean)
    return Surface(
        position_mm=mean,
        std_mm=float(np.sqrt(variance + position_sigma_mm**2)),
        exponent=top.exponent,
        stiffness_N_mm=top.end_force_N / depth if depth > 0 else float("nan"),
    )


def warm_up() -> None:
    """Have the numerical library set itself up now: the first call of its kind takes a stopping distance's time."""
    x = np.linspace(0.0, 1.0, 50)
    air_of(x, np.sin(50.0 * x))
    find_surface(x, np.maximum(x - 0.5, 0.0), 1e-3)


def _fit_exponent(x: Array, force: Array, sigma: float, exponent: float) -> Generator[None, None, Contact | None]:
    """Least squares of level + k r^n + k' r^(n+1), r = max(0, x − x0): x0 by a grid that closes in, the rest linear."""
    span = float(x.max() - x.min())
    lo, hi = float(x.min()), float(x.max()) - 1e-6 * span
    for _ in range(4):
        grid = np.linspace(lo, hi, 41)
        best = int(np.argmin(_costs(x, force, grid, exponent)))
        yield
        lo, hi = grid[max(best - 2, 0)], grid[min(best + 2, grid.size - 1)]
    x0 = float(grid[best])
    if (x > x0).sum() < MIN_SAMPLES_IN_CONTACT:
        return None
    chi2, (_, gain, bend), left = _cost(x, force, x0, exponent)
    depth = float(x.max()) - x0
    if gain <= 0 or gain + bend * depth <= 0:
        return None
    # Standard deviation from the Gauss-Newton normal matrix of (level, k, k', x0).
    r = np.maximum(x - x0, 0.0)
    inside = np.maximum(r, 1e-6 * span)
    slope = np.where(r > 0, inside ** (exponent - 1.0) * (gain * exponent + bend * (exponent + 1.0) * inside), 0.0)
    jacobian = np.column_stack([np.ones_like(x), r**exponent, r ** (exponent + 1.0), -slope])
    scale = np.maximum(np.abs(jacobian).max(axis=0), 1e-300)
    normal = (jacobian / scale).T @ (jacobian / scale)
    try:
        covariance = np.linalg.inv(normal) * sigma**2
    except np.linalg.LinAlgError:
        return None
    std = float(np.sqrt(max(covariance[3, 3], 0.0))) / scale[3]
    end_force_N = gain * depth**exponent + bend * depth ** (exponent + 1.0)
    return Contact(x0, std, chi2 / sigma**2, 4, exponent, end_force_N, left)


def _astray(fit: Contact) -> float:
    """What the samples weigh less for what no fit meets (cogging, friction that turns round), a factor on variances: it
    counts as noise that stays for as many samples as it is alike. 1 where noise is all that is left."""
    n = fit.left_N.size
    power = np.abs(np.fft.rfft(fit.left_N, 2 * n)) ** 2
    alike = np.fft.irfft(power)[:n]
    turns = np.flatnonzero(alike < 0.0)
    until = int(turns[0]) if turns.size else n
    stays = max(1.0, 2.0 * float(alike[:until].sum() / alike[0]) - 1.0) if alike[0] > 0 else 1.0
    return max(fit.chi2 / max(n - fit.free, 1) * stays, 1.0)


def _costs(x: Array, force: Array, x0: Array, exponent: float) -> Array:
    """Sums of squares left by the best level, k and k' for each surface of x0 (m,); shape of x and force (n,)."""
    r = np.maximum(x - x0[:, None], 0.0) / np.ptp(x)
    a = r**exponent
    b = a * r
    a -= a.mean(axis=1, keepdims=True)
    b -= b.mean(axis=1, keepdims=True)
    f = force - force.mean()
    aa, ab, bb = (a * a).sum(axis=1), (a * b).sum(axis=1), (b * b).sum(axis=1)
    af, bf = a @ f, b @ f
    det = aa * bb - ab * ab
    # Where too little is in contact for both of them, one has to do; where nothing is, none.
    both = det > 1e-12 * aa * bb
    one = np.divide(af * af, aa, out=np.zeros_like(aa), where=aa > 0)
    two = np.divide(bb * af * af - 2 * ab * af * bf + aa * bf * bf, det, out=np.zeros_like(aa), where=both)
    return np.asarray(f @ f - np.where(both, two, one))


def _cost(x: Array, force: Array, x0: float, exponent: float) -> tuple[float, Array, Array]:
    """Sum of squares, the linear coefficients (level, k, k'), and what is left; shape of x and force (n,)."""
    r = np.maximum(x - x0, 0.0)
    basis = np.column_stack([np.ones_like(x), r**exponent, r ** (exponent + 1.0)])
    coefficients, *_ = np.linalg.lstsq(basis, force, rcond=None)
    rest = force - basis @ coefficients
    return float(rest @ rest), np.asarray(coefficients, dtype=np.float64), rest
