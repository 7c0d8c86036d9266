"""How fast the devices of a bench file can be expected to answer, before any of them has been opened.

For plans and preflight; where a motor takes longer to answer, a run goes by that. An Orca stream exchange is 9 + 19
bytes of 11 bits behind the host's silence and the motor's, which are set alike (docs/devices.md 6, 7.3), a DAD 141.1
`SW` line 21 bytes of 10 bits and at most 600 a second (3.1); a device with a register map is read block by block, each
a request of 8 bytes and a reply of 5 and two a register, behind its reply delay.
"""

from __future__ import annotations

from typing import Literal

from bench.config import Bench
from drivers.motor import STREAMED, RAREST_Hz
from drivers.orca import DEFAULT_BAUDRATE, default_gap_s
from drivers.regmap import MotorMap, WriteBlock, load_map

STREAM_HZ = 1000.0
"""What a streamed motor is asked for unless the bench file or the protocol says otherwise."""

LEAST_FORCE_Hz = 8.0
"""The tare takes a second, and eight readings."""

_ORCA_BITS = 28 * 11
_LINES = {"dad141": (21 * 10, 115200, 600.0), "mt_sics": (18 * 10, 9600, 100.0)}
"""Load cells that send lines by themselves: bits of a line, baud rate and lines a second where the file gives none.

How often an MT-SICS device sends differs by model: `rate` of the bench file says it better.
"""


def streams(bench: Bench) -> bool:
    """Whether the motor takes a position every tick, rather than making whole moves by itself."""
    return bench.motor.driver in STREAMED


def speed_step_mm_s(bench: Bench) -> float:
    """The steps in which the motor counts speeds, the first of which is its slowest; 0 for one that is streamed."""
    if streams(bench):
        return 0.0
    form: MotorMap = load_map(bench.motor.driver, bench.motor.map, "motor")
    fields = [field for step in form.move if isinstance(step, WriteBlock) for field in step.fields]
    return max((field.factor for field in fields if field.variable == "speed" and field.type != "f32"), default=0.0)


def made_speed_mm_s(speed_mm_s: float, step_mm_s: float) -> float:
    """The speed that a motor makes of one that is asked for, which counts speeds in these steps: at least one of them;
    any speed where that is 0."""
    return max(round(speed_mm_s / step_mm_s), 1) * step_mm_s if step_mm_s else speed_mm_s


def motor_rate_Hz(bench: Bench, asked_Hz: float | None = None) -> float:
    """Samples a second to expect of the motor; `asked_Hz` is the protocol's wish, the wire's limit stands above it."""
    spec = bench.motor
    if streams(bench):
        baudrate = spec.baudrate or DEFAULT_BAUDRATE
        gap_s = default_gap_s(baudrate) if spec.gap_us is None else 1e-6 * spec.gap_us
        most = 1.0 / (_ORCA_BITS / baudrate + 2.0 * gap_s)
        return min(asked_Hz or spec.rate or STREAM_HZ, most)
    usual, exchange_s = _polled(bench, "motor")
    return min(asked_Hz or spec.rate or usual, 1.0 / exchange_s)


def force_rate_Hz(bench: Bench, asked_Hz: float | None = None) -> float:
    """Force samples a second to expect of the load cell."""
    spec = bench.load_cell
    if spec.driver in _LINES:
        bits, baudrate, usual_Hz = _LINES[spec.driver]
        most = min(usual_Hz if spec.rate is None else max(usual_Hz, spec.rate), (spec.baudrate or baudrate) / bits)
        return min(asked_Hz or spec.rate or most, most)
    usual, exchange_s = _polled(bench, "load_cell")
    return min(asked_Hz or spec.rate or usual, 1.0 / exchange_s)


def at_least(bench: Bench, device: Literal["motor", "load_cell"]) -> bool:
    """Whether a rate is that of a device which thinks as long as it may before each answer: most are quicker."""
    return not streams(bench) if device == "motor" else bench.load_cell.driver not in _LINES


def force_latency_s(bench: Bench, asked_Hz: float | None = None) -> float:
    """From the pad reaching a force to the motor told to stop, at the longest.

    One sample period, one reply on the wire, the bench's measured `timing.force_delay`, and the motor's next turn:
    a streamed one takes the stop with the next frame; one that is polled ends the exchange under way first.
    """
    spec = bench.load_cell
    if spec.driver in _LINES:
        bits, baudrate, _ = _LINES[spec.driver]
        reply_s = bits / (spec.baudrate or baudrate)
    else:
        reply_s = _polled(bench, "load_cell")[1]
    turns = 1.0 if streams(bench) else 2.0
    sample_s = 1.0 / force_rate_Hz(bench, asked_Hz) + reply_s
    return sample_s + max(0.0, bench.timing.force_delay) + turns / motor_rate_Hz(bench)


def too_rare(bench: Bench, device: Literal["motor", "load_cell"], asked_Hz: float | None = None) -> str | None:
    """What is wrong with a rate at which a run stops by itself (a motor that counts as silent, no tare); or None."""
    if device == "load_cell":
        rate_Hz = force_rate_Hz(bench, asked_Hz)
        few = f"{rate_Hz:.3g} force samples a second make no tare: at least {LEAST_FORCE_Hz:g} are needed"
        return few if rate_Hz < LEAST_FORCE_Hz else None
    period_s, stale_s = 1.0 / motor_rate_Hz(bench, asked_Hz), bench.limits.stale
    if period_s <= stale_s:
        return None
    rare = f"a motor sample every {1e3 * period_s:.3g} ms is too rare"
    return f"{rare}: limits.stale stops a run after {1e3 * stale_s:.3g} ms without one"


def too_far_behind(bench: Bench, speed_mm_s: float, asked_Hz: float | None = None) -> str | None:
    """What is wrong with a speed: a motor streamed slower than it should be stands a period behind its command.

    None where nothing is, or where the motor hears as often as it should: how well it follows then a run will tell.
    """
    rate_Hz, allowed_mm = motor_rate_Hz(bench, asked_Hz), bench.limits.following_error
    behind_mm = speed_mm_s / rate_Hz
    if not streams(bench) or rate_Hz >= STREAM_HZ or behind_mm <= allowed_mm or too_rare(bench, "motor", asked_Hz):
        return None
    told = f"at {speed_mm_s:.3g} mm/s a motor that is told a position every {1e3 / rate_Hz:.3g} ms"
    return f"{told} is {behind_mm:.2g} mm behind: limits.following_error is {allowed_mm:g} mm"


def stairs_mm(bench: Bench, speed_mm_s: float, asked_Hz: float | None = None) -> float:
    """From one position to the next that a streamed motor is told at a speed; 0 where that is too often for the motor
    to come to rest in between, and of one that makes its moves by itself."""
    rate_Hz = motor_rate_Hz(bench, asked_Hz)
    return speed_mm_s / rate_Hz if streams(bench) and rate_Hz < RAREST_Hz else 0.0


def _polled(bench: Bench, device: Literal["motor", "load_cell"]) -> tuple[float, float]:
    """Usual rate (Hz) of a device with a register map, and how long one reading of it takes (s)."""
    spec = bench.motor if device == "motor" else bench.load_cell
    form = load_map(spec.driver, spec.map, device)
    delay_s = 1e-3 * (form.reply.processing_ms + form.reply.delay_ms) + (spec.gap_us or 0) * 1e-6
    wanted = ("position", "fault") if device == "motor" else ("gross",)
    blocks = {form.block_of(form.values[name]) for name in wanted if name in form.values} - {None}
    total_s = 0.0
    for name in blocks:
        bits = 10 * (13 + 2 * form.blocks[name].count) if form.link.transport == "rtu" else 0
        total_s += bits / (spec.baudrate or form.link.baudrate) + delay_s
    return float(form.poll_rate), total_s
