"""The channels while the axis stands in air: rates, ages, repeated values, saturation, noise, drift, mains hum."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bench.config import Bench
from bench.daily.checkup.finding import Finding
from bench.rates import at_least, force_rate_Hz, motor_rate_Hz
from bench.recording.types import ForceChannel, MotorChannel
from bench.run.touchoff import air_of

Array = NDArray[np.float64]

SLOW_SHARE = 0.9
REPEATED_SHARE = 0.5
LOADED_SHARE = 0.5
"""Of the capacity: more than that in air leaves too little for the pad."""

MAINS_HZ = (50.0, 100.0, 150.0, 60.0, 120.0, 180.0)
HUM_SIGMAS = 5.0
HUM_SHARE = 0.2
"""A line counts whose amplitude is beyond both: chance, and this share of the noise of one reading."""

NOISY = 1.2
"""Touch-off asks for five standard deviations of the noise where that is more than the protocol's touch."""

DRIFT_SHARE = 0.02
"""Of the smallest touch (`approach.force`, 0.05 N unless said otherwise) in ten seconds: 0.1 mN/s."""


def rates(bench: Bench, motor: MotorChannel, cell: ForceChannel) -> tuple[dict[str, Any], list[Finding]]:
    """Samples a second against what the lines can carry, gaps, and ages on arrival."""
    figures: dict[str, Any] = {}
    findings = []
    each: list[tuple[Literal["motor", "load_cell"], MotorChannel | ForceChannel, float]] = [
        ("motor", motor, motor_rate_Hz(bench)),
        ("load_cell", cell, force_rate_Hz(bench)),
    ]
    for name, channel, expected_Hz in each:
        steps = np.diff(channel.time_s)
        if steps.size < 8:
            findings.append(Finding(f"{name} rate", f"{steps.size + 1} samples", False, "it hardly answers", CABLE))
            continue
        rate = 1.0 / float(np.mean(steps))
        age_ms = 1e3 * (channel.received_s - channel.time_s)
        figures[name] = {
            "rate_Hz": rate,
            "expected_Hz": expected_Hz,
            "longest_gap_ms": 1e3 * float(steps.max()),
            "age_ms": float(np.median(age_ms)),
            "oldest_ms": float(age_ms.max()),
        }
        expected = f"{'at least ' if at_least(bench, name) else ''}{expected_Hz:.0f} expected"
        shown = f"{rate:.0f} a second ({expected}), {np.median(age_ms):.1f} ms old on arrival"
        if rate < SLOW_SHARE * expected_Hz:
            means = "fast ramps get fewer samples, and a stop comes later"
            findings.append(Finding(f"{name} rate", shown, False, means, SLOWER[name]))
        else:
            findings.append(Finding(f"{name} rate", shown))
        if steps.max() > bench.limits.stale:
            gap = f"{1e3 * steps.max():.0f} ms without a sample"
            stale_ms = 1e3 * bench.limits.stale
            means = f"more than limits.stale ({stale_ms:.3g} ms): a run that looks at such a moment stops"
            usual = float(np.median(steps)) > bench.limits.stale
            do = (
                f"set limits.stale to several times {1e3 * np.median(steps):.1f} ms, the usual time" if usual else CABLE
            )
            findings.append(Finding(f"{name} gaps", gap, False, means, do))
    return figures, findings


CABLE = "look at cable, shield, termination, and at what else this computer does; `padbench status` counts bad frames"
SLOWER = {
    "motor": "raise the baud rate in motor and bench file, lower the reply delay, set USB latency timers to 1 ms",
    "load_cell": "raise the baud rate; switch filter and averaging of the amplifier off (FL 0, UR 0)",
}


def values(bench: Bench, cell: ForceChannel) -> tuple[dict[str, Any], list[Finding]]:
    """How many readings are new ones, how coarse they are, and whether the cell is near its end."""
    force = cell.gross_N
    distinct = np.unique(force)
    step = float(np.diff(distinct).min()) if distinct.size > 1 else 0.0
    repeated = float(np.mean(np.diff(force) == 0.0)) if force.size > 1 else 1.0
    loaded = float(np.abs(force).max()) / bench.load_cell.capacity
    sigma = float(np.std(force))
    figures = {
        "unique_share": distinct.size / max(force.size, 1),
        "repeated_share": repeated,
        "resolution_N": step,
        "share_of_capacity": loaded,
        "overloaded": int(cell.flagged.sum()),
    }
    findings = []
    shown = f"{100 * repeated:.0f} % of the readings repeat the one before, smallest step {1e3 * step:.3g} mN"
    if distinct.size < 2:
        means = "the cell is dead, disconnected, or frozen: no force would ever be felt"
        findings.append(Finding("values", "every reading is the same", False, means, "press it by hand and look again"))
    elif repeated > REPEATED_SHARE and sigma > step:
        means = "it sends faster than it converts: the true rate is lower, and stamps are late by up to a repeat"
        findings.append(Finding("values", shown, False, means, "lower `rate`, or raise the amplifier's own"))
    else:
        findings.append(Finding("values", shown))
    if cell.flagged.any():
        do = "take the load off; if there is none, the cell or its cable is broken"
        findings.append(Finding("saturation", f"{int(cell.flagged.sum())} readings overloaded", False, "", do))
    elif loaded > LOADED_SHARE:
        means = "little is left for the pad before a run stops for the cell's sake"
        do = "take the preload out of the mounting, or see whether the zero of the amplifier is lost"
        findings.append(Finding("saturation", f"{100 * loaded:.0f} % of capacity in air", False, means, do))
    else:
        findings.append(Finding("saturation", f"none; {100 * loaded:.0f} % of capacity in air"))
    return figures, findings


def noise(cell: ForceChannel, touch_N: float) -> tuple[dict[str, Any], list[Finding]]:
    """Noise of one reading, drift, and lines of the mains; `touch_N` is the smallest touch that is looked for."""
    air = air_of(cell.time_s, cell.gross_N)
    hum = {f"{f:g}_Hz": amplitude for f, amplitude in lines_of(cell.time_s, cell.gross_N, MAINS_HZ).items()}
    chance = HUM_SIGMAS * air.sigma_N * float(np.sqrt(2.0 / air.samples))
    told = {name: a for name, a in hum.items() if a > max(chance, HUM_SHARE * air.sigma_N)}
    figures = {
        "rms_N": air.sigma_N,
        "drift_N_s": air.drift_N_s,
        "hum_amplitude_N": hum,
        "hum_chance_N": chance,
        "peak_Hz": strongest(cell.time_s, cell.gross_N),
    }
    findings = []
    shown = f"{1e3 * air.sigma_N:.2f} mN rms, drift {1e3 * air.drift_N_s:+.3f} mN/s"
    if 5.0 * air.sigma_N > NOISY * touch_N:
        means = f"touch-off looks for {5e3 * air.sigma_N:.0f} mN instead of {1e3 * touch_N:.0f} mN"
        do = "shield and ground the cell's cable; a filter (FL) costs delay, so try the cable first"
        findings.append(Finding("noise", shown, False, means, do))
    else:
        findings.append(Finding("noise", shown))
    if abs(air.drift_N_s) * 10.0 > max(touch_N * DRIFT_SHARE, 5.0 * air.sigma_N):
        means = "drift looks like slow relaxation of the pad"
        findings.append(Finding("drift", shown, False, means, "let cell and amplifier warm up for half an hour"))
    if told:
        listed = ", ".join(f"{name.replace('_', ' ')}: {1e3 * a:.2f} mN" for name, a in told.items())
        means = "the mains are in the signal; the diagnosis will name them, and thin ramps suffer most"
        do = "one earth for bench, amplifier and computer; keep the cell's cable away from motor and mains cables"
        findings.append(Finding("mains hum", listed, False, means, do))
    else:
        findings.append(Finding("mains hum", f"none at {', '.join(f'{f:g}' for f in MAINS_HZ)} Hz"))
    return figures, findings


def lines_of(time_s: Array, force_N: Array, frequencies_Hz: tuple[float, ...]) -> dict[float, float]:
    """Amplitude (N) of a sine at each frequency, by least squares beside a straight line; arrays of shape (n,).

    Frequencies above half the rate are found at their aliases, as the true stamps are used; what the samples cannot
    show (a sine that is 0 at each of them) counts as 0.
    """
    t = time_s - time_s.mean()
    trend = t / max(float(np.abs(t).max()), 1e-12)
    found = {}
    for f in frequencies_Hz:
        phase = 2.0 * np.pi * f * t
        design = np.column_stack([np.ones_like(t), trend, np.sin(phase), np.cos(phase)])
        numbers = np.linalg.lstsq(design, force_N, rcond=1e-3)[0]
        found[f] = float(np.hypot(numbers[2], numbers[3]))
    return found


def strongest(time_s: Array, force_N: Array) -> float | None:
    """Frequency (Hz) of the strongest line above 1 Hz in an evenly resampled spectrum; None where there are too few."""
    if time_s.size < 64:
        return None
    step = float(np.median(np.diff(time_s)))
    grid = np.arange(time_s[0], time_s[-1], step)
    even = np.interp(grid, time_s, force_N)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size))) ** 2
    frequency = np.fft.rfftfreq(even.size, step)
    above = frequency > 1.0
    return float(frequency[above][np.argmax(power[above])]) if above.any() else None
