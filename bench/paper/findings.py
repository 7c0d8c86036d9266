"""The paper's findings, each tied to its method and figure, as rates over draws and starts.

A finding has one criterion or more; each is a rate that has to reach a share `least`. It comes out where all do, in
part where some do. What is said in words is made from the numbers alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bench.paper.draws import Draw
from bench.paper.experiment import ALL_RAMPS, METHODS, ORDERS, PADS, Fitted, without_noise
from bench.paper.rates import Rate, rate
from bench.paper.settings import Settings
from bench.paper.tables import tables

Verdict = Literal["comes out", "comes out in part", "does not come out", "open: too few draws"]
OCCURS = 0.05
"""Something "occurs" where it does so in this share of cases at least, with 95 % confidence."""


@dataclass(frozen=True)
class Finding:
    """One finding. `main`: (rate, the share it must reach); `more`: further rates; `numbers`: plain sentences."""

    name: str
    where: str
    claim: str
    main: tuple[tuple[Rate, float], ...]
    more: tuple[Rate, ...] = ()
    numbers: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """By the intervals: a criterion is met above its share, missed below it, else open or met in part."""
        states = [_state(r, least) for r, least in self.main]
        if all(state == "met" for state in states):
            return "comes out"
        if all(state == "missed" for state in states):
            return "does not come out"
        if "open" in states and not ("met" in states and ("missed" in states or "part" in states)):
            return "open: too few draws"
        return "comes out in part"

    def to_json(self) -> dict[str, Any]:
        """For findings.json."""
        main = [r.to_json() | {"least": least} for r, least in self.main]
        return {"name": self.name, "where": self.where, "claim": self.claim, "verdict": self.verdict, "criteria": main,
                "more": [r.to_json() for r in self.more], "numbers": list(self.numbers)}  # fmt: skip


def _state(r: Rate, least: float) -> Literal["met", "missed", "part", "open"]:
    if r.low >= least:
        return "met"
    if r.high < min(least, 0.5):
        return "missed"
    return "open" if r.high >= least else "part"


def of(draws: Sequence[Draw], pad: str, method: str, law: str, order: int | None = None) -> Iterator[list[Fitted]]:
    """Of each draw the fits that are meant, the failed ones too."""
    for draw in draws:
        yield [f for f in draw if (f.pad, f.method, f.law) == (pad, method, law) and order in (None, f.order)]


def best(fits: Sequence[Fitted]) -> dict[int, Fitted]:
    """By order the fit with the least V (of the starts, where there are several); failed ones are left out."""
    out: dict[int, Fitted] = {}
    for f in fits:
        if not f.failed and (f.order not in out or out[f.order].V > f.V):
            out[f.order] = f
    return out


def spread(fits: Sequence[Fitted], depths_mm: Sequence[float]) -> float:
    """The largest F^e over the least, minus 1, at the depth where that is most; ∞ with no fit, or one not above 0."""
    if not fits:
        return float("inf")
    force = np.array([f.elastic.force(np.array(depths_mm)) for f in fits])
    low = force.min(axis=0)
    return float(np.max(force.max(axis=0) / low) - 1.0) if np.all(low > 0) else float("inf")


def table_spread(number: str, depths_mm: Sequence[float]) -> float:
    """The same of one of the paper's tables."""
    force = np.array([row.law.force(np.array(depths_mm)) for row in tables()[number].rows])
    return float(np.max(force.max(axis=0) / force.min(axis=0)) - 1.0)


def findings(settings: Settings, draws: Sequence[Draw]) -> list[Finding]:
    """All of them, in the paper's order."""
    return [
        _first_order(settings, draws),
        _minima(settings, draws),
        _wander(settings, draws),
        _satisfactory(settings, draws),
        _agree(settings, draws),
        _silicone(settings, draws),
        _one_iteration(settings, draws),
    ]


def physical_rates(draws: Sequence[Draw]) -> list[tuple[str, str, str, int, Rate]]:
    """(pad, method, law, order, rate) of filters that are relaxations, over all fits that there are."""
    out: list[tuple[str, str, str, int, Rate]] = []
    for pad in PADS:
        for method in METHODS:
            for law in ("power", "exponential"):
                for order in ORDERS:
                    several = list(of(draws, pad, method, law, order))
                    if any(several):
                        label = f"{pad}, {method}, {law}, r = {order}"
                        counted = rate(label, [(sum(f.physical for f in fits), len(fits)) for fits in several])
                        out.append((pad, method, law, order, counted))
    return out


def _first_order(settings: Settings, draws: Sequence[Draw]) -> Finding:
    c = settings.criteria
    main, more, numbers = [], [], []
    for law in ("power", "exponential"):
        tops = [best(fits) for fits in of(draws, "polyurethane", "noniterative", law)]
        worse = _each(f"V at r = 1 is more than {100 * c.too_few:.0f} % above that of the best r, {law} law",
                      [_too_few(top, c.too_few) for top in tops])  # fmt: skip
        plain = _each(f"V at r = 1 is {c.inadequate_V_N2} N² or more, which the paper calls not adequate, {law} law",
                      [c.inadequate_V_N2 <= top[1].V for top in tops if 1 in top])  # fmt: skip
        if law == "power":
            main += [(worse, c.always), (plain, c.always)]
        else:
            more += [worse, plain]
        numbers.append(f"{law} law, median of the least V over that of the noise alone: {_by_order(tops, settings)}.")
    return Finding("noniterative_first_order", "noniterative, Fig. 6, Table I",
                   "A filter of the first order is not adequate for polyurethane.", tuple(main), tuple(more),
                   tuple(numbers))  # fmt: skip


def _minima(settings: Settings, draws: Sequence[Draw]) -> Finding:
    above = settings.criteria.local_minimum

    def ended(law: str, kind: str | None, order: int | None, converged: bool = False) -> list[tuple[int, int]]:
        out = []
        for fits in of(draws, "polyurethane", "noniterative", law):
            top = best(fits)
            meant = [f for f in fits if kind in (None, f.kind) and order in (None, f.order)]
            away = [f for f in meant if f.failed or (1 + above) * top[f.order].V < f.V]
            out.append((sum(f.converged for f in away) if converged else len(away), len(meant)))
        return out

    any_start = [(int(hits > 0), 1) for hits, _ in ended("power", None, None)]
    main = (rate("starts that end elsewhere than the least V (power law, all r)", ended("power", None, None)), OCCURS)
    more = [rate("draws in which some start does (power law)", any_start)]
    for law in ("power", "exponential"):
        more.append(rate(f"starts that converge elsewhere, {law} law", ended(law, None, None, converged=True)))
        for kind, words in (("relaxation", "a relaxation"), ("any", "any filter")):
            more.append(rate(f"starts from {words} that end elsewhere, {law} law", ended(law, kind, None)))
        more += [rate(f"starts that end elsewhere at r = {r}, {law} law", ended(law, None, r)) for r in ORDERS]
    return Finding("noniterative_minima", "noniterative, Fig. 6, r = 3", "The search ends in local minima.", (main,),
                   tuple(more), (f"Elsewhere: V more than {100 * above:.0f} % above the least of the draw's starts. "
                   "A search that was cut off after 200 steps has not converged there.",))  # fmt: skip


def _wander(settings: Settings, draws: Sequence[Draw]) -> Finding:
    depths = settings.criteria.depths_mm
    limit = table_spread("II", depths)
    main, more, numbers = [], [], [f"The paper's own spread in Table I: {100 * table_spread('I', depths):.0f} %."]
    for law in ("power", "exponential"):
        single, tops, spreads = [], [], []
        for fits in of(draws, "polyurethane", "noniterative", law):
            apart = []
            for start in sorted({f.start for f in fits}):
                chosen = [f for f in fits if f.start == start and not f.failed]
                apart.append(spread(chosen, depths) if len(chosen) == len(ORDERS) else float("inf"))
            single.append((sum(s > limit for s in apart), len(apart)))
            tops.append(spread(list(best(fits).values()), depths))
            spreads += apart
        one = rate(f"from one start for each r, {law} law", single)
        all_of_them = _each(f"with the best of all starts for each r, {law} law", [s > limit for s in tops])
        if law == "power":
            main.append((one, settings.criteria.always))
            more.append(all_of_them)
        else:
            more += [one, all_of_them]
        numbers.append(f"{law} law, median spread of Fᵉ over r: {_percent(spreads)} from one start, {_percent(tops)} "
                       "with the best of all.")  # fmt: skip
    return Finding("noniterative_gamma", "noniterative, Table I", f"γ changes with r: Fᵉ differs by more than the "
                   f"{100 * limit:.0f} % of Table II.", tuple(main), tuple(more), tuple(numbers))  # fmt: skip


def _satisfactory(settings: Settings, draws: Sequence[Draw]) -> Finding:
    c = settings.criteria
    tops = [best(fits) for fits in of(draws, "polyurethane", "iterative", "exponential")]
    least = [best(fits) for fits in of(draws, "polyurethane", "noniterative", "exponential")]
    good = _each(f"V is at most {c.satisfactory_V_N2} N² at every r, which the paper calls satisfactory",
                 [len(top) == len(ORDERS) and all(c.satisfactory_V_N2 >= f.V for f in top.values())
                  for top in tops])  # fmt: skip
    near = [(sum(top[r].V <= 1.1 * low[r].V for r in top if r in low), len(top))
            for top, low in zip(tops, least, strict=True)]  # fmt: skip
    numbers = (f"Median V over that of the noise alone: {_by_order(tops, settings)}; the least there is (noniterative, "
               f"same law): {_by_order(least, settings)}.",)  # fmt: skip
    closest = rate("V within 10 % of the least there is", near)
    return Finding("iterative_satisfactory", "iterative, Fig. 7, Table II", "The iterative procedure is satisfactory "
                   "for every r.", ((good, c.always),), (closest,), numbers)  # fmt: skip


def _agree(settings: Settings, draws: Sequence[Draw]) -> Finding:
    depths = settings.criteria.depths_mm
    limit = table_spread("II", depths)
    tops = [best(fits) for fits in of(draws, "polyurethane", "iterative", "exponential")]
    spreads = [spread(list(top.values()), depths) if len(top) == len(ORDERS) else float("inf") for top in tops]
    truth = settings.polyurethane.law.force(np.array(depths))
    numbers = [f"Median spread of Fᵉ over r: {_percent(spreads)} (Table II: {100 * limit:.0f} %)."]
    for depth, force, i in zip(depths, truth, range(len(depths)), strict=True):
        off = [float(f.elastic.force(np.array(depths))[i] / force - 1) for top in tops for f in top.values()]
        numbers.append(f"Fᵉ at {depth:g} mm against the truth, median: {_percent(off, sign=True)}.")
    same = _each("Fᵉ of the four r is within the spread of Table II", [s <= limit for s in spreads])
    return Finding("iterative_gamma", "iterative, Table II", "γ are very similar for every r.",
                   ((same, settings.criteria.always),), (), tuple(numbers))  # fmt: skip


def _silicone(settings: Settings, draws: Sequence[Draw]) -> Finding:
    c = settings.criteria
    tops = [best(fits) for fits in of(draws, "silicone", "iterative", "exponential")]
    good = _each(f"V at r = 1 is at most {c.satisfactory_V_N2} N², which the paper calls satisfactory",
                 [1 in top and c.satisfactory_V_N2 >= top[1].V for top in tops])  # fmt: skip
    enough = _each(f"no r has V more than {100 * c.too_few:.0f} % below r = 1",
                   [1 in top and not _too_few(top, c.too_few) for top in tops])  # fmt: skip
    left = 1e3 * _median([top[1].V ** 0.5 for top in tops if 1 in top])
    numbers = (f"Median V over that of the noise alone: {_by_order(tops, settings)}.",
               f"Median √V at r = 1: {left:.0f} mN.")  # fmt: skip
    return Finding("iterative_silicone", "iterative, Fig. 8", "r = 1 suffices for silicone.",
                   ((good, c.always), (enough, c.always)), (), numbers)  # fmt: skip


def _one_iteration(settings: Settings, draws: Sequence[Draw]) -> Finding:
    c = settings.criteria
    many = [best(fits) for fits in of(draws, "polyurethane", "iterative", "exponential")]
    rates, numbers = [], []
    for method, words in (("fast", "γ from the first ramp"), (ALL_RAMPS, "γ from every rising ramp")):
        tops = [best(fits) for fits in of(draws, "polyurethane", method, "exponential")]
        near = rate(f"V at most {100 * c.one_iteration:.0f} % above that of the iterative method, {words}",
                    [(sum((1 + c.one_iteration) * full[r].V >= top[r].V for r in full if r in top), len(full))
                     for top, full in zip(tops, many, strict=True)])  # fmt: skip
        good = rate(
            f"V at most {c.satisfactory_V_N2} N², {words}",
            [(sum(c.satisfactory_V_N2 >= f.V for f in top.values()), len(ORDERS)) for top in tops],
        )
        rates += [near, good]
        ratios = [top[r].V / full[r].V for top, full in zip(tops, many, strict=True) for r in full if r in top]
        truth = settings.polyurethane.law.force(np.array(c.depths_mm))[-1]
        off = [float(f.elastic.force(np.array(c.depths_mm))[-1] / truth - 1) for top in tops for f in top.values()]
        low, high = np.percentile(off, [5, 95]) if off else (np.nan, np.nan)
        numbers.append(f"{words}: V is {_median(ratios):.2f} times that of the iterative method (median); Fᵉ at "
                       f"{c.depths_mm[-1]:g} mm is off by {_percent(off, sign=True)} (median), from {100 * low:+.0f} "
                       f"to {100 * high:+.0f} % in nine cases of ten.")  # fmt: skip
    quiet = without_noise(settings)
    numbers.append(f"Without any noise √V in mN, at r = 1 to 4: {_quiet(quiet, 'iterative')} by the iterative method; "
                   f"{_quiet(quiet, 'fast')} with γ from the first ramp; {_quiet(quiet, ALL_RAMPS)} with γ from every "
                   "rising ramp.")  # fmt: skip
    first_mm = settings.trajectory.levels_mm[0]
    numbers.append(f"The first ramp ends at {first_mm:g} mm; what its few samples say of Fᵉ deeper is drawn on from "
                   "there. Later ramps begin on a pad that has relaxed, and are no Fᵉ.")  # fmt: skip
    return Finding("fast_one_iteration", "fast, Fig. 9, Table III", "One iteration is enough.",
                   tuple((r, c.always) for r in rates[:2]), tuple(rates[2:]), tuple(numbers))  # fmt: skip


def _quiet(fits: Sequence[Fitted], method: str) -> str:
    """√V in mN of each r. An unstable filter of a pad that can let go ends in no force at all: so V is that of F."""
    return ", ".join(
        f"{1e3 * f.V**0.5:.0f}" + ("" if f.filter.stable else " (unstable)") for f in fits if f.method == method
    )


def _each(label: str, cases: Sequence[bool]) -> Rate:
    return rate(label, [(int(case), 1) for case in cases])


def _too_few(top: dict[int, Fitted], above: float) -> bool:
    return 1 in top and (1 + above) * min(f.V for f in top.values()) < top[1].V


def _by_order(tops: Sequence[dict[int, Fitted]], settings: Settings) -> str:
    parts = []
    for r in ORDERS:
        ratio = _median([top[r].V / settings.noise_V_N2 for top in tops if r in top])
        parts.append(f"{ratio:.3g} at r = {r}")
    return ", ".join(parts)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _percent(values: Sequence[float], sign: bool = False) -> str:
    middle = 100 * _median(values)
    return f"{middle:+.1f} %" if sign else f"{middle:.1f} %"
