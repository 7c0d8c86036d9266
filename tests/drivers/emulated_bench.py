"""A simulated bench on pseudo-terminals or sockets, in a process: `python -m tests.drivers.emulated_bench JSON`.

Takes the two devices as JSON (`{"motor": {…}, "load_cell": {…}}`, as in a bench file), prints `KEY PATH` a device.
"""

from __future__ import annotations

import json
import sys

from sim.emulate import main
from sim.model import Model
from sim.world import WorldSettings

AIR = {"pad": {"elastic": {"law": "none"}, "relaxation": {"shares": [], "rates": []}, "contact": "unilateral"}}


def settings(devices: dict[str, dict[str, object]], name: str, clock: str) -> WorldSettings:
    """A bench in free air, without noise."""
    return WorldSettings(
        name=name,
        model=Model.from_dict(AIR),
        motor=devices["motor"],
        load_cell=devices["load_cell"],
        clock=clock,  # type: ignore[arg-type]
        surface=5.0,
    )


if __name__ == "__main__":
    main(settings(json.loads(sys.argv[1]), "emulated", "wall"))
