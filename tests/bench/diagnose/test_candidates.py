"""Where the search for a cause begins."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.candidates import Reach, _scanned, narrowed
from sim.effects import effect


@pytest.mark.parametrize("rate_Hz", [5.0, 8.0, 15.0, 30.0, 200.0, 2000.0])
@pytest.mark.parametrize(
    "form", [f.name for f in effect("resonance").forms if not any(p.amplitude for p in f.parameters)]
)
def test_ringing_is_sought_at_all_frequencies_that_the_data_can_show(form, rate_Hz):
    """Down to data so slow that no usual start lies within what they show."""
    reach = Reach(sample_s=1 / rate_Hz, span_s=60.0, travel_mm=3.0, depth_mm=2.5, force_N=5.0)
    shape = narrowed(effect("resonance").form(form), reach)
    starts = list(_scanned(shape))
    found = np.unique([values["frequency"] for values in starts])
    assert 0 < found[0] <= max(4.0, 0.1 * rate_Hz) and found[-1] == pytest.approx(0.45 * rate_Hz)
    assert len({values["damping_ratio"] for values in starts}) > 1
    assert all(len(values) == len(starts[0]) for values in starts)
