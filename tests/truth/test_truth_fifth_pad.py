"""The fifth shapes of the pad's own effects against closed forms."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from .effects.fifth_pad import BlatzKo, RambergOsgood, ending_rates, rouse_rates
from .laws import Power
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long


def test_a_tape_that_holds_less_each_time():
    pad = Pad(Power(3.0, 0.0), (0.5,), (3.0,))
    path, ends = Path(-0.5), []
    for _ in range(4):
        path.to(2.0, 50.0).hold(3.0).to(-0.5, 50.0).hold(3.0)
        ends.append(path.motion().duration_s)
    fine, told, build = hidden("separation", "wears_off", pad=pad, motion=path.motion())
    assert told == {} and build.believed.contact == "bonded"
    least = [fine.force_N[(fine.time_s > end - 3.2) & (fine.time_s < end)].min() for end in ends]
    # A step is 5 µm of 3 N/mm or so.
    assert least == pytest.approx(-0.015 * 6 * 0.5 ** np.arange(4.0), abs=0.016)


def test_adhesion_that_is_smooth():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    fine, told, _ = hidden("adhesion", "smooth", motion=motion)
    x, out = fine.reported_mm, (fine.reported_mm < 0) & (fine.time_s > 0)
    q = -3 * x[out] / told["range"]
    assert np.allclose(fine.force_N[out], -told["pull_off"] * q * np.exp(1 - q), atol=1e-9)
    assert fine.force_N.min() == pytest.approx(-told["pull_off"], rel=1e-3)
    assert x[np.argmin(fine.force_N)] == pytest.approx(-told["range"] / 3, rel=0.05)


def test_tack_grows_while_it_is_pressed():
    pulls, times = [], np.array([0.1, 0.3, 1.0, 20.0])
    for time_s in times:
        motion = Path(0.5, np.inf).to(1.0, 1000.0).hold(float(time_s)).to(-0.5, 2.0).motion()
        fine, told, build = hidden("adhesion", "tack", motion=motion)
        pulls.append(-fine.force_N.min() / told["pull_off"])
        assert fine.force_N[-1] == 0
    tau = build.plant.numbers["adhesion_s"]
    assert 0.2 <= tau <= 1.0 and pulls == pytest.approx(-np.expm1(-(times + 0.501) / tau), rel=0.01)


def test_laws():
    def energy(stretch):
        # Of the foam, free to bulge as it likes: (Σ λ_i^{−2} + 2 J − 5)/2.
        return minimize_scalar(
            lambda side: 0.5 * (stretch**-2 + 2 * side**-2 + 2 * stretch * side**2 - 5), bounds=(0.8, 1.6),
            options={"xatol": 1e-10}, method="bounded",
        ).fun  # fmt: skip

    for depth in (0.1, 0.8, 1.6):
        stretch = 1 - depth / 4
        slope = (energy(stretch - 1e-4) - energy(stretch + 1e-4)) / 2e-4
        assert BlatzKo(2.0, 4.0).force(depth) == pytest.approx(2 * slope, rel=1e-4)
    d = np.linspace(0, 2.4, 500)
    for power in (3.0, 5.0):
        law = RambergOsgood(5.0, 2.5, power, 2.0)
        f = law.force(d) / 5
        assert np.allclose(2.0 * (f + 2.5 * f**power), d, atol=1e-9) and np.all(np.diff(f) > 0)
    assert np.all(np.diff(BlatzKo(1.0, 4.0).force(d)) > 0) and BlatzKo(1.0, 4.0).force(-1.0) == 0


def test_softening_that_levels_off_late():
    fine, told, _ = hidden("stress_softening", "hyperbola", motion=cycles(1.0, 0.0, 1.6, 0.0, 2.0, 0.0))
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    virgin, below = (deepest - x < 1e-9) & (x > 0), (deepest - x > 1e-6) & (x > 0.05)
    assert np.allclose(fine.force_N[virgin], 3 * x[virgin], atol=1e-6)
    lost, q = 1 - fine.force_N[below] / (3 * x[below]), (deepest - x)[below] / (0.6 * told["depth"])
    assert np.allclose(told["share"] / lost, 1 + 1 / q, rtol=1e-4)


def test_softening_that_heals():
    motion = Path(0.0, np.inf).to(2.0, 100.0).to(1.0, 100.0).hold(60.0).motion()
    fine, told, build = hidden("stress_softening", "heals", motion=motion)
    tau, t = build.plant.numbers["softening_heals_s"], fine.time_s
    late = (t > 0.1) & (t < 59)
    deepest = 1 + np.exp(-(t[late] - 0.03) / tau)
    wanted = 3 * (1 - told["share"] * -np.expm1(-(deepest - 1) / told["depth"]))
    assert 15 <= tau <= 50 and np.allclose(fine.force_N[late], wanted, atol=2e-4)


def test_damage_by_work():
    fine, told, _ = hidden("damage", "by_work", 2.0, motion=cycles(2.0, 0.0, 1.0, 0.0, 2.0))
    x, rate = fine.reported_mm, told["rate"]
    # 3 N/mm and 3 N in the mean: a way from a to b costs (b² − a²)/2, and the stroke to 2 mm just 2 mm.
    cost = np.cumsum(np.maximum(np.diff(x**2, prepend=x[0] ** 2), 0)) / 2
    assert np.allclose(fine.force_N[x > 0.1], (3 * x * np.exp(-rate * cost))[x > 0.1], atol=1e-6)


def test_fibres_that_break_one_by_one():
    logs, strokes = [], 60
    motion = cycles(*([2.0, 0.2] * strokes), speed=20.0)
    for seed in range(6):
        fine, told, _ = hidden("damage", "fibres", motion=motion, seed=seed)
        x = fine.reported_mm
        inside = x > 0.1
        kept = np.log(fine.force_N[inside] / (3 * x[inside]))
        steps = np.diff(kept)[np.diff(kept) < -1e-6]
        # Each by the same share, now and then two at once.
        count = np.round(steps / np.max(steps))
        assert np.allclose(steps / np.max(steps), count, atol=1e-3) and np.all(np.diff(kept) < 1e-6)
        way, steps = 2.0 + 1.8 * (strokes - 1), np.repeat(np.max(steps), int(count.sum()))
        assert 0.4 < way / len(steps) < 1.3  # mm for each
        logs.append(kept[-1] / (told["rate"] * way))
        assert steps[0] == pytest.approx(np.log1p(-told["rate"] * way / len(steps)), rel=0.35)
    assert np.mean(logs) == pytest.approx(-1.0, abs=0.15)


def test_set_that_goes_on_with_each_cycle():
    path = Path(0.0)
    for _ in range(8):
        path.to(2.0, 50.0).hold(0.5).to(0.0, 50.0).hold(0.1)
    motion = path.motion()
    fine, told, _ = hidden("permanent_set", "ratchets", motion=motion)
    ends = motion.duration_s / 8 * (np.arange(8) + 1) - 0.2
    sunk = 2.0 - fine.at(ends) / 3.0
    held = np.interp(ends, fine.time_s, fine.reported_mm)
    assert np.allclose(held, 2.0) and sunk[0] == pytest.approx(2.0 * told["set"])
    grows = (sunk / sunk[0] - 1)[1:] / np.log(np.arange(2, 9))
    assert np.allclose(grows, grows[0], rtol=0.02) and 0.099 < grows[0] < 0.201


def test_set_by_the_load():
    pad = Pad(Power(3.0, 1.0))  # 3 δ²/2, 6 N at 2 mm
    fine, told, _ = hidden("permanent_set", "by_load", pad=pad, motion=cycles(1.0, 0.2, 2.0))
    deepest = np.maximum.accumulate(fine.reported_mm)
    sunk = told["set"] * deepest**2 / 2
    assert np.allclose(fine.force_N, 1.5 * np.maximum(fine.reported_mm - sunk, 0) ** 2, atol=1e-6)


def test_spectra_of_relaxation():
    for beads in (4, 7):
        weights, rates = rouse_rates(2.0, beads)
        assert np.exp(-rates / 2.0) @ weights == pytest.approx(np.exp(-1.0)) and weights.sum() == pytest.approx(1.0)
        assert np.allclose(rates / rates[0], np.arange(1, beads + 1) ** 2) and np.ptp(weights) == 0
    for power in (0.45, 0.65):
        weights, rates = ending_rates(power, 2.0)
        assert weights.sum() == pytest.approx(1.0) and weights @ (1 / rates) == pytest.approx(0.5)
        # In the frequency: (1 + i ω τ)^{−β} with τ = 1/(2 β).
        omega = np.geomspace(0.05, 50, 40)
        parts = (1 / (1 + 1j * omega[:, None] / rates)) @ weights
        assert np.max(np.abs(parts - (1 + 0.5j * omega / power) ** -power)) < 0.015


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "fifth"))
def test_what_is_added_has_its_share(shape):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    fine, told, build = hidden("missing_relaxation_mode", shape, pad=pad, motion=Path(2.0).hold(100.0).motion())
    assert fine.force_N[-2] / 6 == pytest.approx(1 - 0.3 - told["share"], abs=0.01)
    assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
    left = fine.at(1 / told["rate"] + 0.0) / 6 - (1 - 0.3 - told["share"]) - 0.3 * np.exp(-50.0 / told["rate"])
    assert 0.25 < left / told["share"] < 0.5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shape", shapes_of("depth_dependent_relaxation", "fifth"))
def test_rates_by_depth(shape, seed):
    rates = {}
    for depth in (0.05, 0.5, 1.0, 1.5, 1.75, 2.0):
        pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
        motion = Path(depth).hold(1.5).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", shape, pad=pad, motion=motion, seed=seed)
        rates[depth] = -np.diff(np.log(fine.at(np.array([0.2, 0.7])) / (3 * depth) - 0.6))[0] / 0.5 / 2.0
    assert rates[2.0] == pytest.approx(1 + 2 * told["slope"], rel=2e-3)
    grown = {depth: (rate - 1) / (2 * told["slope"]) for depth, rate in rates.items()}
    if shape == "later":
        assert np.abs([grown[0.05], grown[0.5]]) == pytest.approx([0, 0], abs=0.01)
        assert grown[2.0] - grown[1.75] == pytest.approx(grown[1.75] - grown[1.5], abs=0.01)
        # A line that begins at 0.3 to 0.5 of the depth.
        assert 1 / 0.7 - 0.02 < (grown[2.0] - grown[1.5]) * 4 < 2.02
    else:
        assert grown[0.05] < 0.03 and grown[1.75] > 0.9 and 0.1 < grown[1.0] < 0.9


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "fifth"))
def test_damping(shape):
    for speed in (5.0, 20.0, 60.0):
        motion = Path(-0.5).to(1.9, speed).hold(0.1).to(0.5, speed).hold(0.1).motion()
        fine, told, build = hidden("viscous_damping", shape, motion=motion)
        v, x = motion.velocity(fine.time_s), np.maximum(fine.reported_mm, 0)
        sliding = np.abs(np.abs(v) - speed) < 1e-9
        steady = sliding & np.roll(sliding, 3) & (x > 0.05)
        ref = build.plant.numbers["damping_ref"]
        if shape == "squeezed_film":
            # The film is H − δ thick; 1 mm is half the greatest depth.
            factor = ((ref - 1.0) / (ref - x)) ** 3
            assert 2.5 * 2 <= ref <= 4 * 2
        else:
            factor = (ref + speed) / (ref + 20)
            assert 20 <= ref <= 80
        added = np.sign(v) * speed * told["coefficient"] * factor
        assert np.allclose(fine.force_N[steady], (3 * x + added)[steady], atol=2e-4)
    away, _, _ = hidden("viscous_damping", shape, 2.5, motion=Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion())
    assert away.force_N.min() == 0
