"""One draw: noise on the simulated pads' force, and every method's fits of it.

The noniterative method has each start run alone, so that it is known where it led; the paper's law for it is (10), and
the truth's own (9) stands beside it, to tell what the law does from what the method does. The fast method has γ from
the ramp on which its assumption holds, and, as `fast, all ramps`, from every rising ramp.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bench import identify
from bench.errors import InputError
from bench.identify.discrete.estimator import Estimator
from bench.identify.discrete.fast import Fast
from bench.identify.discrete.iterative import Iterative
from bench.identify.discrete.iv import Instrumental
from bench.identify.discrete.noniterative import Noniterative, Start
from bench.identify.discrete.series import Data, sampled
from bench.identify.discrete.system import Structure, simulate, values
from bench.identify.laws import Family, exponential, power
from bench.paper.settings import Array, PadName, Settings
from bench.recording.types import Measurement
from sim.elastic import ElasticLaw, Exponential, Power
from sim.transfer import Filter, NotARelaxation, relaxation_of, zero_order_hold

ORDERS = (1, 2, 3, 4)
PADS: tuple[PadName, ...] = ("polyurethane", "silicone")
LAWS = {"exponential": exponential, "power": power}
ALL_RAMPS = "fast, all ramps"
METHODS = ("noniterative", "iterative", "fast", ALL_RAMPS, "iv", "continuous")


@dataclass(frozen=True)
class Fitted:
    """One fit. V in N² on the grid of T; `a`: a_1 … a_r, `b`: b_1 … b_r; `gamma` as in the paper's tables.

    `start`: number and kind of the start of a noniterative search, else -1 and "". `reason`: why the filter is no
    relaxation, empty where it is one. `failed`: why there is no fit; then the numbers are empty. `v`: the discrete
    model's own numbers, to run it again.
    """

    pad: str
    method: str
    law: str
    order: int
    start: int = -1
    kind: str = ""
    V: float = float("inf")
    a: tuple[float, ...] = ()
    b: tuple[float, ...] = ()
    gamma: tuple[float, ...] = ()
    v: tuple[float, ...] = ()
    converged: bool = False
    reason: str = ""
    failed: str = ""

    @property
    def filter(self) -> Filter:
        """B/A of (13)."""
        return Filter((1.0, *self.a), (1.0, *self.b))

    @property
    def elastic(self) -> ElasticLaw:
        """F^e."""
        first, second = self.gamma
        return Power(first * second, second - 1.0) if self.law == "power" else Exponential(first, second)

    @property
    def physical(self) -> bool:
        """Whether the filter is a relaxation."""
        return not self.failed and not self.reason

    def to_json(self) -> dict[str, Any]:
        """As kept in the file of draws; an infinite V has no number there."""
        return asdict(self) | {"V": self.V if np.isfinite(self.V) else None}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Fitted:
        """The way back."""
        lists = {name: tuple(data[name]) for name in ("a", "b", "gamma", "v")}
        return cls(**(data | lists | {"V": float("inf") if data["V"] is None else data["V"]}))


def measured(settings: Settings, pad: PadName, draw: int | None) -> Measurement:
    """The staircase on a pad, with the noise of this draw; None: without noise."""
    time_s, depth_mm = settings.trajectory.sampled(settings.force_spacing_s)
    force = settings.pad(pad).simulate(time_s, depth_mm)
    if draw is not None:
        rng = np.random.default_rng([settings.seed, draw, PADS.index(pad)])
        force = force + settings.noise_N * rng.standard_normal(time_s.size)
    return Measurement(pad, time_s, depth_mm, time_s, force)


def starts_of(settings: Settings, draw: int, order: int, count: int) -> list[tuple[str, Start]]:
    """(kind, filter): relaxations in the first half, real poles and zeros anywhere in (−1, 1) in the second."""
    rng = np.random.default_rng([settings.seed, draw, len(PADS), order])
    T = settings.sample_time_s
    span_s = settings.trajectory.hold_s * len(settings.trajectory.levels_mm)
    out = []
    for i in range(count):
        if i < (count + 1) // 2:
            rates = np.sort(np.exp(rng.uniform(np.log(0.5 / span_s), np.log(0.5 / T), order)))[::-1]
            shares = 0.8 * rng.dirichlet(np.ones(order + 1))[1:]
            filter = zero_order_hold(shares.tolist(), rates.tolist(), T)
            out.append(("relaxation", Start(filter.a[1:], filter.b[1:])))
        else:
            a, b = (np.poly(rng.uniform(-1.0, 1.0, order))[1:].tolist() for _ in range(2))
            out.append(("any", Start(a, b)))
    return out


def fits_of(settings: Settings, draw: int, starts: int) -> Iterator[Fitted]:
    """All fits of one draw."""
    for pad in PADS:
        m = measured(settings, pad, draw)
        data = sampled([m], settings.sample_time_s)
        for order in ORDERS:
            if pad == "polyurethane":
                for law in ("power", "exponential"):
                    for i, (kind, start) in enumerate(starts_of(settings, draw, order, starts)):
                        yield _discrete("noniterative", Noniterative([start]), data, pad, law, order, i, kind)
            for method, scheme in [*_two_steps().items(), ("iv", Instrumental())]:
                yield _discrete(method, scheme, data, pad, "exponential", order)
            if pad == "polyurethane":
                yield _continuous(m, data, pad, order)


def without_noise(settings: Settings) -> tuple[Fitted, ...]:
    """The two-step methods on polyurethane without noise: what they get wrong by themselves."""
    data = sampled([measured(settings, "polyurethane", None)], settings.sample_time_s)
    return tuple(_discrete(method, scheme, data, "polyurethane", "exponential", order)
                 for order in ORDERS for method, scheme in _two_steps().items())  # fmt: skip


def response(data: Data, fitted: Fitted) -> tuple[Array, Array]:
    """Times (K,) in s and the force (K,) in N of a discrete fit on the grid of its data."""
    out = simulate(data.runs[0], _structure(fitted.law, fitted.order), np.array(fitted.v))
    return data.runs[0].time_s, out.force * data.force_N


def _two_steps() -> dict[str, Estimator]:
    return {"iterative": Iterative(), "fast": Fast(), ALL_RAMPS: Fast("all")}


def _family(law: str) -> Family:
    return LAWS[law]()


def _structure(law: str, order: int) -> Structure:
    return Structure(_family(law), order, unilateral=True)


def _discrete(
    method: str, scheme: Estimator, data: Data, pad: str, law: str, order: int, start: int = -1, kind: str = ""
) -> Fitted:
    structure = _structure(law, order)
    try:
        found = scheme.estimate(data, structure)
    except InputError as error:
        return Fitted(pad, method, law, order, start, kind, failed=error.message)
    numbers = values(data, structure, found.v)
    if law == "power":
        gamma = (numbers["p"] / (numbers["q"] + 1.0), numbers["q"] + 1.0)
    else:
        gamma = (numbers["m"], numbers["b"])
    a, b = structure.coefficients(found.v)
    reason = ""
    try:
        relaxation_of(structure.filter(found.v), data.T)
    except NotARelaxation as error:
        reason = error.reason
    V = float(found.V) * data.force_N**2
    return Fitted(pad, method, law, order, start, kind, V, tuple(a.tolist()), tuple(b.tolist()), gamma,
                  tuple(found.v.tolist()), bool(found.converged), reason)  # fmt: skip


def _continuous(m: Measurement, data: Data, pad: str, order: int) -> Fitted:
    """By the continuous method; a and b are the zero-order hold of its relaxation, V is on the others' grid."""
    try:
        fit = identify.fit(m, method="continuous", law="exponential", order=order, contact="unilateral")
    except InputError as error:
        return Fitted(pad, "continuous", "exponential", order, failed=error.message)
    relaxation, elastic = fit.model.pad.relaxation, fit.model.pad.law.parameters
    simulated = Measurement(m.name, m.position_time_s, m.position_mm, fit.time_s, fit.simulated)
    other = sampled([simulated], data.T)
    error_N = data.runs[0].y * data.force_N - other.runs[0].y * other.force_N
    filter = zero_order_hold(relaxation.shares, relaxation.rates, data.T)
    return Fitted(pad, "continuous", "exponential", order, V=float(np.mean(error_N**2)), a=filter.a[1:],
                  b=filter.b[1:], gamma=(elastic["m"], elastic["b"]), converged=fit.converged,
                  reason="" if fit.physical else "its numbers are none of a pad")  # fmt: skip
