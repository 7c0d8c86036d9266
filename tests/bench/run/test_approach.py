"""Whole touch-offs on the simulated bench, where the pad is softer than the force that feels it."""

import numpy as np

from tests.benchmarks.touch_off import Case, touch


def test_a_pad_felt_far_below_its_surface_is_measured_from_the_air():
    """F = 2.1 N/mm^1.77: 50 mN are felt 0.12 mm deep. An approach that starts there finds a surface that is none."""
    touches = [touch(Case(6, pad="power"), seed) for seed in range(1, 7)]
    z = np.array([t.error_mm / t.std_mm for t in touches])
    assert np.all(np.abs(z) < 3.0), z
    assert np.median([abs(t.error_mm) for t in touches]) < 0.03
    assert np.median([t.std_mm for t in touches]) < 0.05
