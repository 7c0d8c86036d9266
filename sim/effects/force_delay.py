"""Force delay: a force sample was felt `delay` before its stamp, for transport, conversion or filtering on the way.

- `constant`: the same for every sample.
- `wandering`: delay · (1 + Σ c_k cos(kπ t/T)), k from 1 to 12, over the length T of the data, as of a network that is
  now more and now less busy (V. Paxson, End-to-end internet packet dynamics, IEEE/ACM Trans. Netw. 7, 1999, 277–292).
  `at_time` is the middle of the data, T/2, so that `delay` is its mean over them.
- `reconnected`: delay, and delay · (1 + changes) from some time on: a link that was set up anew, a queue that has been
  emptied; it goes over within `within` (time constant of a logistic curve).

Exact at any delay: the plant is run at the instants when the forces were felt, between samples of the position.

Reference: L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999 (dead time).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sim.effects.base import Array, Effect, Form, Parameter
from sim.effects.stamps import HALF_TIME, WAVES, half_waves, origin


def late(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    return stamp_s - values["delay"]


def wandering(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    since = stamp_s - origin(stamp_s)
    angle = 0.5 * math.pi * since / max(values["at_time"], 1e-9)
    more = sum(values[f"wave_{k}"] * np.cos(k * angle) for k in range(1, WAVES + 1))
    return np.asarray(stamp_s - values["delay"] * np.maximum(1.0 + more, 0.0))


def reconnected(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    since = stamp_s - origin(stamp_s)
    after = 0.5 + 0.5 * np.tanh(0.5 * (since - values["moved_at"]) / values["within"])
    return np.asarray(stamp_s - values["delay"] * (1.0 + values["changes"] * after))


_DELAY = Parameter(
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
)


EFFECT = Effect(
    id="force_delay",
    what="The force is stamped late against the position.",
    says="the force comes {delay:milli} ms {delay:after/before} the position it belongs to",
    check="measure both delays with `padbench doctor`; look at filter settings and polling of the load cell",
    reference="Ljung, System Identification, 2nd ed., 1999",
    forms=(
        Form(name="constant", what="the same for every sample", parameters=(_DELAY,), time_shift=late),
        Form(
            name="wandering",
            what="now more and now less, as a network's",
            parameters=(
                _DELAY,
                *half_waves(0.25, "over the data, over `delay`"),
                HALF_TIME,
            ),
            time_shift=wandering,
            sought=False,
        ),
        Form(
            name="reconnected",
            what="another one from some time on",
            parameters=(
                _DELAY,
                Parameter("changes", "1", -1.0, 5.0, 0.3, "by how much, over `delay`", starts=(-0.3, 0.3)),
                Parameter("moved_at", "s", 0.0, 1e6, 30.0, "time at which it changes, from the first sample on"),
                Parameter("within", "s", 1e-3, 10.0, 0.1, "time constant of the change"),
            ),
            time_shift=reconnected,
            sought=False,
        ),
    ),
)
