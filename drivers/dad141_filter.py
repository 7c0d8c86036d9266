"""How old a reading of the DAD 141.1 is by its own filters, from how it is set (FL, FM, UR).

Source: DAD 141.1 Technical Manual rev. 2.5, p. 36 (filter tables), and the DAS 72.1 user guide, p. 39 (the same
converter's FIR table). The manuals also name an antialiasing filter of 17 Hz, 60 dB a decade, that acts even with the
digital filter off; its delay is not stated and not taken off here: `timing.force_delay` of the bench file is for what
is measured of it.
"""

from __future__ import annotations

import math

CONVERSIONS_HZ = 600.0
"""Measurements a second of the converter."""

IIR_CUTOFF_HZ = (math.inf, 18.0, 8.0, 4.0, 3.0, 2.0, 1.0, 0.5, 0.25)
"""3 dB frequency by FL in mode 0: a low pass of second order that does not overshoot."""

FIR_SETTLING_S = 28 / CONVERSIONS_HZ
"""Length of the FIR filter a step of FL in mode 1: settles within 47 ms · FL."""


def output_interval_s(level: int, fir: bool, averaging: int) -> float:
    """Time between readings: the FIR filter puts out every FL-th value, averaging takes 2^UR of what comes."""
    return (level if fir and level > 0 else 1) * (1 << averaging) / CONVERSIONS_HZ


def delay_s(level: int, fir: bool, averaging: int) -> float:
    """Age of a reading by filter and averaging, for forces that change slowly against them, seconds.

    Two equal poles with 3 dB at f delay by 2 · sqrt(sqrt 2 - 1) / (2 pi f); a symmetrical FIR filter by half its
    length; the mean of n values is as old as the middle one of them.
    """
    if level == 0:
        filtering_s = 0.0
    elif fir:
        filtering_s = 0.5 * FIR_SETTLING_S * level
    else:
        filtering_s = math.sqrt(math.sqrt(2.0) - 1.0) / (math.pi * IIR_CUTOFF_HZ[min(level, 8)])
    return filtering_s + 0.5 * ((1 << averaging) - 1) * output_interval_s(level, fir, 0)
