"""What a user would otherwise reach for: each tool as its documentation advises, on the same data and start.

All that fit the model of the paper (scipy, lmfit, padbench, the Prony fit) are told the law (exponential) and the
number of modes (two). They are one function each, from a `Training` to a `Fitted`. scipy and lmfit have the same model,
start and bounds; padbench finds its own start.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit
from scipy.signal import lfilter

from bench.identify import fit
from bench.recording.types import Measurement

Array = NDArray[np.float64]

NAMES = ("m", "b", "c_1", "c_2", "nu_1", "nu_2")
LOWER = (1e-3, 1e-3, 0.0, 0.0, 0.01, 0.01)  # N/mm, 1/mm, 1, 1, 1/s, 1/s
UPPER = (1e3, 10.0, 1.0, 1.0, 300.0, 300.0)
GRIDS_S = (0.02, 0.06)  # of SysIdentPy: a grid for the fastest mode, and one that holds less noise


@dataclass(frozen=True)
class Training:
    """What the tools see: evenly spaced times in s, measured depth in mm, measured force in N, whether it lets go."""

    time_s: Array
    depth_mm: Array
    force_N: Array
    lets_go: bool

    @property
    def step_s(self) -> float:
        """Between two samples."""
        return float(self.time_s[1] - self.time_s[0])


@dataclass(frozen=True)
class Fitted:
    """`predict(time_s, depth_mm)`: force in N, from rest. `numbers`: by the names of `NAMES`, empty for a black box."""

    predict: Callable[[Array, Array], Array]
    numbers: dict[str, float]


def plain(lets_go: bool, time_s: Array, depth_mm: Array, *numbers: float) -> Array:
    """The paper's model as one would write it in ten lines: exact for forces that are linear between even samples.

    A pad that lets go shows no pull: the force is cut at 0. That the surface comes back by relaxation is not in it.
    """
    m, b, c_1, c_2, nu_1, nu_2 = numbers
    elastic = m / b * np.expm1(b * np.maximum(depth_mm, 0.0))
    rise = np.diff(elastic, prepend=0.0)
    step = float(time_s[1] - time_s[0])
    force = (1 - c_1 - c_2) * elastic
    for c, nu in ((c_1, nu_1), (c_2, nu_2)):
        x = nu * step
        force = force + c * lfilter([-np.expm1(-x) / x], [1.0, -np.exp(-x)], rise)
    return np.maximum(force, 0.0) if lets_go else force


def start(data: Training) -> list[float]:
    """m and b of the elastic law alone over all data, equal shares, rates a factor of ten apart within the run's times.

    That is what can be told without a fit of the whole: scipy and lmfit both begin here.
    """

    def law(depth: Array, m: float, b: float) -> Array:
        return np.asarray(m / b * np.expm1(b * np.maximum(depth, 0.0)))

    top = float(data.depth_mm.max())
    first = [0.3 * float(data.force_N.max()) / top, 1.0 / top]
    (m, b), _ = curve_fit(law, data.depth_mm, data.force_N, first, bounds=(LOWER[:2], UPPER[:2]), x_scale=first)
    return [float(m), float(b), 0.2, 0.2, 5.0, 0.5]


def by_curve_fit(data: Training) -> Fitted:
    """`scipy.optimize.curve_fit`: start, bounds, and `x_scale`, as it advises for numbers of different size."""
    p0 = np.array(start(data))

    def model(time_s: Array, *numbers: float) -> Array:
        return plain(data.lets_go, time_s, data.depth_mm, *numbers)

    found, _ = curve_fit(model, data.time_s, data.force_N, p0, bounds=(LOWER, UPPER), x_scale=p0)
    return _of_numbers(data, found.tolist())


def by_lmfit(data: Training) -> Fitted:
    """`lmfit.minimize`: bounds on each, c_0 ≥ 0 and ν_1 > ν_2 by expressions, `leastsq`, which it advises first."""
    import lmfit

    p0 = dict(zip(NAMES, start(data), strict=True))
    low, high = dict(zip(NAMES, LOWER, strict=True)), dict(zip(NAMES, UPPER, strict=True))
    P = lmfit.Parameters()
    for name in ("m", "b", "nu_2"):
        P.add(name, p0[name], min=low[name], max=high[name])
    P.add("lost", p0["c_1"] + p0["c_2"], min=0.0, max=1.0)
    P.add("of_first", 0.5, min=0.0, max=1.0)
    P.add("faster", p0["nu_1"] / p0["nu_2"], min=1.0, max=1000.0)
    P.add("c_1", expr="lost * of_first")
    P.add("c_2", expr="lost * (1 - of_first)")
    P.add("nu_1", expr="faster * nu_2")

    def residual(parameters: lmfit.Parameters) -> Array:
        now = [float(parameters[name].value) for name in NAMES]
        return plain(data.lets_go, data.time_s, data.depth_mm, *now) - data.force_N

    found = lmfit.minimize(residual, P, method="leastsq").params
    return _of_numbers(data, [float(found[name].value) for name in NAMES])


def by_prony(data: Training) -> Fitted:
    """The text-book way: law from the first loading ramp, modes from the hold after it, as if the ramp were a step."""
    depth, force, time = data.depth_mm, data.force_N, data.time_s
    top = float(depth.max())
    end = int(np.argmax(depth > 0.995 * top))
    begin = int(np.flatnonzero(depth[:end] <= 0.0)[-1])
    leaves = int(np.argmax(depth[end:] < 0.98 * top)) + end
    u, y = depth[begin : end + 1], force[begin : end + 1]
    t, F = time[end:leaves] - time[end], force[end:leaves]

    def law(x: Array, m: float, b: float) -> Array:
        return np.asarray(m / b * np.expm1(b * np.maximum(x, 0.0)))

    def prony(x: Array, rest: float, f_1: float, f_2: float, nu_1: float, nu_2: float) -> Array:
        return np.asarray(rest + f_1 * np.exp(-nu_1 * x) + f_2 * np.exp(-nu_2 * x))

    peak = float(F[0])
    first = [0.3 * peak / top, 1.0 / top]
    (m, b), _ = curve_fit(law, u, y, first, bounds=(LOWER[:2], UPPER[:2]), x_scale=first)
    p0 = [0.6 * peak, 0.2 * peak, 0.2 * peak, 5.0, 0.5]
    bounds = ([0.0, 0.0, 0.0, 0.01, 0.01], [np.inf, np.inf, np.inf, 300.0, 300.0])
    (rest, f_1, f_2, nu_1, nu_2), _ = curve_fit(prony, t, F, p0, bounds=bounds, x_scale=p0, max_nfev=2000)
    whole = rest + f_1 + f_2
    return _of_numbers(data, [m, b, f_1 / whole, f_2 / whole, nu_1, nu_2])


def by_sysidentpy(data: Training) -> Fitted:
    """SysIdentPy: polynomial NARX by FROLS with its information criterion, run free.

    The care that its guide asks for: data decimated to suit the dynamics, several degrees and lags tried, and the model
    chosen by its free run over the data. Its lags begin at one sample, and a pad answers at once: so the depth is given
    a sample ahead.
    """
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    top, most = float(data.depth_mm.max()), float(data.force_N.max())
    best, grid_s, least = None, GRIDS_S[0], np.inf
    for T in GRIDS_S:
        x, y = _on_grid(data, T, top, most)
        for degree, lag in ((2, 2), (2, 3), (3, 2), (3, 3)):
            model = FROLS(
                order_selection=True,
                n_info_values=20,
                info_criteria="bic",
                xlag=lag,
                ylag=lag,
                estimator=LeastSquares(),
                basis_function=Polynomial(degree=degree),
            )
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # free runs that overflow are what the choice then drops
                model.fit(X=x, y=y)
                error = float(np.mean((_free(model, x) - y[:, 0]) ** 2))
            if error < least or best is None:
                best, grid_s, least = model, T, error

    def predict(time_s: Array, depth_mm: Array) -> Array:
        each = max(1, round(grid_s / float(time_s[1] - time_s[0])))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            free = most * _free(best, _ahead(_averaged(np.maximum(depth_mm, 0.0) / top, each)))
        return np.asarray(np.interp(time_s, _averaged(time_s, each), free))

    return Fitted(predict, {})


def _on_grid(data: Training, T: float, top: float, most: float) -> tuple[Array, Array]:
    every = max(1, round(T / data.step_s))
    depth = _averaged(np.maximum(data.depth_mm, 0.0) / top, every)
    return _ahead(depth), _averaged(data.force_N / most, every)[:, None]


def _ahead(x: Array) -> Array:
    return np.append(x[1:], x[-1])[:, None]


def _free(model: object, x: Array) -> Array:
    """The force from rest, by the model's own output alone; what runs away stays finite."""
    y = model.predict(X=x, y=np.zeros((model.max_lag, 1)))[:, 0]  # type: ignore[attr-defined]
    return np.asarray(np.clip(np.nan_to_num(y, nan=1e3, posinf=1e3, neginf=-1e3), -1e3, 1e3))


def by_padbench(data: Training) -> Fitted:
    """`padbench fit --law exponential --order 2`."""
    return _padbench(data, law="exponential", order=2, contact="unilateral" if data.lets_go else "bonded")


def by_padbench_alone(data: Training) -> Fitted:
    """`padbench fit`: it finds law, order and contact itself."""
    return _padbench(data)


def _padbench(data: Training, **options: object) -> Fitted:
    m = Measurement("data", data.time_s, data.depth_mm, data.time_s, data.force_N)
    result = fit(m, **options)  # type: ignore[arg-type]
    model = result.model
    return Fitted(lambda t, x: model.simulate(t, x), {n: p.value for n, p in result.parameters.items()})


def _of_numbers(data: Training, numbers: list[float]) -> Fitted:
    """A fit of the plain model, modes in the order of the names."""
    m, b, c_1, c_2, nu_1, nu_2 = (float(x) for x in numbers)
    if nu_1 < nu_2:
        c_1, c_2, nu_1, nu_2 = c_2, c_1, nu_2, nu_1
    found = (m, b, c_1, c_2, nu_1, nu_2)
    return Fitted(lambda t, x: plain(data.lets_go, t, x, *found), dict(zip(NAMES, found, strict=True)))


def _averaged(values: Array, every: int) -> Array:
    n = len(values) // every * every
    return np.asarray(values[:n].reshape(-1, every).mean(axis=1))


TOOLS: dict[str, Callable[[Training], Fitted]] = {
    "scipy `curve_fit`": by_curve_fit,
    "lmfit": by_lmfit,
    "Prony, ideal step": by_prony,
    "SysIdentPy": by_sysidentpy,
    "padbench": by_padbench,
    "padbench, nothing given": by_padbench_alone,
}
