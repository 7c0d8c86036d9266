"""From a digital filter back to the shares and rates of a relaxation, or the reason why it is none.

A filter is a reduced relaxation if and only if its step response B/(A(1 − z⁻¹)) = Σ k_i/(1 − p_i z⁻¹) has only simple
real poles: z = 1 with c_0 ≥ 0, and p_i in (0, 1) with c_i > 0. Then ν_i = −ln p_i/T, and c_i = k_i for the zero-order
hold, k_i/φ_i for the ramp. That is a statement about the *response*: a pole that a zero cancels is not in it.

Coefficients are numbers with 16 digits, so each of these is decided to what those digits can tell. A residue below
`tolerance` and its own rounding is none; poles nearer to each other than their rounding are one, if a single mode in
their place gives the same frequency response.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sim.digital import Array, Filter, roots
from sim.kernel import ramp_gain

Hold = Literal["zero_order", "ramp"]
"""What the elastic force does between samples: stands still, or is linear."""

TOLERANCE = 1e-9
"""Share of a step's force below which a difference counts as none."""

OPEN = 1e-2
"""Where the digits of the coefficients leave more than this of the shares open, nothing is said of them."""

_ROUNDING = 16 * float(np.finfo(np.float64).eps)


class NotARelaxation(ValueError):
    """The filter is no reduced relaxation. `reasons` are sentences, one a fault; `reason` is all of them."""

    def __init__(self, reasons: tuple[str, ...]) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons

    @property
    def reason(self) -> str:
        """Why, in words."""
        return str(self)


@dataclass(frozen=True)
class _Mode:
    """One term k/(1 − p z⁻¹) of the step response; `less` = 1 − p, `doubt` the rounding of k."""

    pole: complex
    less: float
    share: float
    doubt: float


def relaxation_of(
    filter: Filter, T: float, hold: Hold = "zero_order", *, tolerance: float = TOLERANCE
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Shares and rates (1/s), rates descending, of the relaxation that `filter` samples every T seconds.

    `hold` is what the elastic force does between samples; T = 1 gives rates per sample. Raises NotARelaxation, and
    ValueError for a T that is no time.
    """
    if not (math.isfinite(T) and T > 0.0):
        raise ValueError(f"the sample time must be a finite number of seconds above 0, not {T:g}")
    if hold not in ("zero_order", "ramp"):
        raise ValueError(f"no hold {hold!r}; there are 'zero_order' and 'ramp'")
    c_0, modes, doubt = _step_response(filter, tolerance)
    if doubt > max(OPEN, tolerance):
        words = f"the digits of its coefficients leave its shares open by {doubt:.2g}"
        raise NotARelaxation((f"{words}: the poles crowd together, and a longer sample time would set them apart",))
    reasons = [reason for mode in modes if (reason := _fault(mode, tolerance))]
    if c_0.share < -tolerance - c_0.doubt:
        reasons.append(f"a held force would end below 0 (static gain {c_0.share:.4g})")
    elif c_0.share > filter.b[0] + tolerance + c_0.doubt:
        reasons.append(f"a held force would grow in the end (static gain {c_0.share:.4g}, at first {filter.b[0]:.4g})")
    if reasons:
        raise NotARelaxation(tuple(reasons))
    found = sorted((_mode(mode, T, hold) for mode in modes), key=lambda pair: -pair[1])
    shares, rates = tuple(share for share, _ in found), tuple(rate for _, rate in found)
    start = math.fsum((c_0.share, *shares))
    if abs(start - 1.0) > tolerance + doubt:
        raise NotARelaxation(
            (f"its response to a step starts at {start:.6g}, not at 1: divide b by that, and multiply F^e by it",)
        )
    return shares, rates


def is_relaxation(filter: Filter, T: float = 1.0, hold: Hold = "zero_order", *, tolerance: float = TOLERANCE) -> bool:
    """Whether `relaxation_of` finds one."""
    try:
        relaxation_of(filter, T, hold, tolerance=tolerance)
    except NotARelaxation:
        return False
    return True


def _mode(mode: _Mode, T: float, hold: str) -> tuple[float, float]:
    x = -math.log1p(-mode.less) if mode.less < 0.5 else -math.log(mode.pole.real)
    return (mode.share / ramp_gain.python(x) if hold == "ramp" else mode.share), x / T


def _fault(mode: _Mode, tolerance: float) -> str:
    p = mode.pole
    size = abs(p)
    if p.imag != 0.0:
        if p.imag < 0.0:
            return ""  # said with the other of the pair
        grows = ", and grow" if size >= 1.0 else ""
        return f"the poles {p.real:.4g} ± {p.imag:.4g}j are complex: a held force would oscillate{grows}"
    if p.real < 0.0:
        grows = ", and grow (it lies outside the unit circle: unstable)" if size >= 1.0 else ""
        return f"the pole {p.real:.4g} is negative: a held force would change sides every sample{grows}"
    if p.real == 0.0:
        return "a pole lies at 0: part of the response would end after some samples"
    if p.real >= 1.0:
        return f"the pole {p.real:.6g} lies outside the unit circle: a held force would grow without end"
    if mode.share < 0.0:
        return f"the mode at the pole {p.real:.4g} has the share {mode.share:.4g}: it would make a held force rise"
    return ""


def _step_response(filter: Filter, tolerance: float) -> tuple[_Mode, list[_Mode], float]:
    """The term at z = 1, the others that are there, and all that rounding leaves open of the shares.

    Raises NotARelaxation where the step response is no such sum.
    """
    a, b = np.trim_zeros(np.array(filter.a), "b"), np.trim_zeros(np.array(filter.b), "b")
    if b.size > a.size:
        extra = f"l = {b.size - 1} is more than r = {a.size - 1}"
        raise NotARelaxation((f"B is of higher degree than A ({extra}): part of the response would end abruptly",))
    b = np.append(b, np.zeros(a.size - b.size))
    poles = np.append(roots(tuple(a)), np.clongdouble(1.0))  # the step's own pole is the last
    groups = _groups(poles, a)
    if all(len(group) == 1 for group in groups):
        modes = [_residue(poles, i, a, b) for i in range(poles.size)]
        last = poles.size - 1
    else:
        modes, last = _merged(poles, groups, a, b, tolerance)
    kept = [m for i, m in enumerate(modes) if i != last and abs(m.share) > tolerance + m.doubt]
    return modes[last], kept, math.fsum(mode.doubt for mode in modes)


def _residue(poles: NDArray[Any], i: int, a: Array, b: Array) -> _Mode:
    """k_i = B(p) pʳ/Π (p − p_j), and what the rounding of a and b leaves open of it."""
    p, others = poles[i], np.delete(poles, i)
    spread = p - others
    below = np.prod(spread)
    k = np.polyval(b.astype(np.clongdouble), p) / below
    rounding = _ROUNDING * float(np.polyval(np.abs(b), abs(p)) / abs(below))
    if i < poles.size - 1:  # the pole moves with a; that at 1 does not
        moved = _ROUNDING * float(np.polyval(np.abs(a), abs(p)) * abs(p - 1.0) / abs(below))
        slope = np.polyval(np.polyder(b.astype(np.clongdouble)), p) / below - k * np.sum(1.0 / spread)
        rounding += moved * float(abs(slope))
    else:
        rounding += _ROUNDING * float(abs(k) * np.sum(np.abs(a)) / abs(below))
    share = float(k.real) if p.imag == 0.0 else float(abs(k))
    return _Mode(complex(p), float(1.0 - p.real), share, rounding)


def _groups(poles: NDArray[Any], a: Array) -> list[list[int]]:
    """Poles that the digits of `a` cannot tell apart, nearest first: d^m Π |p − p_j| within rounding of A(p)."""
    groups = [[i] for i in range(poles.size)]
    pairs = [(float(abs(poles[i] - poles[j])), i, j) for i in range(poles.size) for j in range(i)]
    for distance, i, j in sorted(pairs):
        one = next(group for group in groups if i in group)
        two = next(group for group in groups if j in group)
        if one is two:
            continue
        members = one + two
        middle = np.mean(poles[members])
        outside = np.abs(poles[members][:, None] - np.delete(poles, members)).max(axis=0)
        size = float(np.polyval(np.abs(a), abs(middle)) * max(float(abs(middle - 1.0)), _ROUNDING))
        if poles.size - 1 in members:  # the step's pole is exact; the others are as far from it as A's rounding
            size = float(np.sum(np.abs(a))) * distance
        if distance ** len(members) * float(np.prod(outside)) <= _ROUNDING * size:
            groups = [group for group in groups if group is not one and group is not two] + [members]
    return groups


def _merged(
    poles: NDArray[Any], groups: list[list[int]], a: Array, b: Array, tolerance: float
) -> tuple[list[_Mode], int]:
    """One mode a group, fitted to the frequency response, which must then agree."""
    last = poles.size - 1
    at_one = next(n for n, group in enumerate(groups) if last in group)
    centres = np.array([complex(np.mean(poles[group])) for group in groups])
    real = [_is_real(centre, poles[group]) for centre, group in zip(centres, groups, strict=True)]
    centres = np.where(real, centres.real, centres)
    centres[at_one] = 1.0

    slowest = np.abs(1.0 - np.delete(centres, at_one)).min(initial=1.0)
    back = np.exp(-1j * np.geomspace(min(0.01 * slowest, 0.1), math.pi, 60 + 40 * poles.size))
    above, below = np.polyval(b[::-1], back), np.polyval(a[::-1], back)
    response = above / below
    doubt = tolerance + _ROUNDING * (np.abs(b).sum() + np.abs(response) * np.abs(a).sum()) / np.abs(below)
    moving = np.array([n != at_one and len(group) > 1 for n, group in enumerate(groups)])
    shares = np.zeros(centres.size, dtype=np.complex128)
    for turn in range(6):  # the middle of a group is a first guess: a mode's pole follows the larger share
        columns = (1.0 - back)[:, None] / (1.0 - centres[None, :] * back[:, None])
        columns[:, at_one] = 1.0
        shares = np.linalg.lstsq(columns / doubt[:, None], response / doubt, rcond=None)[0]
        error = response - columns @ shares
        if turn == 5 or not moving.any():
            break
        turns = columns[:, moving] * shares[moving] * back[:, None] / (1.0 - centres[moving] * back[:, None])
        both = np.hstack([columns, turns]) / doubt[:, None]
        step = np.linalg.lstsq(both, error / doubt, rcond=None)[0][centres.size :]
        step = np.where(np.abs(step) < 0.1 * np.abs(1.0 - centres[moving]), step, 0.0)
        centres[moving] += np.where(np.array(real)[moving], step.real, step)
    if np.any(np.abs(error) > doubt):
        raise NotARelaxation((_multiple(max(groups, key=len), poles),))
    return [_merged_mode(p, k, float(doubt.max())) for p, k in zip(centres, shares, strict=True)], at_one


def _merged_mode(pole: complex, k: complex, doubt: float) -> _Mode:
    share = float(k.real) if pole.imag == 0.0 else float(abs(k))
    return _Mode(complex(pole), float(1.0 - pole.real), share, doubt)


def _multiple(group: list[int], poles: NDArray[Any]) -> str:
    if poles.size - 1 in group:
        return "a pole lies at 1, or too near to tell: a held force would grow without end"
    where = complex(np.mean(poles[group]))
    words = f"{where.real:.4g}" if abs(where.imag) < 1e-6 else f"{where.real:.4g} ± {abs(where.imag):.4g}j"
    return f"{len(group)} poles coincide at {words}: the response is no sum of exponentials"


def _is_real(centre: complex, members: NDArray[Any]) -> bool:
    """A real pole, or a group that its own width makes real."""
    return abs(centre.imag) <= float(np.abs(members - np.mean(members)).max())
