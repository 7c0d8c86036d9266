"""What a fit is asked for by name: laws, orders, contact; the same words and the same refusals for every method."""

from __future__ import annotations

from collections.abc import Sequence

from bench.errors import InputError

from .laws import Family, exponential, polynomial, power

ORDERS = (1, 2, 3, 4)
MOST_ORDERS = 8
MOST_DEGREE = 8
CONTACTS = ("auto", "bonded", "unilateral")


def families(law: str, degree: int | None, laws: Sequence[str], degrees: Sequence[int]) -> list[Family]:
    """Laws to try; none for `spline`, whose depths come from the data.

    `laws`: names that the method knows beside `auto`; `degrees`: tried where the degree of a polynomial is not given.
    Raises InputError for a law that is not known, and for a degree that does not belong.
    """
    if law not in (*laws, "auto"):
        raise InputError("--law", f"there is no law `{law}` here", f"One of: {', '.join((*laws, 'auto'))}.")
    if degree is not None and not 1 <= degree <= MOST_DEGREE:
        raise InputError("--degree", f"{degree} is no degree of a polynomial to fit", f"From 1 to {MOST_DEGREE}.")
    if degree is not None and law not in ("polynomial", "auto"):
        raise InputError("--degree", f"the {law} law has no degree", "Use it with `--law polynomial`.")
    several = [polynomial(n) for n in ((degree,) if degree else degrees)]
    named = {"exponential": [exponential()], "power": [power()], "polynomial": several, "spline": []}
    return named[law] if law != "auto" else [exponential(), power(), *several]


def orders(order: int | str) -> tuple[int, ...]:
    """Orders to try. Raises InputError for what is no order."""
    if order == "auto":
        return ORDERS
    try:
        r = int(order)
    except ValueError:
        r = 0
    if not 1 <= r <= MOST_ORDERS:
        raise InputError("--order", f"`{order}` is no order", f"`auto`, or a whole number from 1 to {MOST_ORDERS}.")
    return (r,)


def contact_known(contact: str) -> None:
    """Raises InputError for a contact that is not known."""
    if contact not in CONTACTS:
        raise InputError("--contact", f"there is no contact `{contact}`", f"One of: {', '.join(CONTACTS)}.")
