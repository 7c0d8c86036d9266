"""Linear algebra in one thread. Its matrices are small here: several threads cost more than they give, and workers side
by side would wait for each other's.

The libraries read this when they are loaded: it is said before numpy is imported.
"""

from __future__ import annotations

import os

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
"""What the environment says for it."""


def one_thread() -> None:
    """In this process and its children, where the environment says nothing else."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
