"""Which part of each measured file a diagnosis learns from, and which it is judged on; read as in data_sets.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.csv_file import read_csv
from bench.recording.types import Measurement
from docs.data_sets import SETS, plain

Array = NDArray[np.float64]

LEARNT_SHARE = 0.6
"""Of a file's force samples, the first ones, where no other run of the specimen is there to be predicted."""

MOST_SAMPLES = 40_000
"""Longer files are averaged over blocks of equal numbers of samples."""


@dataclass(frozen=True)
class Case:
    """One file: what a diagnosis learns from, and what it has to predict (by the name of the run held out)."""

    folder: str
    name: str
    learnt: Measurement
    held_out: dict[str, Measurement]


def cases(directory: Path, folder: str) -> list[tuple[str, Callable[[], Case]]]:
    """Every CSV file of a set: its name, and what makes its case (raises InputError for data that cannot be read)."""
    paths = sorted((directory / folder).glob("*.csv"))
    return [(path.name, _maker(path)) for path in paths]


def _maker(path: Path) -> Callable[[], Case]:
    def make() -> Case:
        if path.parent.name == "cascaded_tanks":
            return Case(path.parent.name, path.name, _tanks(path, "est"), {"val columns": _tanks(path, "val")})
        read = next((s.read for s in SETS if s.folder == path.parent.name), plain)
        whole = averaged(read(path))
        others = [path.with_name(other) for other in other_runs(path.parent.name, path.name)]
        if all(other.exists() for other in others) and others:
            return Case(path.parent.name, path.name, whole, {p.name: averaged(read(p)) for p in others})
        until = end_of_learning(whole)
        return Case(
            path.parent.name, path.name, first_part(whole, until), {"its end": replace(whole, fit_from_s=until)}
        )

    return make


def _tanks(path: Path, part: str) -> Measurement:
    """Pump voltage for the position, level for the force: what someone would do who does not know what they are."""
    return read_csv(path, columns={"position": f"u_{part}_V", "force": f"y_{part}_V"}).measurement()


def end_of_learning(m: Measurement) -> float:
    """Stamp at which `LEARNT_SHARE` of the force samples are past; of those below the surface, where the approach
    takes longer than that."""
    pressed = np.flatnonzero(m.position_at_forces_mm() > 0)
    if len(pressed) < 2:
        raise InputError(m.name, "the position never passes the surface (0 mm): nothing is pressed")
    last = int(LEARNT_SHARE * len(m.force_time_s))
    if pressed[0] >= last:
        last = int(pressed[int(LEARNT_SHARE * len(pressed))])
    return float(m.force_time_s[last])


def first_part(m: Measurement, until_s: float) -> Measurement:
    """The samples before `until_s`; nothing later is there to be seen."""
    position, force = m.position_time_s < until_s, m.force_time_s < until_s
    return replace(
        m,
        position_time_s=m.position_time_s[position],
        position_mm=m.position_mm[position],
        force_time_s=m.force_time_s[force],
        force_N=m.force_N[force],
    )


def averaged(m: Measurement) -> Measurement:
    """Means over blocks of k samples, k the least that leaves `MOST_SAMPLES`; what is that short is left as it is."""
    k = -(-len(m.force_N) // MOST_SAMPLES)
    if k == 1:
        return m
    return replace(
        m,
        position_time_s=_means(m.position_time_s, k),
        position_mm=_means(m.position_mm, k),
        force_time_s=_means(m.force_time_s, k),
        force_N=_means(m.force_N, k),
    )


def _means(values: Array, k: int) -> Array:
    return np.asarray(values[: len(values) // k * k].reshape(-1, k).mean(axis=1))


def other_runs(folder: str, name: str) -> tuple[str, ...]:
    """Runs that a model learnt from `name` should predict; () where the end of the file itself has to do."""
    if folder == "meat_indentation_zwick":
        return REPEATS.get(name.removesuffix(".csv"), ())
    return OTHERS.get((folder, name), ())


def _repeats() -> dict[str, tuple[str, ...]]:
    """Meat: the letters of one piece are its repeats; each is predicted from the one beside it (A and B, C and D)."""
    couples = [(f"230327_{piece}A", f"230327_{piece}B") for piece in ("FF1_1", "FF1_2", "FF2_1", "RDG15", "RDG1_7")]
    couples += [(f"230327_{piece}A", f"230327_{piece}B") for piece in ("RDG2_1", "RDG2_2")]
    couples += [("230403_230403-FF1A", "230403_230403-FF1b"), ("230403_230403-FF1C", "230403_230403-FF1D")]
    for piece in ("230403_230403-FF2", "230403_230403-RDG1"):
        couples += [(f"{piece}A", f"{piece}B"), (f"{piece}C", f"{piece}D")]
    return {a: (f"{b}.csv",) for one, other in couples for a, b in ((one, other), (other, one))}


REPEATS = _repeats()

OTHERS = {
    ("vhb4910", "loadunload_rate0d01_2d0.csv"): ("loadunload_rate0d03_2d0_1.csv",),
    ("vhb4910", "loadunload_rate0d03_2d0_1.csv"): ("loadunload_rate0d03_2d0_2.csv", "loadunload_rate0d01_2d0.csv"),
    ("vhb4910", "loadunload_rate0d03_2d0_2.csv"): ("loadunload_rate0d03_2d0_1.csv", "loadunload_rate0d01_2d0.csv"),
    ("vhb4910", "loadunload_rate0d03_3d0.csv"): ("loadunload_rate0d03_2d0_1.csv", "loadunload_rate0d01_2d0.csv"),
    ("vhb4910", "relax_stretch3d0.csv"): ("relax_stretch1d5.csv",),
    ("vhb4910", "relax_stretch4d0.csv"): ("relax_stretch3d0.csv",),
    ("oca_adhesive_shear", "shear_relaxation_0d1.csv"): ("shear_relaxation_1.csv",),
    ("oca_adhesive_shear", "shear_relaxation_1.csv"): ("shear_relaxation_0d1.csv",),
    ("muscle_ramp_hold", "AvgRelaxed_0.1s.csv"): ("AvgRelaxed_1s.csv",),
    ("muscle_ramp_hold", "AvgRelaxed_1s.csv"): ("AvgRelaxed_0.1s.csv", "AvgRelaxed_10s.csv"),
    ("muscle_ramp_hold", "AvgRelaxed_10s.csv"): ("AvgRelaxed_1s.csv", "AvgRelaxed_100s.csv"),
    ("muscle_ramp_hold", "AvgRelaxed_100s.csv"): ("AvgRelaxed_10s.csv",),
}
"""Other sets with several runs of one material: never one that goes further than what was learnt."""
