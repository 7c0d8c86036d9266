"""How long an FTDI adapter holds bytes back: its latency timer, where the system tells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.config import Bench
from bench.daily.checkup.finding import Finding

SYSTEM = Path("/sys/bus/usb-serial/devices")
MOST_MS = 1


def latency_timers(bench: Bench, system: Path = SYSTEM) -> tuple[dict[str, Any], list[Finding]]:
    """The timer of each serial port of the bench, ms; nothing of ports that have none (sockets, simulated ones)."""
    figures: dict[str, Any] = {}
    findings = []
    for key, spec in (("motor", bench.motor), ("load_cell", bench.load_cell)):
        if "://" in spec.port:
            continue
        name = Path(spec.port).resolve().name  # /dev/serial/by-id/… is a link to /dev/ttyUSB0
        file = system / name / "latency_timer"
        try:
            timer_ms = int(file.read_text("ascii"))
        except (OSError, ValueError):
            continue
        figures[key] = {"port": spec.port, "latency_timer_ms": timer_ms}
        if timer_ms > MOST_MS:
            findings.append(
                Finding(
                    f"{key} adapter", f"its latency timer is {timer_ms} ms", False,
                    f"the adapter keeps bytes for up to {timer_ms} ms: samples come late, and so does a stop",
                    f"as root: echo 1 > {file} (or a udev rule, so that it stays)",
                )
            )  # fmt: skip
        else:
            findings.append(Finding(f"{key} adapter", f"its latency timer is {timer_ms} ms"))
    return figures, findings
