"""The iterative scheme with the refined instrumental variable in place of ARX: consistent under output noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from bench.recording.types import Measurement

from ..result import FitResult
from . import outcome
from .iterative import Instrumental


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
) -> FitResult:
    """Fit one pad by turns of (16) and instrumental variables. `sample_time` T in s (default: from the data)."""
    return outcome.fit(Instrumental(), measurements, law, order, contact, degree, progress, sample_time)
