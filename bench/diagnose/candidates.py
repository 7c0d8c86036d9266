"""Which causes could be missing."""

from __future__ import annotations

from sim.effects import all_effects
from sim.effects.base import Effect, Form
from sim.elastic import NoPad

from .numbers import Structure
from .reach import Reach, narrowed, repeats_beyond

CHANNEL = ("outliers", "stuck_samples", "mains_hum")  # found by detectors, not by fitting


def forms(structure: Structure, in_air: bool, reach: Reach, also_unsought: bool = False) -> list[tuple[Effect, Form]]:
    """All forms of all effects that may be added to a structure; `also_unsought`: those too that only refine others."""
    present = {c.id for c in structure.causes}
    out = []
    for effect in all_effects().values():
        if effect.id in CHANNEL:
            continue
        for form in effect.forms:
            # A second block of a cause that is there already asks whether only its shape is another.
            if effect.id in present and (form.amend is not None or form.time_shift is not None):
                continue
            if (in_air and not _in_air(form)) or repeats_beyond(form, reach):
                continue
            if form.has_a_course and not reach.rich:  # where depths are met once, any error is one of its time
                continue
            if form.given or not (form.sought or also_unsought):
                continue
            if form.amend is not None and not _amends(structure, form):
                continue
            out.append((effect, narrowed(form, reach)))
    return out


def _in_air(form: Form) -> bool:
    if form.amend is not None:
        return False
    pads = {"depth", "elastic", "rate", "contact", "gap", "frame"}
    return form.time_shift is None and not pads & set(form.blocks)


def _amends(structure: Structure, form: Form) -> bool:
    """Whether the form changes the pad at all (separation of a pad that lets go already does not)."""
    pad = structure.pad.pad
    values = {p.name: p.typical for p in form.parameters}
    assert form.amend is not None
    return form.amend(pad, values) != pad and not isinstance(pad.law, NoPad)
