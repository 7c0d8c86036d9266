"""Which set a shape is of, by its module: `second_…`, `third_…` and so on, `judge_…`, else `first`."""

from .effects import EFFECTS
from .effects.registry import _FIRST, _JUDGE, _MORE, Hide

SETS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "judge")


def _set(hide: Hide) -> str:
    prefix = hide.__module__.rsplit(".", 1)[-1].split("_")[0]
    return prefix if prefix in SETS else "first"


def shapes_of(id: str, *sets: str) -> tuple[str, ...]:
    """The shapes of an id that are of these sets, in the order of registration."""
    first = dict.fromkeys((*_FIRST[id].shapes, *_FIRST[id].judge), _FIRST[id].hide)
    written = first | _MORE.get(id, {}) | _JUDGE.get(id, {})
    return tuple(shape for shape, hide in written.items() if _set(hide) in sets)


def written_in(ids: tuple[str, ...], *sets: str) -> list[tuple[str, str]]:
    """Pairs of id and shape of these sets."""
    return [(id, shape) for id in ids for shape in shapes_of(id, *sets)]


def outside(catalogue: tuple[str, ...], *sets: str) -> list[str]:
    """Ids beyond the catalogue that have a shape of these sets."""
    return sorted(id for id in set(EFFECTS) - set(catalogue) if shapes_of(id, *sets))
