"""A diagnosis in plain words: what, how big, how sure, what to check on the bench."""

from __future__ import annotations

import math

from sim.effects import all_effects
from sim.effects.reading import force

from .result import Alternative, CauseFound, Diagnosis
from .verdict import EXPLAINED
from .way import LEVELS, TOLD_ONCE

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

SHOWN = 6
"""Numbers of one cause that a terminal shows."""
DOUBTED = 0.9
"""Confidence under which the strongest rival stays in doubt, even if it is excluded."""
NEAR = 0.5
"""Share of the gain from which an excluded rival is worth a word."""
UNTOLD = 0.7
"""Of a number, that its standard deviation may be for it to be told."""
LEAST = 0.01
"""Share of the gain below which its size says no more."""
NEARLY = 1.15
"""Times the noise, up to which an error is said to be down to it."""
NOT_KNOWN = "no cause that is known here was found to do all of this: look at what remains before trusting the model"
NOT_SURE = "names so little sure explain nothing: test them by another run before trusting them or the model"
HOW_NEXT = "`--next FILE` writes the protocol"
REMAINS = 3
"""Sentences on what is left."""


def name_of(id_: str) -> str:
    """What a person calls the effect; its id where nobody has said."""
    return NAMES.get(id_, id_.replace("_", " "))


def named(d: Diagnosis, marked: bool = False) -> str:
    """The causes' names as one phrase; `marked`: with a `perhaps` before those of which one is not sure."""
    names = [f"{'perhaps ' if marked and is_unsure(c) else ''}{name_of(c.id)}" for c in d.causes]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def in_air(d: Diagnosis) -> bool:
    """Whether the bench was looked at in free air, without a pad."""
    return bool(d.model_dict.get("pad", {}).get("elastic", {}).get("law") == "none")


def percent(share: float) -> str:
    """A share for reading; never 100 % where something is missing, and no number for what nobody can see."""
    value = 100 * share
    if 0 < value < 0.001:
        return "0 %"
    if 99.5 <= value < 99.95:
        return f"{value:.1f} %"
    return f"{value:.0f} %" if value >= 9.5 else f"{value:.2g} %"


def verdict(d: Diagnosis) -> str:
    """The verdict in a few words."""
    what = "The bench in free air" if in_air(d) else "The model"
    if d.verdict == "consistent":
        if in_air(d):
            return f"{what} adds nothing to the noise"
        near = min(d.rmse_before, d.held_out_before) <= NEARLY * d.noise_floor
        return (
            f"{what}{', with its numbers refitted,' if d.as_given else ''} explains these data "
            f"{'down to their noise' if near else 'as far as they tell anything beyond their motion and noise'}"
        )
    if d.verdict == "explained":
        told = "can be explained by" if unsure(d) else "is explained by"
        return f"What {'the bench adds' if in_air(d) else 'the model gets wrong'} {told} {named(d)}"
    if d.causes:
        if for_its_names(d):
            return (
                f"Unexplained: {named(d)} would take {percent(1 - d.left)} of the error, but something else may as well"
            )
        verb = "takes" if len(d.causes) == 1 else "take"
        return f"Unexplained: {named(d)} {verb} {percent(1 - d.left)} of the error, no known cause the rest"
    return "Unexplained: no known cause takes what is left"


def for_its_names(d: Diagnosis) -> bool:
    """Whether what is unexplained is so for its names alone: little is left."""
    return d.verdict == "unexplained" and bool(d.causes) and d.left <= EXPLAINED


def not_known(d: Diagnosis) -> str:
    """What it means that a verdict is `unexplained`; empty where it is not."""
    if d.verdict != "unexplained":
        return ""
    return NOT_SURE if for_its_names(d) else NOT_KNOWN


def unsure(d: Diagnosis) -> bool:
    """Whether a name is as likely another."""
    return any(is_unsure(c) for c in d.causes)


def is_unsure(cause: CauseFound) -> bool:
    """Whether its name is as likely another."""
    return max(cause.confidence, cause.of_its_kind) <= TOLD_ONCE


def errors(d: Diagnosis) -> str:
    """The errors beside the noise in one sentence."""
    if d.verdict == "consistent":
        return f"error {force(d.rmse_before)}, noise {force(d.noise_floor)}"
    digits = 3 if force(d.held_out_before) != force(d.held_out_after) else 5
    before, after, noise = (force(v, digits) for v in (d.held_out_before, d.held_out_after, d.noise_floor))
    return f"error {before} → {after} on data held out (noise {noise})"


def headline(d: Diagnosis) -> str:
    """The verdict in one line, its word first."""
    if d.verdict == "explained":
        if all(is_unsure(c) for c in d.causes):
            return f"explained, perhaps by {named(d)}: {errors(d)}"
        return f"explained by {named(d, marked=True)}: {errors(d)}"
    return f"{d.verdict}: {lowered(verdict(d).removeprefix('Unexplained: '))}; {errors(d)}"


def lowered(sentence: str) -> str:
    """A sentence as it goes on after a colon."""
    return sentence[:1].lower() + sentence[1:]


def lines(d: Diagnosis, how_next: str = HOW_NEXT) -> list[str]:
    """The diagnosis in some lines for a terminal; `how_next`: where the next test is, or how to come by it."""
    out = [headline(d), *(f"  first of all: {sentence}" for sentence in d.in_question)]
    out += [f"  {d.as_given}"] if d.as_given else []
    for number, cause in enumerate(d.causes, 1):
        out += _cause(number, cause)
    if d.flagged_fraction > 0:
        out.append(f"  {percent(d.flagged_fraction)} of the force samples are flagged and left out")
    if d.verdict != "consistent":
        out += [f"  {sentence}" for sentence in remains(d)]
    out += [f"  {sentence}" for sentence in warnings(d)]
    out += [f"  {sentence}"] if (sentence := not_known(d)) else []
    if d.next_protocol is not None:
        out.append(f"  next test: {d.next_protocol['description']} ({how_next})")
    return out


def remains(d: Diagnosis, most: int = REMAINS) -> list[str]:
    """What is left has structure: in sentences."""
    told = [r for r in d.remainders if r.passed]
    return [f"what is left {r.sentence} ({percent(r.share)} of its power)" for r in told[:most]]


def warnings(d: Diagnosis) -> list[str]:
    """What else makes the data or the names doubtful, and the cure."""
    doubts = [sentence for sentence in d.doubts if sentence not in d.in_question]
    if not d.seen_once:
        return doubts
    return [
        *doubts,
        f"too little comes twice in this run to tell what acts with the motion from an odd pad: no such name is more"
        f" than {percent(TOLD_ONCE)} sure (press and return twice or more, or hold at {LEVELS} depths or more)",
    ]


def sure(cause: CauseFound) -> str:
    """How sure the name is."""
    return "over 99 % sure" if cause.confidence > 0.99 else f"{100 * cause.confidence:.0f} % sure"


def doubtful(cause: CauseFound) -> list[Alternative]:
    """What these data cannot exclude in the cause's place."""
    return [a for a in cause.alternatives if not a.excluded]


def in_doubt(cause: CauseFound) -> list[Alternative]:
    """What a further test should tell from a cause, nearest first: what is not excluded; else, where the name is little
    sure, what comes nearest."""
    still = doubtful(cause)
    near = sorted(still or cause.alternatives, key=lambda a: a.delta_chi2)
    return near if still else near[: int(cause.confidence < DOUBTED)]


def rivals(cause: CauseFound) -> str:
    """What else it could be, in one sentence; empty where nothing comes near."""
    open_ = doubtful(cause)
    if open_:
        said = ", ".join(f"{name_of(a.id)} ({gain(a)} of the gain)" for a in open_)
        return f"these data cannot exclude: {said}"
    nearest = in_doubt(cause)
    if nearest:
        said = f"{name_of(nearest[0].id)} ({gain(nearest[0])} of the gain)"
        return f"likeliest beside it, though these data speak against it: {said}"
    near = [a for a in cause.alternatives if a.gain_share >= NEAR]
    if near:
        return f"excluded, though near: {name_of(near[0].id)} ({percent(near[0].gain_share)} of the gain)"
    return ""


def no_surer(cause: CauseFound) -> str:
    """Why a name is no surer than it is, where that is not for its rivals; else empty."""
    return f"no surer, for {cause.doubt}" if cause.doubt else ""


def gain(rival: Alternative) -> str:
    """Share of the cause's gain that a rival reaches; a share next to none has no digits worth reading."""
    return percent(rival.gain_share) if rival.gain_share >= LEAST else f"under {percent(LEAST)}"


def numbers(cause: CauseFound, most: int = SHOWN) -> str:
    """The cause's numbers with their doubts; those that were not fitted are left out."""
    form = all_effects()[cause.id].form(cause.form) if cause.id in all_effects() else None
    fixed = {p.name for p in form.parameters if p.fixed} if form is not None else set()
    said = []
    for name, n in cause.parameters.items():
        if name in fixed:
            continue
        doubt = f" ± {n.std:.2g}" if math.isfinite(n.std) else ""
        unit = "" if n.unit in ("1", "") else f" {n.unit.replace('*', '·')}"
        said.append(f"{name} = {n.value:.4g}{doubt}{unit}")
    if len(said) > most:
        said = [*said[: most - 1], f"and {len(said) - most + 1} more"]
    return ", ".join(said)


def untold(cause: CauseFound) -> str:
    """Which of a cause's numbers these data hardly tell; empty: none. An angle near 0 is told as well as any other."""
    scale = {name: 1.0 if n.unit == "rad" else abs(n.value) for name, n in cause.parameters.items()}
    wide = [name for name, n in cause.parameters.items() if math.isfinite(n.std) and n.std > UNTOLD * scale[name] > 0]
    return f"hardly told by these data: {', '.join(wide)}" if wide else ""


def _cause(number: int, cause: CauseFound) -> list[str]:
    out = [f"  {number}. {name_of(cause.id)} ({cause.form}): {percent(cause.gain)} of the error, {sure(cause)}"]
    out.append(f"     {cause.explanation}")
    check = f"check: {cause.check}" if cause.check else ""
    said = (numbers(cause), untold(cause), rivals(cause), no_surer(cause), check)
    return out + [f"     {line}" for line in said if line]
