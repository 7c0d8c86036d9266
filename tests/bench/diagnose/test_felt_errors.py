"""How far off the motion as felt may be: what is drawn is what it is off by, and friction that it hides is no cause."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.config import load_model
from bench.diagnose import diagnose
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.felt_errors import felt_errors, redrawn
from bench.diagnose.refit import force_at, refit
from bench.identify.motion import holds
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.test_shapes import fitted
from tests.bench.run.benches import SHORT, run

Array = NDArray[np.float64]

RATE_HZ, NOISE_MM, STEP_MM = 1000.0, 5e-4, 1e-3


def settling(t: Array) -> Array:
    """Depth, mm: eight moves of 0.25 mm that a servo overshoots by some micrometres and creeps back from."""
    x = np.zeros(len(t))
    for k in range(8):
        since = np.maximum(t - 1.0 - k, 0.0)
        ramp = np.clip(since / 0.01, 0.0, 1.0)
        after = np.maximum(since - 0.01, 0.0)
        swing = 0.015 * np.exp(-after / 0.004) * np.sin(after / 0.002)
        creep = 0.012 * (np.exp(-after / 0.033) - np.exp(-after / 0.005))
        x += (0.25 if k < 4 else -0.25) * ramp + swing - creep
    return x


def means(errors_mm: Array, inside: NDArray[np.bool_]) -> Array:
    """Of errors (…, n), over each ten samples of those inside: what a slider feels."""
    picked = errors_mm[..., inside]
    whole = picked.shape[-1] // 10 * 10
    return np.asarray(picked[..., :whole].reshape(*picked.shape[:-1], -1, 10).mean(axis=-1))


@pytest.mark.long
@pytest.mark.parametrize("step_mm", [pytest.param(0.0, marks=pytest.mark.long), STEP_MM])
def test_errors_are_drawn_as_large_as_they_are(step_mm: float) -> None:
    """Where a servo settles a window bends what it smooths, and neighbours are off together."""
    t = np.arange(0.0, 10.0, 1.0 / RATE_HZ)
    x = settling(t)
    inside = (np.mod(t, 1.0) > 0.012) & (np.mod(t, 1.0) < 0.1) & (t > 1.0) & (t < 9.0)
    real, drawn = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        read = x + NOISE_MM * rng.standard_normal(len(t))
        read = step_mm * np.round(read / step_mm) if step_mm else read
        force = 2.0 * np.maximum(x, 0.0) + 0.01 * rng.standard_normal(len(t))
        p = prepare(Measurement("drawn", t, read, t, force), np.ones(len(t), dtype=bool))
        felt_mm = np.interp(t, p.full.time_s, p.full.position_mm)
        real.append(means(felt_mm - x, inside))
        drawn.append(means(redrawn(p, rng), inside))
    off, told = np.sqrt(np.mean(np.square(real))), np.sqrt(np.mean(np.square(drawn)))
    assert 0.7 * off < told < 1.8 * off


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.long)])
def test_rests_that_a_fit_meets_are_not_in_doubt(seed: int) -> None:
    """Errors that are drawn turn a slider round where a planned move comes to rest; the motion itself does not."""
    _, prepared, fit = fitted("friction", "coulomb", "coulomb", 2.5, seed, protocol="random_steps", rate_hz=200.0)
    felt, data = felt_errors(prepared, fit, redrawn(prepared, np.random.default_rng(seed))), prepared.full
    resting = np.zeros(data.size, dtype=bool)
    for hold in holds(data.time_s, data.position_mm):
        resting[hold] = data.weight[hold] > 0.0
    assert np.median(felt.total_N[resting]) < prepared.noise.force_N


def test_a_rest_that_friction_holds_is_off_by_no_more_than_said(tmp_path: Path) -> None:
    """Its mean is told to a fiftieth of the noise: what a tenth of a micrometre makes of a slider's spring is more."""
    pad = load_model("polyurethane").to_dict()["pad"]
    model = {"pad": pad, "effects": [{"id": "friction", "form": "coulomb", "coulomb": 0.05}]}
    truth = tmp_path / "truth.yaml"
    truth.write_text(json.dumps(model))
    stairs = [{"to": to, "speed": 20, "hold": 1.5} for to in (0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6)]
    off = []
    for seed in range(1, 4):
        folder = tmp_path / str(seed)
        folder.mkdir()
        done = run(folder, {**SHORT, "steps": stairs}, simulation={"pad": str(truth), "seed": seed})
        m = done.recording.measurement()
        p = prepare(m, np.ones(len(m.force_N), dtype=bool))
        structure = believed_structure(Model.from_dict(model), p)
        fit = refit(p.short, structure, structure.x(structure.pad.x()), 30, 1e-8)
        told = felt_errors(p, fit, redrawn(p, np.random.default_rng(seed))).shared_N
        left = p.full.force_N - force_at(p.full, fit.structure, fit.x)
        for hold in holds(p.full.time_s, p.full.position_mm):
            counted = np.flatnonzero(p.full.weight[hold]) + hold.start
            if len(counted) > 200:
                std = np.hypot(told[counted].mean(), p.noise.force_N / np.sqrt(len(counted)))
                off.append(left[counted].mean() / std)
    assert len(off) > 10
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.6, off


@pytest.mark.long
def test_friction_in_a_servo_that_settles_is_friction_alone(tmp_path_factory) -> None:
    """On the simulated bench: the last micrometres before rest decide which way it holds, and noise hides them."""
    pad = load_model("polyurethane").to_dict()["pad"]
    named = []
    for seed in range(1, 5):
        folder = tmp_path_factory.mktemp("settles")
        truth = folder / "truth.yaml"
        truth.write_text(json.dumps({"pad": pad, "effects": [{"id": "friction", "coulomb": 0.15}]}))
        done = run(folder, SHORT, simulation={"pad": str(truth), "seed": seed})
        told = diagnose(done.recording.measurement(), Model.from_dict({"pad": pad}))
        named.append((told.verdict, [c.id for c in told.causes]))
    assert named.count(("explained", ["friction"])) >= 3, named
