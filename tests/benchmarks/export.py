"""What a step of an exported pad costs: the C header compiled, and the Python object."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from bench.export import LivePad, c_header
from sim.model import Model
from tests.benchmarks.plant import rounds
from tests.benchmarks.report import Section, Table, middle

TITLE = "An exported pad"
STEPS = 200_000
ROUNDS = 9

LAWS: dict[str, dict[str, object]] = {
    "exponential": {"law": "exponential", "m": 2.24, "b": 0.69},
    "power": {"law": "power", "p": 3.8, "q": 0.77},
    "polynomial": {"law": "polynomial", "alpha": [0.0, 1.5, 0.4, 0.2]},
    "spline": {"law": "spline", "delta_mm": [0.5, 1, 1.5, 2, 2.5], "force_N": [0.9, 2.1, 4.2, 7.5, 12]},
}
RELAXATIONS = [([], []), ([0.4], [3.0]), ([0.25, 0.15], [4.0, 0.35]), ([0.2, 0.2, 0.1, 0.1], [40.0, 4.0, 0.4, 0.04])]

HOW = f"""
Nanoseconds a step of the header that `padbench export --to c` writes, compiled -O2 by the system's compiler, over
{STEPS:,} steps of a sine that presses and lets go: with the sample time fixed in the header, and given at each step
(dt). Microseconds a step of the Python object (`bench.export.LivePad`). Median of {ROUNDS} rounds; for Python with the
fastest and the slowest.
"""

LOOP = """
#include "pad.h"
double run(int n, const double *x_mm, int fixed)
{
    static pad_state state;
    pad_real total = 0;
    int i;
    pad_reset(&state);
    if (fixed) for (i = 0; i < n; ++i) total += pad_step(&state, (pad_real)x_mm[i]);
    else for (i = 0; i < n; ++i) total += pad_step_dt(&state, (pad_real)x_mm[i], (pad_real)0.001);
    return (double)total;
}
"""


def _compiled(model: Model, double: bool, folder: Path) -> ctypes.CDLL:
    """The loop over the model's header as a library."""
    folder.mkdir()
    (folder / "pad.h").write_text(c_header(model))
    (folder / "loop.c").write_text(("#define PAD_DOUBLE\n" if double else "") + LOOP)
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", "loop.so", "loop.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "loop.so"))
    library.run.restype = ctypes.c_double
    return library


def run() -> Section:
    """Laws by numbers of modes."""
    started = time.perf_counter()
    x = 1.2 - 1.4 * np.cos(3e-3 * np.arange(STEPS))
    pointer = x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    few = x[:10_000].tolist()
    table = Table(("law", "modes", "float, ns", "float, dt, ns", "double, ns", "double, dt, ns", "Python, µs"))
    with tempfile.TemporaryDirectory() as scratch:
        for name, elastic in LAWS.items():
            for shares, rates in RELAXATIONS:
                model = Model.from_dict({"pad": {"elastic": elastic, "relaxation": {"shares": shares, "rates": rates}}})
                cells = []
                for double in (False, True):
                    if shutil.which("cc") is None:
                        cells += ["-", "-"]
                        continue
                    library = _compiled(model, double, Path(scratch) / f"{name}{len(rates)}{double}")
                    for fixed in (1, 0):
                        spans = rounds(lambda job=library.run, fixed=fixed: job(STEPS, pointer, fixed), ROUNDS)
                        cells.append(f"{1e9 * float(np.median(spans)) / STEPS:.1f}")
                live = LivePad(model)
                python = rounds(lambda live=live: [live.step(value, 1e-3) for value in few], 5)
                table.rows.append((name, str(len(rates)), *cells, middle(np.array(python) / len(few), "{:.2f}", 1e6)))
    return Section(TITLE, HOW, [table], [], time.perf_counter() - started)
