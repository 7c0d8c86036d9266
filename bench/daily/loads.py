"""Readings of known loads: from the bench, with a person who puts them on, or from a file of readings taken before."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from bench.daily.dead_weights import Reading
from bench.daily.open_bench import OpenBench
from bench.daily.words import NEWTONS_PER_KG
from bench.errors import InputError, Refused
from bench.run.loop import Script
from bench.run.touchoff import air_of
from bench.yamlfile import read_text
from drivers.errors import DriverError
from sim.world import World

SETTLE_S = 0.5
"""A weight that was just put down swings: so long is waited before it is read."""

Ask = Callable[[str], str]


def parse_loads(text: str, option: str, unit_N: float) -> list[float]:
    """`0,0.1,0.2` as newtons; raises `InputError` at the option."""
    try:
        loads = [float(word) * unit_N for word in text.split(",")]
    except ValueError:
        raise InputError(option, f"`{text}` is no list of numbers", "write them with commas: 0,0.1,0.2") from None
    if not all(math.isfinite(load) and load >= 0 for load in loads):
        raise InputError(option, "a load is a finite number, not below 0", "0 is the cell with nothing on it")
    if len(set(loads)) < 3:
        raise InputError(option, "three different loads are the least that shows a line", "with 0 first: 0,0.1,0.2")
    return loads


def too_heavy(loads: Sequence[float], most_N: float, what: str, option: str) -> None:
    """Raises `InputError` where a load is beyond what the cell may carry."""
    if max(loads) >= most_N:
        message = f"{max(loads):.4g} N is not under {what} {most_N:g} N"
        raise InputError(option, message, "the heaviest weight must be lighter than that")


def read_loads(work: OpenBench, loads: Sequence[float], seconds: float, ask: Ask | None) -> list[Reading]:
    """Have each load put on, and read it. Without `ask` nobody is asked: on a simulated bench the weights put
    themselves on.

    Answers: Enter when the load is on, `r` to read the last one again, `q` to leave. Raises `Refused` on `q`.
    """
    readings: list[Reading] = []
    while len(readings) < len(loads):
        load_N = loads[len(readings)]
        if ask is not None:
            what = f"{load_N:.4f} N ({1e3 * load_N / NEWTONS_PER_KG:.2f} g)" if load_N else "nothing"
            back = ", r: the last one again" if readings else ""
            answer = ask(f"[{len(readings) + 1} of {len(loads)}] put {what} on the cell, then Enter (q: leave{back}):")
            if answer.lower() == "q":
                raise Refused("left before all loads were read; the bench file is as it was")
            if answer.lower() == "r" and readings:
                readings.pop()
                continue
        if work.rig.world is not None:
            put_on(work.rig.world, load_N)
        readings.append(work.look(_read(work, load_N, seconds)))
    return readings


def _read(work: OpenBench, load_N: float, seconds: float) -> Script[Reading]:
    try:
        _, channel = yield from work.listen(seconds, SETTLE_S)
    except DriverError as error:
        raise InputError(work.bench.place((error.device,)), str(error)) from error
    if channel.flagged.any():
        raise Refused(f"the load cell reports overload under {load_N:.4g} N; take the weight off")
    if channel.gross_N.size < 8:
        raise Refused(f"only {channel.gross_N.size} readings came in {seconds:g} s; raise the rate, or read longer")
    air = air_of(channel.time_s, channel.gross_N)
    return Reading(load_N, float(np.mean(channel.gross_N)), air.sigma_N, air.samples, air.drift_N_s)


class _Weight:
    """Noise with a weight on it: the simulated amplifier adds what it draws to the force it feels."""

    def __init__(self, noise: object, force_N: float) -> None:
        self.noise = noise
        self.force_N = force_N

    def draw(self) -> float:
        """The next number of the noise, and the weight."""
        return float(self.noise.draw()) + self.force_N  # type: ignore[attr-defined]  # a GaussianNoise


def put_on(world: World, force_N: float) -> None:
    """Put a dead weight on the simulated load cell, in place of the one before."""
    amplifier = getattr(world.devices["load_cell"], "amplifier", None)
    if amplifier is None:
        raise Refused("no weight can be put on this simulated load cell; give readings by --readings FILE")
    noise = amplifier.noise
    amplifier.noise = _Weight(noise.noise if isinstance(noise, _Weight) else noise, force_N)


def read_file(path: Path) -> list[Reading]:
    """Readings from a CSV: `reading_N` and one of `weight_kg`, `force_N`; optional `noise_N`, `samples`.

    Raises `InputError` with the line.
    """
    rows = list(csv.reader(io.StringIO(read_text(path))))
    head = [name.strip() for name in rows[0]] if rows else []
    load = next((name for name in ("force_N", "weight_kg") if name in head), None)
    if load is None or "reading_N" not in head:
        raise InputError(
            f"{path}:1", "the first line must name the columns reading_N and force_N or weight_kg",
            "reading_N is the force as the bench file's present scale and sign make it",
        )  # fmt: skip
    unit_N = NEWTONS_PER_KG if load == "weight_kg" else 1.0
    readings = []
    for number, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        cells = dict(zip(head, (cell.strip() for cell in row), strict=False))
        readings.append(
            Reading(
                _number(cells, load, path, number) * unit_N,
                _number(cells, "reading_N", path, number),
                _number(cells, "noise_N", path, number) if cells.get("noise_N") else math.nan,
                int(_number(cells, "samples", path, number)) if cells.get("samples") else 0,
            )
        )
    return readings


def _number(cells: dict[str, str], name: str, path: Path, line: int) -> float:
    try:
        value = float(cells[name])
    except (KeyError, ValueError):
        raise InputError(f"{path}:{line}", f"{name}: `{cells.get(name, '')}` is no number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{line}", f"{name}: must be a finite number")
    return value
