"""A fitted pad for other programs: a C header for real-time loops, JSON for everything else, a Python object."""

from bench.export.c_header import c_header
from bench.export.description import describe
from bench.export.live import LivePad
from bench.export.realtime import RealTimePad, real_time_pad

__all__ = ["LivePad", "RealTimePad", "c_header", "describe", "real_time_pad"]
