"""What a diagnosis returns, and its form as diagnosis.json (docs/formats.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sim.model import Model

Array = NDArray[np.float64]

Verdict = str  # consistent, explained, unexplained


@dataclass(frozen=True)
class Number:
    """A parameter of a cause; `std` nan where the data give none."""

    value: float
    unit: str
    std: float

    def to_json(self) -> dict[str, Any]:
        """The entry of diagnosis.json."""
        return {"value": self.value, "unit": self.unit, "std": self.std if math.isfinite(self.std) else None}


@dataclass(frozen=True)
class Alternative:
    """Another cause in this one's place: what share of its gain it reaches, and how much worse it fits (Δχ²)."""

    id: str
    form: str
    gain_share: float
    delta_chi2: float
    excluded: bool
    """Whether these data exclude it; it is then listed as the strongest rival only."""

    def to_json(self) -> dict[str, Any]:
        """The entry of diagnosis.json."""
        return {
            "id": self.id,
            "form": self.form,
            "gain_share": self.gain_share,
            "delta_chi2": self.delta_chi2,
            "excluded": self.excluded,
        }


@dataclass(frozen=True)
class CauseFound:
    """A named cause. `gain`: share of the held-out error beyond the noise that it takes."""

    id: str
    form: str
    parameters: dict[str, Number]
    gain: float
    confidence: float
    alternatives: list[Alternative]
    explanation: str
    check: str = ""
    of_its_kind: float = 0.0
    """Confidence that it is this one or another of its kind, where that is more: a force that comes late is late by a
    delay, a lag or a stiff resonance."""
    doubt: str = ""
    """What keeps the name from being as sure as its rivals would leave it; empty: nothing."""

    def to_json(self) -> dict[str, Any]:
        """The entry of diagnosis.json."""
        return {
            "id": self.id,
            "form": self.form,
            "parameters": {name: number.to_json() for name, number in self.parameters.items()},
            "gain": self.gain,
            "confidence": self.confidence,
            "alternatives": [a.to_json() for a in self.alternatives],
            "explanation": self.explanation,
            "check": self.check,
            "doubt": self.doubt,
        }


@dataclass(frozen=True)
class Remainder:
    """A structure test on what is left: its name, its chance, and the share of the noise power that it finds."""

    name: str
    p_value: float
    share: float
    sentence: str
    passed: bool
    """Whether it stands out over all tests made."""


@dataclass
class Diagnosis:
    """The verdict on one measurement. Errors are RMS in N; see docs/formats.md. At the end what is not in the file."""

    verdict: Verdict
    causes: list[CauseFound]
    left: float
    noise_floor: float
    rmse_before: float
    rmse_after: float
    held_out_before: float
    held_out_after: float
    flagged_fraction: float
    seconds: float
    model_dict: dict[str, Any]
    next_protocol: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    """What makes the data's units or sign doubtful, or is odd about their noise; in the file's notes too."""
    in_question: list[str] = field(default_factory=list)
    """Those of them with which all else falls: units and sign."""
    remainders: list[Remainder] = field(default_factory=list)
    as_given: str = ""
    """How far a consistent belief errs with the numbers it was given; empty where hardly more than refitted."""
    name: str = ""
    seen_once: bool = False
    """Whether the depth was passed so seldom that no name of a cause which acts with the motion is sure."""
    held_out_interval: tuple[float, float] = (math.nan, math.nan)
    """95 % interval of the held-out gain E_n/E_0 (share left), over the blocks."""
    time_s: Array = field(default_factory=lambda: np.zeros(0))
    position_mm: Array = field(default_factory=lambda: np.zeros(0))
    force_N: Array = field(default_factory=lambda: np.zeros(0))
    before_N: Array = field(default_factory=lambda: np.zeros(0))
    after_N: Array = field(default_factory=lambda: np.zeros(0))
    sigma_N: Array = field(default_factory=lambda: np.zeros(0))
    flags: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    """By channel fault, which force samples (m,) have it."""
    counted: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    ranking: list[Alternative] = field(default_factory=list)
    """Every candidate for the first cause, best first."""
    rivals: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    """(id, model file's content) of the best single causes, refitted: what a next test would have to tell apart."""

    @property
    def model(self) -> Model:
        """The extended model; what `--write` stores."""
        from sim.model import Model

        return Model.from_dict(self.model_dict)

    def to_json(self) -> dict[str, Any]:
        """diagnosis.json."""
        return {
            "verdict": self.verdict,
            "causes": [cause.to_json() for cause in self.causes],
            "left": self.left,
            "noise_floor": self.noise_floor,
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "held_out_before": self.held_out_before,
            "held_out_after": self.held_out_after,
            "flagged_fraction": self.flagged_fraction,
            "remains": [
                {"name": r.name, "p_value": r.p_value, "share": r.share, "sentence": r.sentence}
                for r in self.remainders
                if r.passed
            ],
            "flags": {name: np.flatnonzero(mask).tolist() for name, mask in self.flags.items() if mask.any()},
            "next_protocol": self.next_protocol,
            "notes": [*self.notes, *self.doubts],
            "seconds": self.seconds,
        }
