"""One measured file diagnosed: the best plain law, the diagnosis of it, and what both predict of data held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.diagnose import Diagnosis, diagnose
from bench.errors import PadbenchError
from bench.identify import FitResult, fit
from bench.like import likeness
from bench.recording.types import Measurement
from docs.real_cases import Case
from sim.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Held:
    """A run or the end of a file, predicted: RMS errors in N over the samples that count; curves (m,) for a picture."""

    name: str
    plain_N: float
    extended_N: float
    time_s: Array
    position_mm: Array
    force_N: Array
    by_plain_N: Array
    by_extended_N: Array
    counted: NDArray[np.bool_]

    @property
    def gain(self) -> float:
        """Share by which the error has become smaller; negative: a loss."""
        return 1.0 - self.extended_N / self.plain_N


@dataclass(frozen=True)
class Outcome:
    """A file: its fit, its diagnosis, what was held out; or why there is none."""

    folder: str
    name: str
    fit: FitResult | None = None
    diagnosis: Diagnosis | None = None
    held: tuple[Held, ...] = ()
    refusal: str = ""
    notes: tuple[str, ...] = ()
    """What the reading did to the data."""

    @property
    def gain(self) -> float:
        """Of the mean square over all that was held out, as a share of the RMS error; nan without any."""
        if not self.held:
            return float("nan")
        plain, extended = ([h.plain_N for h in self.held], [h.extended_N for h in self.held])
        return 1.0 - float(np.sqrt(np.mean(np.square(extended)) / np.mean(np.square(plain))))


def outcome(folder: str, name: str, make: Callable[[], Case]) -> Outcome:
    """Read, fit, diagnose, predict; an error for users becomes the refusal, any other goes on up."""
    try:
        case = make()
        plain = fit(case.learnt)
        diagnosis = diagnose(case.learnt, plain.model)
        held = tuple(_held(n, m, plain.model, diagnosis.model) for n, m in case.held_out.items())
    except PadbenchError as error:
        return Outcome(folder, name, refusal=_short(str(error), name))
    return Outcome(folder, name, plain, diagnosis, held, notes=tuple(case.learnt.notes))


def _short(message: str, name: str) -> str:
    """Without the folders of this machine."""
    return " ".join(word.rsplit("/", 1)[-1] if name in word else word for word in message.split())


def _held(name: str, m: Measurement, plain: Model, extended: Model) -> Held:
    """Both models over the measured motion, as `bench.like` has them; flagged samples count for both."""
    counted = m.counted()
    by_plain, by_extended = (likeness(model, m).force_N for model in (plain, extended))
    position = m.position_at_forces_mm()
    return Held(
        name, rms((m.force_N - by_plain)[counted]), rms((m.force_N - by_extended)[counted]),
        m.force_time_s, position, m.force_N, by_plain, by_extended, counted,
    )  # fmt: skip


def rms(error: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(error**2)))
