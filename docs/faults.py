"""Make docs/faults.md: every fault that a simulated bench can have, and how a run comes out of it.

python -m docs.faults [--out DIR]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sim.faults import FAMILIES, KINDS, Kind, Parameter, Reaction

HEAD = """# Faults

What can go wrong on a bench, and what a run makes of it. A simulated bench has the faults that its file asks for:

    simulation:
      faults:
        - {kind: crc_error, device: load_cell, rate_per_s: 0.5}
        - {kind: silent, device: motor, at_s: 3.2, duration_s: 0.2}
        - {kind: jam, step: "steps[0]", after_s: 0.1}

| key | what |
|---|---|
| `kind` | one of those below |
| `device` | `motor`, `load_cell` or `host`; may be left out where a kind has only one |
| `at_s` | when it strikes, in seconds of bench time; 0: from before a port is opened |
| `step` | or: as a step begins, by its name in the recording (`tare`, `approach`, `steps[0]`) or its number from 0 |
| `after_s` | so many seconds after that beginning; a step that the protocol does not have never begins |
| `rate_per_s` | or: at random, so often on average |
| `duration_s` | how long it lasts; left out: to the end of the run, or one frame where a kind strikes frames |

Faults combine. They draw from random numbers of their own: a bench with other faults, or none, has the same noise.
The same file and seed give the same bytes, faults included. The faults asked for stand in the simulation's record
alone; no fit sees them.

A run comes out of a fault in one of three ways. **Recovered**: the protocol runs to its end. **Stopped safely**: the
first cause is named in the message and the recording, the data are kept, and the true bench ends at rest with no more
force and travel than its limits and the way to stop. **Refused to start**: exit code 2, nothing was commanded.

Under `padbench emulate` the devices have them too, at times or at random (nobody tells an emulated bench which step
begins). A port that is `unplugged` there is hung up and gone from its path, which comes back with it: its client has to
open it anew. The host is the client's process then; faults of the host do nothing, but `host_stall` stalls the devices.

`tests/faults/test_kinds.py` has each row of the tables happen to a run, and looks at the simulated world, not at what
the host believes. A row shows the fault as the file would have it (without `kind` and `device`).
`tests/fault_campaign` draws faults at random on protocols at random:

    .venv/bin/python -m tests.fault_campaign --seeds 0:10000 --jobs 2

This page is made by `python -m docs.faults`.
"""

HOST_ALONE = """## Not from a bench file

- A folder that cannot be written, or a disk with too little room, refuses the run before a port is opened:
  `tests/faults/test_host.py`.
"""


def entry(fault: Mapping[str, Any]) -> str:
    """A fault as YAML writes it in a line."""

    def word(value: Any) -> str:
        return f'"{value}"' if isinstance(value, str) and "[" in value else f"{value}"

    return "{" + ", ".join(f"{key}: {word(value)}" for key, value in fault.items()) + "}"


def describe(parameter: Parameter) -> str:
    """One parameter in a list."""
    if parameter.words:
        return f"`{parameter.name}`: {parameter.what} ({', '.join(parameter.words)}; default {parameter.default})"
    unit = f" {parameter.unit}" if parameter.unit else ""
    return f"`{parameter.name}`: {parameter.what} (default {parameter.default}{unit})"


def row(reaction: Reaction) -> str:
    """A row of a kind's table."""
    on = "" if reaction.bench == "simulated" else f" ({reaction.bench.removeprefix('simulated_')})"
    return f"| {reaction.device}{on} | `{entry(reaction.fault)}` | {reaction.outcome} | {reaction.why} |"


def section(kind: Kind) -> list[str]:
    """The part of the page on one kind."""
    out = [f"### {kind.name}", "", kind.what, ""]
    if kind.parameters:
        out += [f"- {describe(parameter)}" for parameter in kind.parameters]
    if not kind.lasting:
        out.append("- it happens at once; `duration_s` is not taken")
    if out[-1]:
        out.append("")
    out += ["| device | fault | outcome | why |", "|---|---|---|---|"]
    return [*out, *(row(reaction) for reaction in kind.reactions), ""]


def page() -> str:
    """The text of docs/faults.md."""
    out = [HEAD]
    for family, kinds in FAMILIES.items():
        out.append(f"- {family}: {', '.join(f'[{kind.name}](#{kind.name})' for kind in kinds)}")
    rows = sum(len(kind.reactions) for kind in KINDS.values())
    variants = sum(len(kind.devices) for kind in KINDS.values())
    out += ["", f"{len(KINDS)} kinds, {variants} counted by device, {rows} rows.", ""]
    for family, kinds in FAMILIES.items():
        out += [f"## {family}", ""]
        for kind in kinds:
            out += section(kind)
    return "\n".join(out) + "\n" + HOST_ALONE


def main(argv: list[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(prog="docs.faults", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    given = parser.parse_args(argv)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "faults.md").write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
