"""The judge's shapes of the pad's elastic law, softening, damage and set, against closed forms and counts."""

import numpy as np
import pytest

from .effects.judge_pad import ConicalCoil, SwollenGel
from .motion import Path
from .test_truth_effects import cycles, hidden


@pytest.mark.parametrize("narrow", [0.4, 0.6])
def test_a_conical_coil(narrow):
    law = ConicalCoil(2.0, narrow, 0.01, 1.5)
    # Turn by turn: each gives by the cube of its radius until it lies.
    turns = narrow + (1 - narrow) * (np.arange(20_000) + 0.5) / 20_000
    for load in (0.3, 0.9, 1.1, 2.0, 3.5, 0.9 / narrow**3, 1.5 / narrow**3):
        depth = 1.5 * (np.mean(np.minimum(load * turns**3, 1.0)) + 0.01 * load)
        assert law.force(depth) == pytest.approx(2 * load, rel=1e-4)
    assert law.force(-1.0) == 0 and np.all(np.diff(law.force(np.linspace(0, 4.0, 400))) > 0)


@pytest.mark.parametrize(("polymer", "chi"), [(0.08, 0.45), (0.15, 0.3), (0.2, 0.2)])
def test_a_swollen_gel(polymer, chi):
    law = SwollenGel(2.0, polymer, chi, 1.5)

    # Energy of the mixture and of chains over the height, for a network that is at rest as swollen.
    def energy(left, chains):
        solvent, p = left - polymer, polymer / left
        return solvent * np.log(1 - p) + chi * solvent * p + chains * left**2 / 2

    step, mixed = 1e-5, -(energy(1 + 1e-5, 0.0) - energy(1 - 1e-5, 0.0)) / 2e-5
    for depth in (0.05, 0.4, 0.8, 1.0):
        left = 1 - depth / 1.5
        wanted = -(energy(left + step, mixed) - energy(left - step, mixed)) / (2 * step)
        assert law.force(depth) == pytest.approx(2 * wanted, rel=1e-3, abs=1e-6)
    # Straight, and without a bend, from where a tenth is solvent.
    end = 1.5 * (1 - polymer / 0.9)
    slopes = np.diff(law.force(end + np.array([-1e-4, 0.0, 1e-4, 2.0, 3.0]))) / np.array([1e-4, 1e-4, 1.9999, 1.0])
    assert slopes == pytest.approx(np.full(4, slopes[-1]), rel=0.02) and slopes[2] == pytest.approx(slopes[3])


@pytest.mark.parametrize(("shape", "kind"), [("conical_coil", ConicalCoil), ("swollen_gel", SwollenGel)])
@pytest.mark.parametrize("seed", range(3))
def test_another_law(shape, kind, seed):
    _, told, build = hidden("elastic_law", shape, seed=seed)
    law = build.plant.pad.law
    assert told["law"] == shape and isinstance(law, kind) and law.force(2.0) == pytest.approx(6.0)
    assert build.believed.law.name in ("power", "exponential")
    depth = np.linspace(0.1, 2.0, 50)
    apart = np.sqrt(np.mean((law.force(depth) - build.believed.law.force(depth)) ** 2)) / 6
    assert 0.002 < apart < 0.1
    if shape == "conical_coil":
        # Straight until the widest turn lies down.
        first = float(law.depth(np.array(1.0)))
        assert law.force(first / 2) == pytest.approx(law.modulus / 2) and 0.2 < first < 1.5
        assert 0.49 < 6 / law.modulus * law.narrow**3 < 0.91
    else:
        assert 0.49 < law.polymer / (1 - 2.0 / law.height) < 0.76
