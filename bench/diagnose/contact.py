"""Whether the pad, believed to let go of the probe, stays bonded to it: no cause, but a word of the model."""

from __future__ import annotations

from dataclasses import replace

from .path import Path
from .refit import refit
from .search import Search

BONDED = (
    "a pad that does not let go (`contact: bonded` in the model) explains more of these data than all of this: "
    "diagnose that model"
)
STEPS = 30


def stays_bonded(search: Search, path: Path) -> list[str]:
    """What to say where the believed pad, refitted as one that pulls, leaves less than all causes that were found."""
    believed = search.believed
    if not believed.pad.pad.unilateral or believed.in_air or len(path.fits) < 2:
        return []
    pulls = replace(believed, pad=replace(believed.pad, pad=replace(believed.pad.pad, unilateral=False)))
    starts = (believed.pad.x(), path.fits[0].x[: len(believed.pad.coordinates)])
    values = path.fits[0].structure.values(path.fits[0].x)
    least = min(refit(search.short, pulls, pulls.x(x, values), STEPS, 1e-6).chi2 for x in starts)
    return [BONDED] if least < path.fits[-1].chi2 else []
