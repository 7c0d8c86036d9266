"""What a discrete fit is asked for: laws, orders, contact."""

from __future__ import annotations

import numpy as np

from bench.errors import InputError

from .. import asked
from ..laws import Family
from ..noise import noise_of
from .series import Data

LAWS = ("exponential", "power", "polynomial")
DEGREES = (2, 3)
PULLS = 0.03  # of the largest force: a pull beyond it is a bonded pad's


def families(law: str, degree: int | None) -> list[Family]:
    """Laws to try. Raises InputError for one that is not known, and for a degree that does not belong."""
    if law == "spline":
        raise InputError(
            "--law",
            "a spline has more numbers than these methods can tell from their filter: they take the paper's laws",
            f"One of: {', '.join((*LAWS, 'auto'))}; `spline` goes with `--method continuous`.",
        )
    return asked.families(law, degree, LAWS, DEGREES)


def unilateral(data: Data, contact: str) -> bool:
    """Whether the pad may let go. `auto`: unless the force shows it pulling, plainly and more than once."""
    asked.contact_known(contact)
    if contact != "auto":
        return contact == "unilateral"
    noise = noise_of(data.on_grid()).force_N / data.force_N
    level = -max(8 * noise, PULLS)
    return int(sum(np.count_nonzero((run.y < level) & (run.weight > 0)) for run in data.runs)) < 3
