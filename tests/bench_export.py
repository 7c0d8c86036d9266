"""What a step of an exported pad costs: `python -m tests.bench_export`.

Prints nanoseconds a step of the C header, compiled -O2 by the system's compiler, for laws and numbers of modes, in
float and double, fixed step and free; and microseconds a step of the Python object. The best of several runs counts.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from bench.export import LivePad, c_header
from sim.model import Model
from tests.bench_plant import best

STEPS = 1_000_000

LAWS: dict[str, dict[str, object]] = {
    "exponential": {"law": "exponential", "m": 2.24, "b": 0.69},
    "power": {"law": "power", "p": 3.8, "q": 0.77},
    "polynomial": {"law": "polynomial", "alpha": [0.0, 1.5, 0.4, 0.2]},
    "spline": {"law": "spline", "delta_mm": [0.5, 1, 1.5, 2, 2.5], "force_N": [0.9, 2.1, 4.2, 7.5, 12]},
}
RELAXATIONS = [([], []), ([0.4], [3.0]), ([0.25, 0.15], [4.0, 0.35]), ([0.2, 0.2, 0.1, 0.1], [40.0, 4.0, 0.4, 0.04])]

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


def compiled(model: Model, double: bool, folder: Path) -> ctypes.CDLL:
    """The loop over the model's header as a library."""
    folder.mkdir()
    (folder / "pad.h").write_text(c_header(model))
    (folder / "loop.c").write_text(("#define PAD_DOUBLE\n" if double else "") + LOOP)
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", "loop.so", "loop.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "loop.so"))
    library.run.restype = ctypes.c_double
    return library


def main() -> None:
    """Print the table."""
    x = 1.2 - 1.4 * np.cos(3e-3 * np.arange(STEPS))  # presses, lets go, comes back
    pointer = x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    few = x[:20_000].tolist()
    print(f"{'law':12} modes   float ns  (dt)   double ns  (dt)   Python us")
    with tempfile.TemporaryDirectory() as scratch:
        for name, elastic in LAWS.items():
            for shares, rates in RELAXATIONS:
                pad = {"elastic": elastic, "relaxation": {"shares": shares, "rates": rates}}
                model = Model.from_dict({"pad": pad})
                cells = []
                for double in (False, True):
                    if shutil.which("cc") is None:
                        cells += ["-", "-"]
                        continue
                    library = compiled(model, double, Path(scratch) / f"{name}{len(rates)}{double}")
                    for fixed in (1, 0):
                        seconds = best(lambda job=library.run, fixed=fixed: job(STEPS, pointer, fixed), 5)
                        cells.append(f"{1e9 * seconds / STEPS:.1f}")
                live = LivePad(model)
                python = best(lambda live=live: [live.step(value, 1e-3) for value in few], 3) / len(few)
                print(
                    f"{name:12} {len(rates):5}   {cells[0]:>8}  {cells[1]:>5}   {cells[2]:>8}  {cells[3]:>5}   "
                    f"{1e6 * python:9.2f}"
                )


if __name__ == "__main__":
    main()
