"""What a fit returns, and its form as fit.json (docs/formats.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .noise import Noise

if TYPE_CHECKING:
    from sim.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A number of the model, its unit (empty: none), its standard error (nan: the data give none)."""

    value: float
    unit: str
    std: float

    def to_json(self) -> dict[str, Any]:
        """The entry of fit.json; `std` is null where the data give none."""
        return {"value": self.value, "unit": self.unit, "std": self.std if math.isfinite(self.std) else None}


@dataclass(frozen=True)
class Evidence:
    """One candidate of an automatic choice.

    `criterion`: n_e ln V + P ln n_e, with n_e the number of independent samples that the residual of the best-fitting
    candidate is worth, and P the number of parameters (`size`); lower is better. `eligible`: physical, every mode
    distinct, search ended.
    """

    law: str
    degree: int
    order: int
    contact: str
    size: int
    V: float
    criterion: float
    held_out_rmse: float
    eligible: bool
    chosen: bool

    @property
    def label(self) -> str:
        """The law's name, with the degree of a polynomial, or the number of a spline's points."""
        return f"{self.law} {self.degree}" if self.degree else self.law


@dataclass(frozen=True)
class Trace:
    """One measurement beside its simulation, at the force stamps; all (m,). `counted`: in the cost."""

    name: str
    time_s: Array
    position_mm: Array
    force_N: Array
    simulated_N: Array
    counted: NDArray[np.bool_]

    @property
    def residual_N(self) -> Array:
        """Measured minus simulated force, N."""
        return self.force_N - self.simulated_N


@dataclass
class FitResult:
    """A fitted pad. Units and meanings are those of fit.json; what is not in fit.json stands at the end."""

    method: str
    law: str
    order: int
    contact: str
    parameters: dict[str, Parameter]
    model_dict: dict[str, Any]
    filter: dict[str, Any] | None
    V: float
    noise_floor: float
    fit_percent: float
    physical: bool
    converged: bool
    undetermined: list[str]
    held_out_rmse: float
    samples: int
    seconds: float
    degree: int | None = None
    traces: list[Trace] = field(default_factory=list)
    evidence: list[Evidence] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """What the data and the fit cannot tell, and what is wrong with them: whole sentences."""
    noise: Noise | None = None
    independent_samples: float = math.nan
    """How many independent samples the residual is worth (its colour)."""
    surface_moved_mm: list[float] = field(default_factory=list)
    """Of each measurement, the depth that was added to its positions: its surface stands so much higher than touch-off
    said, within touch-off's own doubt."""
    covariance: Array | None = None
    """Of `parameters`, in their order."""
    iterations: int | None = None
    """Of the scheme, where it counts them."""
    history: dict[str, list[float]] = field(default_factory=dict)
    """How it converged: V in N² and the numbers by name, one entry an iteration (`recursive`: at `time_s`)."""
    attempts: list[dict[str, float]] = field(default_factory=list)
    """Where each start led, best first, for a scheme with several: V in N², converged, iterations, the numbers."""
    figures: dict[str, float] = field(default_factory=dict)
    """Further numbers of the scheme, by name."""

    @property
    def rmse(self) -> float:
        """√V, N."""
        return math.sqrt(self.V)

    @property
    def model(self) -> Model:
        """The pad as a model that simulates; what `--write` stores."""
        from sim.model import Model

        return Model.from_dict(self.model_dict)

    @property
    def c_0(self) -> Parameter | None:
        """The share that never relaxes, 1 − Σ c_i; None where the numbers are no shares."""
        shares = [i for i, name in enumerate(self.parameters) if name.startswith("c_")]
        if not shares or "c_0" in self.parameters:
            return None
        value = 1.0 - math.fsum(p.value for name, p in self.parameters.items() if name.startswith("c_"))
        spread = math.nan if self.covariance is None else float(self.covariance[np.ix_(shares, shares)].sum())
        return Parameter(value, "1", math.sqrt(spread) if spread >= 0.0 else math.nan)

    @property
    def time_s(self) -> Array:
        """Force stamps of the first measurement."""
        return self.traces[0].time_s

    @property
    def simulated(self) -> Array:
        """Simulated force of the first measurement, N, at `time_s`."""
        return self.traces[0].simulated_N

    @property
    def residual(self) -> Array:
        """Measured minus simulated force of the first measurement, N, at `time_s`."""
        return self.traces[0].residual_N

    def _unnamed_notes(self) -> list[str]:
        """The notes; where there is one measurement without its name, which is that of a file, not of the data."""
        if len(self.traces) != 1:
            return list(self.notes)
        return [note.removeprefix(f"{self.traces[0].name}: ") for note in self.notes]

    def to_json(self) -> dict[str, Any]:
        """fit.json, as docs/formats.md has it; a scheme that counts its iterations adds them and V along the way,
        a fit that moved doubtful surfaces by how much (V is with them moved)."""
        more: dict[str, Any] = {}
        if self.iterations is not None:
            more = {"iterations": self.iterations, "history": self.history.get("V", [])}
        if any(self.surface_moved_mm):
            more["surface_moved_mm"] = self.surface_moved_mm
        return {
            "method": self.method,
            "law": self.law,
            "order": self.order,
            "contact": self.contact,
            "model": self.model_dict,
            "parameters": {name: p.to_json() for name, p in self.parameters.items()},
            "filter": self.filter,
            "V": self.V,
            "rmse": self.rmse,
            "noise_floor": self.noise_floor,
            "fit_percent": self.fit_percent,
            "physical": self.physical,
            "converged": self.converged,
            "undetermined": list(self.undetermined),
            "held_out_rmse": self.held_out_rmse if math.isfinite(self.held_out_rmse) else None,
            "samples": self.samples,
            "seconds": self.seconds,
            "notes": self._unnamed_notes(),
            **more,
        }
