"""Which cases a campaign draws. Each is decided by the campaign's seed, its group, its ids and its number in the group.

A larger campaign of the same seed holds the smaller one, so that a file of results can be carried on. The two halves
of the shapes have cases of their own; those with nothing hidden are the same for both.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tests.truth.cases import NOISES, Case, draw_case
from tests.truth.effects import EFFECTS, HALVES

CATALOGUE = (
    *("frame_compliance", "backlash", "contact_offset", "friction", "inertia", "resonance", "cogging", "force_delay"),
    *("clock_skew", "sensor_lag", "force_bias", "force_drift", "mains_hum", "saturation", "outliers", "stuck_samples"),
    *("encoder_error", "separation", "adhesion", "elastic_law", "stress_softening", "damage", "permanent_set"),
    *("missing_relaxation_mode", "depth_dependent_relaxation", "viscous_damping"),
)
"""The ids that a diagnosis can name (docs/formats.md). What else is registered with the truth lies outside."""

GROUPS = ("single", "large", "null", "pair", "outside")
LARGE = 2.5
"""Times the typical size."""

SIZES = {"single": (0.05, 2.5), "large": (LARGE, LARGE), "pair": (0.5, 2.0), "outside": (0.5, 2.5)}
"""Log-uniform between these, times the typical size."""

SERVO_S = (0.001, 0.004)
"""Time constants of servos."""

MEMORY = (1.0, 6.0)
"""Samples over which noise of an encoder that filters lasts."""


@dataclass(frozen=True)
class Item:
    """One case to be drawn; `noise` is given where the group goes through the kinds, else the seed draws it."""

    group: str
    ids: tuple[str, ...]
    shapes: tuple[str, ...]
    sizes: tuple[float, ...]
    seed: int
    noise: str | None = None
    half: str = "first"

    @property
    def key(self) -> str:
        """What a line of the results is known by."""
        what = "+".join(self.ids) or str(self.noise)
        how = "+".join(f"{shape}@{size:.3g}" for shape, size in zip(self.shapes, self.sizes, strict=True)) or "-"
        return f"{self.group}/{what}/{how}/{self.seed}"

    def case(self) -> Case:
        """Draw it. In every other one the motor follows its command late, as servos do; in every fourth noise of the
        position has a memory."""
        told: dict[str, Any] = {} if self.noise is None else {"noise_kind": self.noise}
        rng = _stream(self.seed, "servo", "", 0)
        told |= {"servo_s": float(rng.uniform(*SERVO_S))} if rng.random() < 0.5 else {}
        rng = _stream(self.seed, "encoder", "", 0)
        told |= {"position_memory": float(rng.uniform(*MEMORY))} if rng.random() < 0.25 else {}
        sizes, shapes = (dict(zip(self.ids, values, strict=True)) for values in (self.sizes, self.shapes))
        return draw_case(self.seed, self.ids, sizes, shapes, **told)

    def to_json(self) -> dict[str, Any]:
        """As it stands in a line of the results."""
        return asdict(self)

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> Item:
        """The other way."""
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in content.items()})


def _stream(seed: int, group: str, what: str, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(f"{group}/{what}".encode()), number])


def _item(
    group: str,
    ids: tuple[str, ...],
    number: int,
    rng: np.random.Generator,
    noise: str | None = None,
    half: str = "first",
) -> Item:
    low, high = np.log(SIZES.get(group, (1.0, 1.0)))
    sizes = tuple(float(f"{np.exp(rng.uniform(low, high)):.4g}") for _ in ids)
    # A single id goes through its shapes in turn, from another one for each id; in company they are drawn.
    turn = number + zlib.crc32(f"{group}/{ids}".encode())
    known = [EFFECTS[id].of(half) for id in ids]
    shapes = tuple(own[turn % len(own)] if len(ids) == 1 else str(rng.choice(own)) for own in known)
    return Item(group, ids, shapes, sizes, int(rng.integers(2**31)), noise, half)


def _compatible(first: str, second: str) -> bool:
    a, b = EFFECTS[first], EFFECTS[second]
    laws = a.laws is None or b.laws is None or bool(set(a.laws) & set(b.laws))
    return laws and (a.contact is None or b.contact is None or a.contact == b.contact)


def catalogued(half: str) -> list[str]:
    """Ids of the catalogue that have shapes of a half."""
    return [id for id in CATALOGUE if id in EFFECTS and EFFECTS[id].of(half)]


def _pair(rng: np.random.Generator, half: str) -> tuple[str, str]:
    known = catalogued(half)
    while True:
        first, second = sorted(str(id) for id in rng.choice(known, 2, replace=False))
        if _compatible(first, second):
            return first, second


def plan(
    seed: int,
    single: int,
    large: int,
    null: int,
    pairs: int,
    outside: int,
    ids: Iterable[str] = (),
    half: str = "first",
) -> list[Item]:
    """Cases in an order in which all groups go forward together: `single`, `large` for each id, the others in all.

    `ids`: cases of these alone (null cases then only where no id is named). `half`: of the shapes; `both` has as many
    cases of either.
    """
    wanted = set(ids)
    nulls = [_item("null", (), k, _stream(seed, "null", "", k), NOISES[k % len(NOISES)]) for k in range(null)]
    placed = [((k + 0.5) / null, item) for k, item in enumerate(nulls)]
    for name in HALVES if half == "both" else (half,):
        placed += _hidden(seed, {"single": single, "large": large, "pair": pairs, "outside": outside}, name)
    placed.sort(key=lambda pair: (pair[0], GROUPS.index(pair[1].group)))
    return [item for _, item in placed if not wanted or wanted & set(item.ids)]


def _hidden(seed: int, counts: dict[str, int], half: str) -> list[tuple[float, Item]]:
    """Cases of one half with something hidden, each with how far on in its group it stands."""
    # The first half was there before there were two: its streams go by the group alone.
    label = "" if half == "first" else f"{half}/"
    known, placed = catalogued(half), []
    beyond = sorted(id for id in set(EFFECTS) - set(CATALOGUE) if EFFECTS[id].of(half))

    def stream(group: str, what: str, number: int) -> np.random.Generator:
        return _stream(seed, label + group, what, number)

    def place(count: int, made: Iterable[Item]) -> None:
        placed.extend(((k + 0.5) / count, item) for k, item in enumerate(made))

    for group in ("single", "large"):
        rounds = (
            _item(group, (id,), number, stream(group, id, number), half=half)
            for number in range(counts[group])
            # Left as numpy's strings: how they are printed goes into which shape a case has.
            for id in stream(group, "order", number).permutation(known)
        )
        place(counts[group] * len(known), rounds)
    drawn = (stream("pair", "", k) for k in range(counts["pair"]))
    place(counts["pair"], (_item("pair", _pair(rng, half), k, rng, half=half) for k, rng in enumerate(drawn)))
    turns = ((k, beyond[k % len(beyond)]) for k in range(counts["outside"] if beyond else 0))
    place(
        counts["outside"],
        (_item("outside", (id,), k // len(beyond), stream("outside", id, k), half=half) for k, id in turns),
    )
    return placed
