"""Whether one of two hidden effects can be seen beside the other: what no change of the other, or of the pad, can make.

Each effect of a pair may be plain alone and yet not be told beside the other: what the one makes, more of the other
makes nearly as well. Here the pair's force without noise is compared with that of the other effect alone, the
difference is freed of all that the pad's numbers and the other's size can do to first order, and what is left is
counted in units of the noise as in `detect`:

    χ² = min over a of ‖W (r(A, B) − r(A) − J a)‖²

with r the force less that of the plain pad on the reported motion, J its derivatives by the pad's numbers and by the
size of A, W whitening. The shape of A is held, of which nobody told the lab: a shape that bends as well makes B harder
to see. So what is called hidden here is hidden, and not the other way about. Of another law that is too little: what an
encoder's error makes on a pad that stays put is a law too. Where A is one, J has its values at some depths as well, so
that it may be any smooth curve.
"""

from __future__ import annotations

import numpy as np

from .cases import Case, draw_case
from .detect import Lab, _faults, _sigma, _whitened, freed, of_any_law, of_the_pad

Array = np.ndarray

STEP = 0.02
"""Of a size, for derivatives."""

FAULTS = ("outliers", "stuck_samples")
"""What nothing else imitates."""


def drawn_again(case: Case, *ids: str, **factors: float) -> Case:
    """The case with these of its effects alone, each at its size times a factor. Jitter is left out: it would be drawn
    anew, and is noise and no effect."""
    truth = case.truth
    told = truth.overrides | {
        "drawn": truth.drawn,
        "motion": truth.motion,
        "rate_hz": truth.rate_hz,
        "own_clock": case.force_time_s is not None,
        "jitter": "none",
    }
    sizes = {id: truth.sizes[id] * factors.get(id, 1.0) for id in ids}
    return draw_case(truth.seed, ids, sizes, {id: truth.shapes[id] for id in ids}, **told)


def slope(case: Case, id: str, *ids: str) -> Array:
    """How the force beyond the plain pad's goes with the size of one of the effects `ids`, N."""
    more, less = (_beyond(drawn_again(case, *ids, **{id: 1 + sign * STEP})) for sign in (1, -1))
    return more - less


def seen_beside(case: Case) -> dict[str, float]:
    """Of each effect of a pair, χ² of what it makes that neither the other's size nor the pad's numbers can."""
    truth = case.truth
    both = drawn_again(case, *truth.ids)
    lab = Lab(both.truth)
    sigma = _sigma(both.truth, lab)

    def weighed(force: Array) -> Array:
        return _whitened(truth.noise, both.truth.label_time_s, force * truth.noise.std / sigma)

    of_pad = of_the_pad(both.truth, lab, weighed)
    out = {}
    for id in truth.ids:
        (other,) = (known for known in truth.ids if known != id)
        own = weighed(_beyond(both) - _beyond(drawn_again(case, other)))
        of_law = of_any_law(both.truth, lab, weighed) if other == "elastic_law" else []
        left = freed(own, [*of_pad, weighed(slope(case, other, *truth.ids)), *of_law])
        out[id] = float(left @ left)
        if id in FAULTS:
            out[id] += _faults(both.truth, sigma)
    return out


def _beyond(drawn: Case) -> Array:
    """What the force has beyond the plain pad's on the reported motion, N."""
    return drawn.truth.clean_N - Lab(drawn.truth).force(drawn.truth.structure)
