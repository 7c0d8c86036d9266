"""What a discrete fit is asked for: laws, orders, contact."""

from __future__ import annotations

import numpy as np

from bench.errors import InputError

from ..laws import Family, exponential, polynomial, power
from ..noise import noise_of
from .series import Data

LAWS = ("exponential", "power", "polynomial")
ORDERS = (1, 2, 3, 4)
DEGREES = (2, 3)
MOST_ORDER = 8
PULLS = 0.03  # of the largest force: a pull beyond it is a bonded pad's


def families(law: str, degree: int | None) -> list[Family]:
    """Laws to try. Raises InputError for one that is not known, and for a degree that does not belong."""
    if law == "spline":
        raise InputError(
            "--law",
            "a spline has more numbers than these methods can tell from their filter: they take the paper's laws",
            f"One of: {', '.join((*LAWS, 'auto'))}; `spline` goes with `--method continuous`.",
        )
    if law not in (*LAWS, "auto"):
        raise InputError("--law", f"there is no law `{law}`", f"One of: {', '.join((*LAWS, 'auto'))}.")
    if degree is not None and not 1 <= degree <= 8:
        raise InputError("--degree", f"{degree} is no degree of a polynomial to fit", "From 1 to 8.")
    if degree is not None and law not in ("polynomial", "auto"):
        raise InputError("--degree", f"the {law} law has no degree", "Use it with `--law polynomial`.")
    several = [polynomial(n) for n in ((degree,) if degree else DEGREES)]
    named = {"exponential": [exponential()], "power": [power()], "polynomial": several}
    return named[law] if law != "auto" else [exponential(), power(), *several]


def orders(order: int | str) -> tuple[int, ...]:
    """Orders to try."""
    if order == "auto":
        return ORDERS
    try:
        r = int(order)
    except ValueError:
        r = 0
    if not 1 <= r <= MOST_ORDER:
        raise InputError("--order", f"`{order}` is no order", f"`auto`, or a whole number from 1 to {MOST_ORDER}.")
    return (r,)


def unilateral(data: Data, contact: str) -> bool:
    """Whether the pad may let go. `auto`: unless the force shows it pulling, plainly and more than once."""
    if contact not in ("auto", "bonded", "unilateral"):
        raise InputError("--contact", f"there is no contact `{contact}`", "One of: auto, bonded, unilateral.")
    if contact != "auto":
        return contact == "unilateral"
    noise = noise_of(data.on_grid()).force_N / data.force_N
    level = -max(8 * noise, PULLS)
    return int(sum(np.count_nonzero((run.y < level) & (run.weight > 0)) for run in data.runs)) < 3
