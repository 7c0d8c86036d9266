"""Where a run's processor time goes, by layer of the program.

Two ways that check each other: cProfile counts everything but makes small calls dear; sampling looks 250 times a
second at which function is running and costs nothing, but is a draw. Time in libraries and builtins is charged to
the layer that called them.
"""

from __future__ import annotations

import cProfile
import pstats
import signal
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[2]

LAYERS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("plant (axis, pad)", ("sim/axis", "sim/kernel", "sim/pad", "sim/model", "sim/jit", "sim/effects", "sim/elastic")),
    ("simulated devices and lines", ("sim/",)),
    ("drivers and wire", ("drivers/", "pymodbus/")),
    ("recording", ("bench/recording/", "mcap/")),
    ("loop and safety", ("bench/run/", "bench/trajectory", "bench/")),
)
"""Name and what the paths of its files begin with; the first that fits."""

OTHER = "all else"
LIBRARIES = ("pymodbus/", "mcap/")
"""Installed packages that count as part of the layer they work for."""

Key = tuple[str, int, str]


def layer_of(filename: str) -> str | None:
    """The layer of a source file; None for what belongs to none by itself."""
    path = Path(filename)
    if path.is_relative_to(ROOT):
        part = path.relative_to(ROOT).as_posix()
    else:
        part = next((f"{name}{path.name}" for name in LIBRARIES if f"/{name}" in path.as_posix()), "")
    return next((layer for layer, heads in LAYERS if part.startswith(heads)), None) if part else None


def counted(job: Callable[[], object]) -> tuple[dict[str, float], list[tuple[str, int, float]]]:
    """Shares of time by layer from cProfile, and the dearest functions: name, calls, share of the time."""
    profile = cProfile.Profile()
    profile.runcall(job)
    stats: dict[Key, tuple[int, int, float, float, dict[Key, tuple[int, int, float, float]]]]
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    layers: Counter[str] = Counter()
    own: Counter[Key] = Counter()

    def charge(key: Key, seconds: float, depth: int) -> None:
        layer = layer_of(key[0])
        callers = stats[key][4]
        total = sum(entry[0] for entry in callers.values())
        if layer is None and total and depth:
            for caller, entry in callers.items():
                charge(caller, seconds * entry[0] / total, depth - 1)
            return
        layers[layer or OTHER] += seconds
        own[key] += seconds

    for key, (_, _, self_s, _, callers) in stats.items():
        if layer_of(key[0]) is None and callers:
            for caller, entry in callers.items():
                charge(caller, entry[2], 4)
        else:
            charge(key, self_s, 0)
    whole = sum(layers.values())
    dearest = [(_name(key), stats[key][1], seconds / whole) for key, seconds in own.most_common(12)]
    return {layer: seconds / whole for layer, seconds in layers.items()}, dearest


def _name(key: Key) -> str:
    path = Path(key[0])
    where = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else f"{path.parent.name}/{path.name}"
    return f"{where} {key[2]}"


def sampled(job: Callable[[], object], interval_s: float = 0.004) -> dict[str, float]:
    """Shares of processor time by layer, by looking at the running function; empty where there is no such timer."""
    if not hasattr(signal, "setitimer"):
        return {}
    seen: Counter[str] = Counter()

    def look(number: int, frame: FrameType | None) -> None:
        while frame is not None:
            layer = layer_of(frame.f_code.co_filename)
            if layer is not None:
                break
            frame = frame.f_back
        seen[layer if frame is not None and layer is not None else OTHER] += 1

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, interval_s, interval_s)
    try:
        job()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    total = sum(seen.values())
    return {layer: count / total for layer, count in seen.items()} if total else {}
