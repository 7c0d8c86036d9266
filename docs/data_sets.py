"""The measured data sets that real_data.py shows, and how each is read. All knowledge of a file stands here.

Nothing is tuned to a file: the steps are those its provenance asks for (columns, known springs, samples to drop), and
the fit is the default one for all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from bench.identify.prepare import baseline_removed, contact_of, indentation, surface_at
from bench.recording.csv_file import read_csv
from bench.recording.types import Measurement


@dataclass(frozen=True)
class DataSet:
    """`folder` in the data directory; what it is; how its files are read; `unit`: of the force column of the table."""

    folder: str
    title: str
    reading: str
    read: Callable[[Path], Measurement]
    unit: str = "N"
    scale: float = 1.0


def plain(path: Path) -> Measurement:
    """time_s, position_mm, force_N as they stand."""
    return read_csv(path).measurement()


def strain_and_stress(path: Path) -> Measurement:
    """Strain as mm, stress as N: a specimen of 1 mm and 1 m²."""
    return read_csv(path, columns={"position": "strain", "force": "stress_Pa"}).measurement()


def without_first(path: Path) -> Measurement:
    """The first 15 samples dropped, as its authors say."""
    m = read_csv(path).measurement()
    n = 15
    return replace(
        m,
        position_time_s=m.position_time_s[n:],
        position_mm=m.position_mm[n:],
        force_time_s=m.force_time_s[n:],
        force_N=m.force_N[n:],
    )


def cantilever(path: Path) -> Measurement:
    """AFM, piezo position: baseline off, bending of the cantilever off, surface where the force starts to rise."""
    stiffness_N_mm = {"force-save-JPK-3h.csv": 52.91e-3, "multi1.csv": 0.12e-3}[path.name]
    m = read_csv(path).measurement()
    m = indentation(baseline_removed(m, contact_of(m)), stiffness_N_mm)
    return surface_at(m, contact_of(m))


def tip(path: Path) -> Measurement:
    """AFM, tip position: baseline off, surface where the force starts to rise."""
    m = read_csv(path).measurement()
    contact = contact_of(m)
    return surface_at(baseline_removed(m, contact), contact)


AS_IT_IS = "As they stand: `time_s`, `position_mm`, `force_N`."

SETS = (
    DataSet("meat_indentation_zwick", "Raw meat, indentation, ramp and hold", AS_IT_IS, plain, "mN", 1e3),
    DataSet(
        "silicone_stretcher",
        "Silicone strips in tension, steps, cycles, sawtooth",
        AS_IT_IS,
        plain,
        "mN",
        1e3,
    ),
    DataSet("vhb4910", "VHB 4910 acrylic in tension, relaxation and load-unload", AS_IT_IS, plain, "mN", 1e3),
    DataSet("oca_adhesive_shear", "Optically clear adhesive in shear, ramps and holds", AS_IT_IS, plain, "mN", 1e3),
    DataSet(
        "muscle_ramp_hold",
        "Relaxed skinned muscle, ramp and hold",
        "Strain for the position (mm of a 1 mm specimen), stress for the force (N on 1 m²).",
        strain_and_stress,
        "N",
    ),
    DataSet(
        "afm_relaxation_jpk",
        "AFM on soft samples, holds at constant height",
        "Baseline before contact subtracted (a line over position); bending of the cantilever (its stiffness is given)"
        " taken off the position; surface where the force starts to rise (`bench.identify.prepare`).",
        cantilever,
        "nN",
        1e9,
    ),
    DataSet(
        "afm_cells_jpk",
        "AFM on cells, approach and retract",
        "Baseline before contact subtracted (a line over position); surface where the force starts to rise.",
        tip,
        "nN",
        1e9,
    ),
    DataSet("emps_linear_axis", "Motor axis with dry friction (no pad)", AS_IT_IS, plain),
    DataSet(
        "pneumatic_cylinder_friction",
        "Friction of pneumatic cylinders (no pad)",
        "The first 15 samples dropped, as their authors say.",
        without_first,
    ),
)

LEFT_OUT = {
    "cascaded_tanks": "two water tanks: a pump voltage and a level, neither a force nor a displacement",
    "relaxation_modulus_pyrheo": "relaxation moduli against time, computed by a rheometer: the displacement is not in"
    " the files, and the ramp is not resolved",
}
