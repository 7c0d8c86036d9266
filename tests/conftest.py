"""Before anything else of a test run: linear algebra in one thread, as the commands have it."""

import os

for library in ("OPENBLAS", "OMP", "MKL"):  # workers side by side, each with a thread for every core, wait for cores
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
