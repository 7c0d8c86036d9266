"""The load cell in air: its zero, noise and drift, and whether a zero can be taken at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.daily.open_bench import OpenBench
from bench.errors import InputError, Refused, Stopped
from bench.protocol import Approach
from bench.run.approach import tare
from bench.run.loop import Script
from bench.run.touchoff import air_of
from drivers.errors import DriverError

DRIFTED_SIGMAS = 5.0
"""A drift that in the time read comes to so many standard deviations of a reading is no steady zero; as for a run."""

LEAST_N = 0.02
"""Less than that over the time read is never called drift: a fifth of what touch-off looks for at the least."""


def read_zero(work: OpenBench, seconds: float) -> dict[str, Any]:
    """Average the force over so long, with nothing commanded. Raises `Refused` where it is not steady."""
    force_N, time_s, details = work.look(_read(work, seconds))
    if force_N.size < 8:
        raise Refused(f"only {force_N.size} readings came in {seconds:g} s; raise the load cell's rate, or read longer")
    air = air_of(time_s, force_N)
    figures = {
        "mean_N": air.mean_N,
        "noise_N": air.sigma_N,
        "drift_N_s": air.drift_N_s,
        "std_of_mean_N": air.sigma_N / float(np.sqrt(air.samples)),
        "samples": air.samples,
        "seconds": seconds,
        **details,
    }
    drifted_N = abs(air.drift_N_s) * seconds
    if drifted_N > max(LEAST_N, DRIFTED_SIGMAS * air.sigma_N):
        raise Refused(
            f"no zero can be taken: the force went by {air.drift_N_s * seconds:+.3f} N in {seconds:g} s "
            f"({air.drift_N_s:+.4f} N/s)\n"
            "  the probe touches something that gives way, or the cell is warming up: retract it, wait, read again"
        )
    if details["overloaded"]:
        raise Refused("no zero can be taken: the load cell reports overload; take the load off")
    return figures


def _read(work: OpenBench, seconds: float) -> Script[tuple[np.ndarray, np.ndarray, dict[str, Any]]]:
    try:
        _, channel = yield from work.listen(seconds)
    except DriverError as error:
        raise InputError(work.bench.place((error.device,)), str(error)) from error
    return channel.gross_N, channel.time_s, {"overloaded": int(channel.flagged.sum())}


def read_zero_backing_off(work: OpenBench, by_mm: float, seconds: float) -> dict[str, Any]:
    """As a run does it: back off, see whether the force falls, then average. Raises `Stopped` where it touched."""

    def whole() -> Script[None]:
        yield from tare(work.loop, work.mover, Approach(retract=by_mm), 1.0, seconds)

    work.move(whole, may_home=work.bench.all_simulated)
    found = work.notebook.data_of("tare")
    if found is None:
        raise Stopped("no zero was taken")
    return {
        "mean_N": found["tare_N"],
        "noise_N": found["sigma_N"],
        "drift_N_s": found["drift_N_s"],
        "std_of_mean_N": found["sigma_N"] / float(np.sqrt(found["samples"])),
        "samples": found["samples"],
        "seconds": seconds,
        "contact_check": found["contact_check"],
        "backed_off_mm": found["backed_off_mm"],
    }
