"""Clock skew: the clock that stamps the forces runs at another rate than the one that stamps the positions.

Over the time T since the first force sample the force clock counts T (1 + skew · 10⁻⁶).

- `linear`: the clocks agree at the first force sample.
- `offset`: there they differ by `offset` already (force clock ahead). Without a skew it is a delay.
- `ageing`: the skew grows or fades evenly, as of a quartz that warms up: skew · (1 + growth (t − at_time)). `at_time`
  is a choice and not fitted: the middle of the data, so that `skew` is its mean over them.
- `held`: right as long as it has its reference, up to a share `free_from` of the data, and free from there (ITU-T
  G.810, Definitions and terminology for synchronization networks: holdover). `skew` is the mean over the data, whose
  middle is `at_time`.
- `set_once`: at a share `set_at` of the data it is set, which undoes a share `undone` of what it has gained by then; it
  runs on as before, and `skew` is its rate before and after (Mills: a clock that is far off is stepped, not slewed).
  The step is spread over a hundredth of the data, so that a fit can find its way to it.
- `wandering`: the rate is skew · (1 + Σ c_k cos(kπ t/T)), k from 1 to 12, over the length T of the data, twice
  `at_time`, so that `skew` is its mean over them: warmth, a loop that seeks its reference, a leap second smeared over a
  while (ITU-T G.810: wander).

A single stamp without an array around it (a simulated device that is read out) counts from time 0.

Reference: D. L. Mills, Internet time synchronization: the network time protocol, IEEE Trans. Commun. 39, 1991,
1482–1493 (offset, skew and drift of a clock).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sim.effects.base import Array, Effect, Form, Parameter
from sim.effects.stamps import AT_TIME, HALF_TIME, WAVES, half_waves, origin


def skewed(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    begins = origin(stamp_s)
    return np.asarray(begins - values.get("offset", 0.0) + (stamp_s - begins) / (1.0 + 1e-6 * values["skew"]))


def ageing(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    begins = origin(stamp_s)
    since = stamp_s - begins
    gained = 1e-6 * values["skew"] * since * (1.0 + values["growth"] * (0.5 * since - values["at_time"]))
    return np.asarray(stamp_s - gained)


def held(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    since, span = stamp_s - origin(stamp_s), 2.0 * values["at_time"]
    free = np.maximum(since - values["free_from"] * span, 0.0) / (1.0 - values["free_from"])
    return np.asarray(stamp_s - 1e-6 * values["skew"] * free)


def set_once(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    since, span = stamp_s - origin(stamp_s), max(2.0 * values["at_time"], 1e-9)
    set_s = values["set_at"] * span
    undone = 0.5 * values["undone"] * (1.0 + np.tanh((since - set_s) / (_SET_WITHIN * span)))
    return np.asarray(stamp_s - 1e-6 * values["skew"] * (since - set_s * undone))


def wandering(values: Mapping[str, float], stamp_s: Array) -> Array:
    """When forces stamped `stamp_s` were felt, s."""
    since = stamp_s - origin(stamp_s)
    slow = 0.5 * math.pi / max(values["at_time"], 1e-9)
    more = sum(values[f"wave_{k}"] * np.sin(k * slow * since) / (k * slow) for k in range(1, WAVES + 1))
    return np.asarray(stamp_s - 1e-6 * values["skew"] * (since + more))


_SET_WITHIN = 0.01
_SET_AT = (0.2, 0.35, 0.5, 0.65, 0.8)
_SKEW = Parameter(
    "skew",
    "ppm",
    -2e4,
    2e4,
    100.0,
    "rate of the force clock minus that of the position clock",
    required=True,
    amplitude=True,
    starts=(-300.0, 300.0),
)


EFFECT = Effect(
    id="clock_skew",
    what="The clocks of force and position run at different rates.",
    says="the force clock {skew:gains/loses} {skew:size} microseconds a second on the position clock",
    check="stamp both channels with one clock, or let a common event mark both at start and end",
    reference="Mills, IEEE Trans. Commun. 39, 1991, 1482-1493",
    forms=(
        Form(name="linear", what="equal at the first sample", parameters=(_SKEW,), time_shift=skewed),
        Form(
            name="offset",
            what="apart at the first sample already",
            parameters=(
                _SKEW,
                Parameter("offset", "s", -1.0, 1.0, 0.0, "force clock minus position clock at the first force sample"),
            ),
            time_shift=skewed,
            sought=False,
        ),
        Form(
            name="ageing",
            what="ever faster or slower apart",
            parameters=(
                _SKEW,
                Parameter("growth", "1/s", -1.0, 1.0, 0.0, "relative growth of the skew", starts=(-0.02, 0.02)),
                AT_TIME,
            ),
            time_shift=ageing,
            sought=False,
        ),
        Form(
            name="held",
            what="together for a while, and apart from there",
            parameters=(
                _SKEW,
                Parameter("free_from", "1", 0.0, 0.9, 0.2, "share of the data while they agree", starts=(0.2, 0.5)),
                HALF_TIME,
            ),
            time_shift=held,
            sought=False,
        ),
        Form(
            name="set_once",
            what="ever further apart, but for once that it was set",
            parameters=(
                _SKEW,
                Parameter("undone", "1", 0.0, 1.0, 0.3, "share of its gain that was undone", starts=(0.3, 0.9)),
                Parameter("set_at", "1", 0.02, 0.98, 0.5, "share of the data at which it was set", starts=_SET_AT),
                HALF_TIME,
            ),
            time_shift=set_once,
            sought=False,
        ),
        Form(
            name="wandering",
            what="now faster and now slower apart",
            parameters=(
                _SKEW,
                *half_waves(0.5, "of the rate over the data, over `skew`"),
                HALF_TIME,
            ),
            time_shift=wandering,
            sought=False,
        ),
    ),
)
