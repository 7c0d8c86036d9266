"""A diagnosis in plain words: what, how big, how sure, what to check on the bench."""

from __future__ import annotations

import math

from .result import CauseFound, Diagnosis

NAMES = {
    "adhesion": "adhesion",
    "backlash": "backlash",
    "clock_skew": "a clock that runs at another rate",
    "cogging": "cogging",
    "contact_offset": "a surface that is not where it was believed",
    "damage": "damage",
    "depth_dependent_relaxation": "relaxation that depends on the depth",
    "elastic_law": "another elastic law",
    "encoder_error": "an encoder error",
    "force_bias": "a force bias",
    "force_delay": "a late force",
    "force_drift": "a drifting force",
    "frame_compliance": "a compliant frame",
    "friction": "friction",
    "inertia": "moving mass",
    "mains_hum": "mains hum",
    "missing_relaxation_mode": "a further relaxation mode",
    "outliers": "outliers of the force",
    "permanent_set": "permanent set",
    "resonance": "a resonance of the force path",
    "saturation": "a saturated force",
    "sensor_lag": "a lagging force sensor",
    "separation": "a pad that lets go",
    "stress_softening": "stress softening",
    "stuck_samples": "a force that sticks",
    "viscous_damping": "viscous damping",
}


def name_of(id_: str) -> str:
    """What a person calls the effect; its id where nobody has said."""
    return NAMES.get(id_, id_.replace("_", " "))


def headline(d: Diagnosis) -> str:
    """The verdict in one sentence."""
    if d.verdict == "consistent":
        return (
            f"consistent: the model explains these data down to their noise ({1e3 * d.rmse_before:.3g} mN of error, "
            f"{1e3 * d.noise_floor:.3g} mN of noise)"
        )
    names = " and ".join(name_of(c.id) for c in d.causes)
    error = f"error {1e3 * d.held_out_before:.3g} mN → {1e3 * d.held_out_after:.3g} mN on data held out"
    noise = f"noise {1e3 * d.noise_floor:.3g} mN"
    if d.verdict == "explained":
        return f"explained by {names}: {error} ({noise})"
    if d.causes:
        return (
            f"unexplained: {names} takes {100 * (1 - d.left):.0f} % of it, no known cause the rest; {error} ({noise})"
        )
    return f"unexplained: no known cause takes what is left; {error} ({noise})"


def lines(d: Diagnosis) -> list[str]:
    """The diagnosis in some lines for a terminal."""
    out = [headline(d)]
    for number, cause in enumerate(d.causes, 1):
        out += _cause(number, cause)
    if d.flagged_fraction > 0:
        out.append(f"  {100 * d.flagged_fraction:.2g} % of the force samples are flagged and left out")
    for r in [r for r in d.remainders if r.passed][:3] if d.verdict != "consistent" else []:
        out.append(f"  what is left {r.sentence} ({100 * r.share:.2g} % of its power)")
    if d.next_protocol is not None:
        out.append(f"  next test: {d.next_protocol['description']}")
    return out


def _cause(number: int, cause: CauseFound) -> list[str]:
    sure = f"{100 * min(cause.confidence, 0.99):.0f} % sure"
    out = [f"  {number}. {name_of(cause.id)} ({cause.form}): takes {100 * cause.gain:.3g} % of the error, {sure}"]
    out.append(f"     {cause.explanation}")
    numbers = []
    for name, n in cause.parameters.items():
        doubt = f" ± {n.std:.2g}" if math.isfinite(n.std) else ""
        unit = "" if n.unit in ("1", "") else f" {n.unit}"
        numbers.append(f"{name} = {n.value:.4g}{doubt}{unit}")
    out.append("     " + ", ".join(numbers))
    doubtful = [a for a in cause.alternatives if not a.excluded]
    if doubtful:
        named = ", ".join(f"{name_of(a.id)} ({100 * a.gain_share:.0f} % of the gain)" for a in doubtful)
        out.append(f"     these data cannot exclude: {named}")
    if cause.check:
        out.append(f"     check: {cause.check}")
    return out
