"""Times of a simulation: what is kept for speed is right, and goes when it is sent."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim import kernel
from sim.effects import effect
from sim.elastic import Exponential
from sim.grid import Grid
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation


def test_what_a_mode_keeps_and_gains_in_each_step():
    time = np.cumsum(np.random.default_rng(1).choice([0.0, 1e-4, 0.02, 3.0], 500))
    grid, rates = Grid(time), (40.0, 0.3)
    decay, gain = grid.fades(rates)
    x = np.outer(rates, np.diff(time, prepend=time[0]))
    assert_allclose(decay, np.exp(-x), rtol=1e-12, atol=1e-15)
    where = x > 0
    assert_allclose(gain[where], (1 - np.exp(-x[where])) / x[where], rtol=1e-10)
    assert np.all(gain[~where] == 1.0)
    again, _ = grid.fades((0.3,))  # a mode of a set that was asked for before
    assert np.array_equal(again[0], decay[1])
    assert grid.fades(())[0].shape == (0, 500)


def test_where_the_probe_was_is_worked_out_once_for_an_encoder_and_a_motion(monkeypatch):
    """As on a grid of its own, whatever was asked for before; and as often as that is another question."""
    time = np.arange(400) / 100.0
    motion = 0.5 - 0.5 * np.cos(2.0 * np.pi * time)
    plants = [
        Cascade(Pad(Exponential(2.24, 0.69), Relaxation((0.3,), (1.5,)), True), [encoder, *beside])
        for encoder in (
            effect("encoder_error").active("sine", amplitude=0.01, period=0.3, phase=0.2),
            effect("encoder_error").active("sine", amplitude=0.01, period=0.3, phase=0.3),
            effect("encoder_error").active("zeroed", amplitude=0.01, period=0.3, phase=0.3),
        )
        for beside in ([], [effect("friction").active()])
    ]
    asked = [(plant, motion + surface) for plant in plants for surface in (0.0, 0.02)]
    alone = [plant.simulate(time, position) for plant, position in asked]

    worked_out = []
    unreport = kernel.unreport
    monkeypatch.setattr(kernel, "unreport", lambda *given: (worked_out.append(1), unreport(*given)))
    grid = Grid(time)
    for _ in range(2):
        for (plant, position), force in zip(asked, alone, strict=True):
            assert np.array_equal(plant.simulate_on(grid, position), force)
    assert len(worked_out) == 6  # three encoders, two surfaces


def test_a_grid_that_is_sent_is_the_same():
    grid = pickle.loads(pickle.dumps(Grid([0.0, 0.1, 0.4])))
    assert_allclose(grid.dt_s, [0.0, 0.1, 0.3])


@pytest.mark.parametrize("bad", [[0.0, -1.0], [0.0, np.nan]])
def test_times_that_fall_or_are_not_finite_are_refused(bad):
    with pytest.raises(ValueError, match="time"):
        Grid(bad)
