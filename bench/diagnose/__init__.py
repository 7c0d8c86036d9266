"""Given measured data and the model a lab believes: what the simulation gets wrong, the cause, the extended model."""

from __future__ import annotations

from .diagnose import diagnose
from .result import Alternative, CauseFound, Diagnosis, Number

__all__ = ["Alternative", "CauseFound", "Diagnosis", "Number", "diagnose"]
