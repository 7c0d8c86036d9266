"""What several tests of commands share: the command itself, and data to give it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench import cli
from tests.bench.said import Said


@pytest.fixture
def padbench(capsys, monkeypatch, tmp_path):
    """Give a command in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def give(*words: object) -> Said:
        capsys.readouterr()
        try:
            status = cli.main([str(word) for word in words])
        except SystemExit as end:
            status = int(end.code or 0)
        printed = capsys.readouterr()
        return Said(status, printed.out, printed.err)

    return give


@pytest.fixture(scope="session")
def csv(tmp_path_factory) -> Path:
    """A fast ramp and a hold of the shipped pad, with noise, as CSV."""
    path = tmp_path_factory.mktemp("csv") / "data.csv"
    from bench.config import load_model

    t = np.arange(0, 4, 0.004)
    x = np.interp(t, [0, 0.2, 0.25, 2, 2.1, 4], [-0.2, -0.2, 1.5, 1.5, 0.4, 0.4])
    force = load_model("polyurethane").simulate(t, x) + np.random.default_rng(4).normal(0, 0.01, t.size)
    rows = zip(t, x, force, strict=True)
    path.write_text("time_s,position_mm,force_N\n" + "".join(f"{a:.4f},{b:.6f},{c:.5f}\n" for a, b, c in rows))
    return path
