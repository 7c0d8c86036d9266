"""What of a model runs in a real-time loop: elastic response, relaxation, contact. Nothing of the bench."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

from bench.errors import InputError, Refused
from sim.effects import Active
from sim.elastic import ElasticLaw
from sim.model import Model
from sim.pad import Pad
from sim.relaxation import Relaxation

DEFAULT_RATE_HZ = 1000.0
LEAST_HZ, MOST_HZ = 1e-3, 1e7


@dataclass(frozen=True)
class RealTimePad:
    """The part of a model that exports hold. `left_out` names the effects of the model that are not in it."""

    law: ElasticLaw
    relaxation: Relaxation
    unilateral: bool
    left_out: tuple[str, ...]

    @property
    def contact(self) -> str:
        """`unilateral` or `bonded`."""
        return "unilateral" if self.unilateral else "bonded"

    @property
    def parameters(self) -> dict[str, tuple[float, str]]:
        """Value and unit of every number by the names that fits use."""
        law = {name: (value, self.law.units[name]) for name, value in self.law.parameters.items()}
        shares = {f"c_{i}": (c, "1") for i, c in enumerate(self.relaxation.shares, start=1)}
        rates = {f"nu_{i}": (nu, "1/s") for i, nu in enumerate(self.relaxation.rates, start=1)}
        return law | shares | rates


def real_time_pad(model: Model, *, pad_only: bool = False) -> RealTimePad:
    """The model's pad as exports hold it.

    Effects that are only another pad (another law, one more mode, contact that lets go) are taken in. Any other
    effect has no form in an export: raises `Refused`, or leaves it out where `pad_only` says so.
    """
    pad = model.cascade.pad
    others = tuple(_called(active) for active in model.cascade.effects if not _is_pad(active, pad))
    if others and not pad_only:
        raise Refused(
            f"the model has {_listed(others)}, which {'has' if len(others) == 1 else 'have'} no form in an export: "
            "it holds elastic response, relaxation and contact\n"
            "  export the pad without with --pad-only, or simulate the whole with `padbench simulate`"
        )
    return RealTimePad(pad.law, pad.relaxation, pad.unilateral, others)


def checked_rate(rate_hz: float) -> float:
    """The rate; raises `InputError` where it is none."""
    if not LEAST_HZ <= rate_hz <= MOST_HZ:
        cure = f"give steps a second, from {LEAST_HZ:g} to {MOST_HZ:g}"
        raise InputError("--rate", f"{rate_hz:g} is no rate of a loop", cure)
    return rate_hz


def digest(model: Model) -> str:
    """SHA-256 of the model file's content (not of its layout or comments), hexadecimal."""
    content = json.dumps(model.to_dict(), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(content.encode()).hexdigest()


def version() -> str:
    """padbench's own."""
    from importlib.metadata import version

    return version("padbench")


def _is_pad(active: Active, pad: Pad) -> bool:
    form = active.form
    if active.effect.id == "separation" and (pad.film_Ns > 0.0 or pad.bonded > 0.0):  # what bears tension has no form
        return False
    return form.amend is not None and not form.blocks and form.time_shift is None


def _called(active: Active) -> str:
    return f"{active.effect.id} ({active.form.name})"


def _listed(names: tuple[str, ...]) -> str:
    head = ", ".join(names[:-1])
    return f"the effects {head} and {names[-1]}" if head else f"the effect {names[0]}"
