"""Force delay: a force sample was felt `delay` before its stamp, for transport, conversion or filtering on the way.

Exact at any delay: the plant is run at the instants when the forces were felt, between samples of the position.

Reference: L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999 (dead time).
"""

from __future__ import annotations

from collections.abc import Mapping

from sim.effects.base import Array, Effect, Form, Parameter


def late(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    return stamp_s - values["delay"]


EFFECT = Effect(
    id="force_delay",
    what="The force is stamped late against the position.",
    says="the force comes {delay:.4g} s after the position it belongs to",
    check="measure both delays with `padbench doctor`; look at filter settings and polling of the load cell",
    reference="Ljung, System Identification, 2nd ed., 1999",
    forms=(
        Form(
            name="constant",
            what="the same for every sample",
            parameters=(
                Parameter(
                    "delay",
                    "s",
                    0.0,
                    1.0,
                    0.004,
                    "stamp of a force minus when it was felt, against the same of the position",
                    required=True,
                    amplitude=True,
                    floor=("sample_s", 0.05),
                    starts=(0.001, 0.004, 0.015),
                ),
            ),
            time_shift=late,
        ),
    ),
)
