"""Make docs/effects.md: every physical cause the simulator knows, with what it does to one and the same press.

    python -m docs.effects [--out DIR] [--text]

Writes DIR/effects.md and DIR/img/effects/*.png (DIR: docs); with --text the page alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.effects import Active, Effect, Form, Parameter, all_effects
from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation

Array = NDArray[np.float64]

PAD = Pad(Exponential(2.24, 0.69), Relaxation((0.25, 0.15), (4.0, 0.35)), unilateral=True)

GROUPS = {
    "Between motor and load cell": (
        "frame_compliance",
        "backlash",
        "friction",
        "inertia",
        "cogging",
        "encoder_error",
    ),
    "The pad": (
        "elastic_law",
        "missing_relaxation_mode",
        "depth_dependent_relaxation",
        "viscous_damping",
        "stress_softening",
        "damage",
        "permanent_set",
    ),
    "Contact": ("contact_offset", "separation", "adhesion"),
    "The force path": ("sensor_lag", "resonance", "force_bias", "force_drift", "mains_hum", "saturation"),
    "Clocks and samples": ("force_delay", "clock_skew", "outliers", "stuck_samples"),
}

LOOK_ALIKES = {
    ("force_delay", "sensor_lag", "resonance"): (
        "0.93 to 1.00",
        "fast ramps at several speeds; the shape of the corners",
    ),
    ("elastic_law", "contact_offset"): ("0.86 to 0.96", "many depths, shallow ones most"),
    ("permanent_set", "missing_relaxation_mode", "stress_softening"): (
        "0.84 to 0.91 on a staircase, 0.4 to 0.6 with cycles and returns",
        "unload to the surface and come back",
    ),
    ("damage", "permanent_set"): ("0.72 to 0.95", "repeated cycles at one depth, then deeper"),
    ("contact_offset", "frame_compliance"): ("0.74 to 0.91", "depth against force at several states of relaxation"),
    ("viscous_damping", "force_delay", "missing_relaxation_mode"): ("0.4 to 0.75", "several speeds at one depth"),
    ("force_bias", "force_drift"): ("0.5 to 0.7", "free air before and after"),
}
"""Causes that stand in for each other: share of the gain that the best rival reaches alone, and what separates them."""

SHOWN: Mapping[tuple[str, str], Mapping[str, float]] = {
    ("elastic_law", "exponential"): {"m": 2.6, "b": 0.5},
    ("elastic_law", "power"): {"p": 4.6, "q": 0.6},
    ("elastic_law", "polynomial_2"): {"alpha_1": 1.7, "alpha_2": 1.5},
    ("elastic_law", "polynomial_3"): {"alpha_1": 2.3, "alpha_2": 0.6, "alpha_3": 0.35},
    ("elastic_law", "polynomial_4"): {"alpha_1": 2.3, "alpha_2": 0.8, "alpha_3": 0.1, "alpha_4": 0.12},
    ("elastic_law", "polynomial_5"): {"alpha_1": 2.1, "alpha_2": 0.9, "alpha_3": 0.1, "alpha_4": 0.1, "alpha_5": 0.01},
    ("elastic_law", "spline"): {"reach": 2.1, **{f"rise_{i}": 0.45 + 0.28 * i for i in range(1, 8)}},
    ("saturation", "hard"): {"limit": 5.0},
    ("saturation", "upper"): {"limit": 5.0},
    ("saturation", "soft"): {"limit": 5.0},
    ("clock_skew", "linear"): {"skew": 1000.0},
    ("clock_skew", "offset"): {"skew": 1000.0, "offset": -0.01},
    ("clock_skew", "ageing"): {"skew": 1000.0, "growth": 0.1, "at_time": 10.0},
}
"""Numbers in the pictures where the typical ones would show little."""

ZOOMED = ("inertia", "sensor_lag", "resonance", "force_delay", "mains_hum", "viscous_damping")
"""Causes of which the middle panel shows the third step alone."""
ZOOM_S = (2.98, 3.22)

POINTS = 2700  # of a curve in a picture


def press() -> tuple[Array, Array]:
    """Times and depths at 1 kHz: a staircase up and down, a return to air, and the deepest step once more."""
    moves = [(-0.3, 2.0, 0.5)] + [(to, 20.0, 1.2) for to in (0.6, 1.2, 1.8, 1.2, 0.6, -0.3, 1.8, 1.2, -0.3)]
    parts: list[Array] = [np.full(1, -0.3)]
    for to, speed, hold in moves:
        start = parts[-1][-1]
        way, acceleration = abs(to - start), 1000.0
        ramp = speed / acceleration
        seconds = way / speed + ramp
        s = np.arange(1, max(1, round(seconds * 1000)) + 1) * 1e-3
        covered = (
            0.5 * acceleration * s**2
            - 0.5 * acceleration * np.maximum(s - ramp, 0.0) ** 2
            - 0.5 * acceleration * np.maximum(s - (seconds - ramp), 0.0) ** 2
        )
        if way > 0.0:
            parts.append(start + np.sign(to - start) * np.minimum(covered, way))
        parts.append(np.full(round(hold * 1000), to))
    depth = np.concatenate(parts)
    return np.arange(depth.size, dtype=np.float64) * 1e-3, depth


def believed(cause: Effect) -> Pad:
    """The pad without the effect."""
    return replace(PAD, unilateral=False) if cause.id == "separation" else PAD


def shown(cause: Effect, form: Form) -> Active:
    """The form with the numbers of its picture."""
    return cause.active(form.name, **SHOWN.get((cause.id, form.name), {}))


def draw(cause: Effect, path: Path) -> None:
    """Three panels: force with and without (first form), the difference each form makes, force over depth."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    t, x = press()
    without = Cascade(believed(cause)).simulate(t, x)
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 2.5), width_ratios=[3, 3, 2])
    some = np.unique(np.linspace(0, t.size - 1, POINTS).astype(int))
    zoom = (t >= ZOOM_S[0]) & (t <= ZOOM_S[1])
    part = np.flatnonzero(zoom) if cause.id in ZOOMED else some
    for number, form in enumerate(cause.forms):
        force = Cascade(believed(cause), [shown(cause, form)]).simulate(t, x)
        if number == 0:
            axes[0].plot(t[some], without[some], color="0.6", lw=1.0, label="without")
            axes[0].plot(t[some], force[some], color="C0", lw=0.8, label=form.name)
            axes[2].plot(x, without, color="0.6", lw=1.0)
            axes[2].plot(x, force, color="C0", lw=0.8)
        added = np.round(1e3 * (force - without), 6)
        axes[1].plot(t[part], added[part], lw=0.7, color=f"C{number}", label=form.name)
    for axis, title, label in zip(
        axes, ("force", "what the effect adds", "force over position"), ("s", "s", "mm"), strict=True
    ):
        axis.set_title(title, fontsize=8)
        axis.set_xlabel(label, fontsize=7)
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.3, lw=0.5)
    axes[0].set_ylabel("N", fontsize=7)
    axes[1].set_ylabel("mN", fontsize=7)
    axes[2].set_ylabel("N", fontsize=7)
    axes[0].legend(fontsize=6)
    axes[1].legend(fontsize=6)
    figure.tight_layout(pad=0.4)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=75, metadata={"Software": None}, pil_kwargs={"optimize": True})
    plt.close(figure)


def number(value: float) -> str:
    """A bound or default, short."""
    return f"{value:.4g}".replace("e+0", "e").replace("e-0", "e-").replace("-", "−")


def describe(parameter: Parameter) -> str:
    """One parameter in a table's cell."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    bounds = f"{number(parameter.lower)} … {number(parameter.upper)}{unit}"
    notes = [bounds, f"typically {number(parameter.typical)}"] if parameter.required else [bounds]
    if not parameter.required:
        notes.append(f"{number(parameter.if_left_out)} where left out")
    if parameter.fixed:
        notes.append("not fitted")
    return f"`{parameter.name}` {parameter.what} ({', '.join(notes)})"


def look_alikes(cause: Effect) -> list[str]:
    """Lines on what stands in for the cause."""
    lines = []
    for causes, (share, cure) in LOOK_ALIKES.items():
        if cause.id in causes:
            others = ", ".join(f"`{other}`" for other in causes if other != cause.id)
            lines.append(f"{others} ({share}; told apart by: {cure})")
    return lines


def section(cause: Effect) -> list[str]:
    """The part of the page on one cause."""
    out = [f"### {cause.id}", "", cause.what, "", f"![{cause.id}](img/effects/{cause.id}.png)", ""]
    out += ["| form | what | parameters |", "|---|---|---|"]
    for form in cause.forms:
        parameters = "<br>".join(describe(p) for p in form.parameters) or "none"
        out.append(f"| `{form.name}` | {form.what} | {parameters} |")
    floors = {p.floor for form in cause.forms for p in form.parameters if p.floor is not None}
    names = {
        "sample_s": "of the time between force samples",
        "position_noise_mm": "standard deviations of the position's noise",
        "force_noise_N": "standard deviations of the force's noise",
    }
    out += ["", f"On the bench: {cause.check}."]
    for quantity, factor in sorted(floors):
        out += ["", f"Not believed below {factor:g} {names[quantity]}."]
    alike = look_alikes(cause)
    if alike:
        out += ["", f"Looks like: {'; '.join(alike)}."]
    return [*out, "", f"Reference: {cause.reference}.", ""]


HEAD = """# Effects

What can stand between a pad and what the bench reports. Each cause is one file in `sim/effects/`; its docstring has
the equations. In a model file an effect is one line under `effects:`

    effects:
      - {id: friction, form: stribeck, coulomb: 0.05, static_ratio: 1.5}
      - {id: sensor_lag, time_constant: {value: 0.01, unit: s, std: 0.0004}}

`form` names the member of the family; left out, it is the first one below. The first parameters of a family are the
same in all its forms, and required; others have defaults. Effects combine freely. Each acts where it stands in the
chain from motor to reading, whatever the order in the file; those at the same place act in the file's order.

The pictures show one press: a staircase to 1.8 mm and back, into air, and down once more, on an exponential pad with
two relaxation modes. On the left is the force with the first form and without; in the middle what each form adds, with
the typical numbers of the tables (a few are larger, to be seen), over one step where it is brief; on the right force
over position.

"Looks like" gives the share of the cause's gain that its best rival reaches alone when the shape is exact: near 1,
only a protocol made for it tells the two apart. A plain staircase is the poorest protocol for naming; returns to the
surface, repeats, several speeds and one long hold make it rich.

This page is made by `python -m docs.effects`.
"""

RECIPE = """## A new cause in one file

Put a file into `sim/effects/`. Defining `EFFECT` registers it: model files, schemas, the simulated bench and diagnosis
find it by its id.

    \"\"\"Gain error: the force is off by a factor. Reference: …\"\"\"

    from sim.effects.base import Effect, Form, Parameter
    from sim.jit import State, block


    @block
    def gain(dt: float, force: float, state: State, p: State) -> float:
        \"\"\"Force with the error; p = (gain,).\"\"\"
        return force * (1.0 + p[0])


    EFFECT = Effect(
        id="gain_error",
        what="The force is off by a factor.",
        says="the force is {gain:percent} too {gain:large/small}",
        check="calibrate the load cell with a known weight",
        reference="…",
        forms=(
            Form(
                name="constant",
                what="at all forces",
                parameters=(
                    Parameter("gain", "1", -0.5, 0.5, 0.05, "relative error", required=True, amplitude=True),
                ),
                blocks={"sensor": gain},
            ),
        ),
    )

1. Choose the place where it acts: the table is at the top of `sim/effects/base.py`. Blocks of one effect may stand at
   several places and share their state. A form without blocks may shift times (`time_shift`) or put another pad in
   place (`amend`).
2. A block is a function of (dt, input, state, parameters) in plain arithmetic; it is compiled. It must take dt = 0.
   From `frame` to `load` it keeps all memory in `state` and is continuous in its input, as it is solved for.
3. Say what a fit needs: `amplitude` for the number that switches the effect off at 0, `starts` for shapes,
   `floor` for values that no data can show, `fixed` for choices. A lower bound above 0 means a fit on the logarithm.
   `of_motion=False` where it runs in time or stands at a level: one press and one hold then suffice for a sure name.
   A form of it that goes with the motion all the same says so. `says` is the sentence that a diagnosis prints: the
   amplitude stands in it as people read it, N and N/s in mN (`{bias:force}`, `{rate:milli}`), s in ms, shares in per
   cent (`{gain:percent}`); `sim/effects/reading.py` has the ways to write a number.
4. Give the family the shapes its physics takes, the first parameters the same in all.
5. `tests/sim/test_effects.py` (set up with `.[test]`, as in the README) tries every form by itself and in all pairs,
   and has the parameters of each effect that a user must give in `CONTRACT`: add those of yours there, and its physics
   beside, against a closed form.
6. A line in `GROUPS` of `docs/effects.py` gives it a place on this page, one in `NAMES` of `bench/diagnose/words.py`
   its name in plain words (without, it is called by its id).
"""


def page() -> str:
    """The text of docs/effects.md."""
    effects = all_effects()
    homeless = sorted(set(effects) - {name for names in GROUPS.values() for name in names})
    if homeless:
        raise ValueError(f"{', '.join(homeless)}: a line in GROUPS of docs/effects.py gives it a place on the page")
    out = [HEAD]
    for group, names in GROUPS.items():
        listed = ", ".join(f"[{name}](#{name})" for name in names)
        out.append(f"- {group}: {listed}")
    out.append("")
    for group, names in GROUPS.items():
        out += [f"## {group}", ""]
        for name in names:
            out += section(effects[name])
    return "\n".join(out) + "\n" + RECIPE


def main(argv: list[str] | None = None) -> int:
    """Write the page, and the pictures unless --text is given."""
    parser = argparse.ArgumentParser(prog="docs.effects", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--text", action="store_true", help="leave the pictures as they are")
    given = parser.parse_args(argv)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "effects.md").write_text(page(), encoding="utf-8")
    if not given.text:
        for cause in all_effects().values():
            draw(cause, given.out / "img" / "effects" / f"{cause.id}.png")
            print(cause.id, file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
