"""A synthetic run with closed-form forces: an exponential pad with two relaxation modes, sampled like a bench."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench.recording.types import Event, ForceChannel, MotorChannel, Recording, StepMark
from bench.report import Curve, Evidence, FitView

Array = NDArray[np.float64]

M, B = 2.24, 0.69
SHARES, RATES = (0.6, 0.25, 0.15), (0.0, 4.0, 0.35)
SURFACE = 3.217
NOISE = 0.012


def corners() -> tuple[Array, Array, list[StepMark]]:
    """Corner times and depths of a staircase up and down, with its step marks."""
    t, x = [0.0, 2.0, 3.0], [-1.5, -1.5, -0.5]
    marks = [StepMark(0.0, "tare", "tare", "air"), StepMark(2.0, "approach", "approach", "ramp", 0.0, 2.0)]
    marks.append(StepMark(3.0, "precondition[0]", "precondition", "ramp", 2.0, 20.0))
    for _ in range(3):
        for depth in (2.0, 0.0):
            t.append(t[-1] + abs(depth - x[-1]) / 20.0)
            x.append(depth)
    t.append(t[-1] + 5.0)
    x.append(0.0)
    for i, depth in enumerate((0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6, 0.0)):
        marks.append(StepMark(t[-1], f"steps[{i}]", "steps", "ramp", depth, 80.0))
        t.append(t[-1] + abs(depth - x[-1]) / 80.0)
        x.append(depth)
        marks.append(StepMark(t[-1], f"steps[{i}]", "steps", "hold", depth))
        t.append(t[-1] + 4.0)
        x.append(depth)
    marks.append(StepMark(t[-1], "finish", "finish", "air", -0.5, 5.0))
    t += [t[-1] + 0.1, t[-1] + 3.1]
    x += [-0.5, -0.5]
    return np.array(t), np.array(x), marks


def elastic(depth: Array) -> Array:
    """The elastic response (9) in N."""
    return np.where(depth > 0, M / B * np.expm1(B * np.maximum(depth, 0.0)), 0.0)


def response(t: Array, depth: Array) -> Array:
    """Force of the pad on an even grid, F^e linear between samples (bonded)."""
    f = elastic(depth)
    dt = float(t[1] - t[0])
    rise = np.diff(f, prepend=f[0]) / dt
    total = SHARES[0] * f
    for c, nu in zip(SHARES[1:], RATES[1:], strict=True):
        decay = np.exp(-nu * dt)
        total = total + lfilter([c * (1.0 - decay) / nu], [1.0, -decay], rise)
    return np.asarray(total)


def recording(rate_Hz: float = 1000.0, force_rate_Hz: float = 550.0, seed: int = 1, **changes: Any) -> Recording:
    """A finished run of some 43 s."""
    random = np.random.default_rng(seed)
    ct, cx, marks = corners()
    t = np.arange(0.0, ct[-1], 1.0 / rate_Hz)
    command = np.interp(t, ct, cx)
    actual = np.interp(t - 0.0012, ct, cx)
    ft = np.arange(0.0005, ct[-1] - 0.01, 1.0 / force_rate_Hz)
    clean = np.interp(ft, t, response(t, actual))
    net = clean + NOISE * random.standard_normal(ft.size) + 0.04 * np.sin(0.25 * ft)
    first = Recording(
        source=Path("runs/2026-11-21_095012_staircase/recording.mcap"),
        motor=MotorChannel(
            t,
            actual + SURFACE + 0.0005 * random.standard_normal(t.size),
            np.where(t < 2.0, np.nan, command + SURFACE),
            np.full(t.size, np.nan),
            t + 0.0004,
        ),
        load_cell=ForceChannel(ft, net, net + 0.31, ft + 0.0012, np.zeros(ft.size, dtype=bool)),
        events=[
            Event(0.0, "homed", {}),
            Event(1.9, "tare", {"tare_N": 0.3104, "sigma_N": 0.0121, "samples": 1045}),
            Event(2.75, "touch_off", {"surface_mm": SURFACE, "surface_std_mm": 0.0031, "threshold_N": 0.06}),
            *(Event(5.0 + 0.01 * i, "retry", {"device": "motor"}) for i in range(7)),
        ],
        steps=marks,
        surface_mm=SURFACE,
        surface_std_mm=0.0031,
        run={
            "protocol": "staircase",
            "sample": '{"id":"PU-07","thickness_mm":10}',
            "operator": "K. Ito",
            "note": "second day, after a night at rest",
            "conditions": '{"temperature_C": 23.1, "humidity_percent": 41}',
            "bench": "simulated",
            "seed": "1",
            "simulated": "true",
            "epoch_ns": "946684800000000000",
            "protocol_sha256": "5e1f",
        },
        result={
            "status": "done",
            "traffic": '{"motor": {"exchanges": 43000, "retries": 7, "crc_errors": 0},'
            ' "load_cell": {"exchanges": 12, "retries": 0, "lines": 23650}}',
            "overruns": "3",
        },
        attachments={"protocol.yaml": b"name: staircase\nsteps:\n  - {to: 0.6, speed: 80, hold: 4}\n"},
    )
    for name, value in changes.items():
        setattr(first, name, value)
    return first


def fit_json(**changes: Any) -> dict[str, Any]:
    """A fit.json as docs/formats.md has it."""
    return {
        "method": "continuous",
        "law": "exponential",
        "order": 2,
        "contact": "unilateral",
        "model": {},
        "parameters": {
            "m": {"value": 2.2413, "unit": "N/mm", "std": 0.0102},
            "b": {"value": 0.6893, "unit": "1/mm", "std": 0.0021},
            "c_1": {"value": 0.2507, "unit": "1", "std": 0.0013},
            "nu_1": {"value": 4.01, "unit": "1/s", "std": 0.034},
            "c_2": {"value": 0.1489, "unit": "1", "std": 0.0009},
            "nu_2": {"value": 0.3491, "unit": "1/s", "std": 0.0071},
        },
        "filter": None,
        "V": 9.4e-4,
        "rmse": 0.0307,
        "noise_floor": 0.0121,
        "fit_percent": 98.71,
        "physical": True,
        "converged": True,
        "undetermined": [],
        "held_out_rmse": 0.0313,
        "samples": 19800,
        "seconds": 0.62,
    } | changes


def fit(run: Recording, **changes: Any) -> FitView:
    """The fit of `recording()`, simulated from the measured motion."""
    motor, cell = run.motor, run.load_cell
    depth = motor.position_mm - (run.surface_mm or 0.0)
    force = np.interp(cell.time_s, motor.time_s, response(motor.time_s, depth))
    x = np.linspace(0, 2.5, 120)
    t = np.geomspace(1e-3, 100, 160)
    g = sum(c * np.exp(-nu * t) for c, nu in zip(SHARES, RATES, strict=True))
    starts = [mark.time_s for mark in run.steps if mark.phase == "steps"]
    return FitView(
        json=fit_json(**changes),
        time_s=cell.time_s,
        position_mm=np.interp(cell.time_s, motor.time_s, depth),
        measured_N=cell.force_N,
        simulated_N=force,
        fit_from_s=min(starts, default=-np.inf),
        elastic=Curve(x, elastic(x), 0.01 * elastic(x) + 0.002),
        relaxation=Curve(t, np.asarray(g), 0.01 * np.ones_like(t)),
        evidence=[
            Evidence("exponential", 1, 0.118, 0.121, 4210.0, remark="one mode is too few"),
            Evidence("exponential", 2, 0.0307, 0.0313, 3011.0, chosen=True),
            Evidence("exponential", 3, 0.0306, 0.0315, 3019.0, remark="third mode undetermined"),
            Evidence("power", 2, 0.214, 0.22, 8100.0),
        ],
        notes=["Before the first step 7 force samples came twice; the second ones were left out."],
    )
