"""What the discrete methods and the recursion owe to the data they are given: what counts, a surface in doubt, which
ramps show the elastic law, and no mode that is not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.errors import InputError
from bench.identify import fit
from bench.identify.discrete.series import sampled
from bench.recording.types import Measurement
from tests.truth import draw
from tests.truth.dataset import make
from tests.truth.motion import Path
from tests.truth.noise import Noise, White
from tests.truth.pad import simulate

from .discrete_data import measurement, steps


def of_path(path: Path, seed: int = 0, rate_hz: float = 500.0, noise_N: float = 0.01) -> Measurement:
    motion = path.motion()
    t = np.arange(0, motion.duration_s, 1 / rate_hz)
    force = simulate(draw.POLYURETHANE, motion, t).force_N
    return Measurement(
        "run", t, motion.position(t), t, force + noise_N * np.random.default_rng(seed).standard_normal(len(t))
    )


# --- what counts ---


def test_doubtful_spans_are_history_and_cost_nothing():
    m = measurement(steps())
    spoiled = (m.force_time_s > 6.0) & (m.force_time_s < 7.0)
    bad = replace(m, force_N=np.where(spoiled, m.force_N + 5.0, m.force_N))
    named = replace(bad, doubtful=[(6.0, 7.0)])
    whole, left_out = sampled([m], 0.02), sampled([named], 0.02)
    assert left_out.weight == pytest.approx(whole.weight - 50, abs=2)
    options = {"method": "iv", "law": "exponential", "order": 2, "sample_time": 0.02}
    true, right, wrong = (fit(data, **options).parameters["nu_1"].value for data in (m, named, bad))  # type: ignore[arg-type]
    assert right == pytest.approx(true, rel=0.02) and abs(wrong / true - 1) > 0.05


# --- a surface in doubt ---


@pytest.mark.long
@pytest.mark.parametrize("method", ["noniterative", "iterative", "iv", "fast"])
def test_the_surface_s_doubt_is_in_the_standard_errors(method):
    m, doubt_mm = of_path(Path(-0.5).hold(0.5).to(2.4, 80).hold(8).to(1.2, 80).hold(4)), 0.02
    options = {"method": method, "law": "exponential", "order": 1, "sample_time": 0.02}

    def at(by_mm: float, std_mm: float = 0.0):
        return fit(replace(m, position_mm=m.position_mm + by_mm, surface_std_mm=std_mm), **options).parameters  # type: ignore[arg-type]

    certain, doubted, up, down = at(0.0), at(0.0, doubt_mm), at(doubt_mm), at(-doubt_mm)
    for name in ("m", "b"):
        assert doubted[name].value == certain[name].value
        # what one standard deviation of the surface does to the number, by doing it
        moves = abs(up[name].value - down[name].value) / 2
        assert np.sqrt(doubted[name].std ** 2 - certain[name].std ** 2) == pytest.approx(moves, rel=0.15, abs=2e-4)


@pytest.mark.long
def test_intervals_hold_over_surfaces_that_are_off():
    inside = []
    for seed in range(8):
        off_mm = 0.02 * float(np.random.default_rng([3, seed]).standard_normal())
        m = of_path(Path(-0.5).hold(0.5).to(2.4, 80).hold(6).to(1.2, 80).hold(4), seed)
        moved = replace(m, position_mm=m.position_mm + off_mm, surface_std_mm=0.02)
        found = fit(moved, method="iv", law="exponential", order=2, sample_time=0.02).parameters["m"]
        inside.append(abs(found.value - 2.24) < 2.6 * found.std)
        assert found.std < 0.2
    assert sum(inside) >= 7


# --- fast: which ramps ---


def test_a_touch_off_just_before_does_not_count_as_load():
    # 20 µm for half a second, with less than a hundredth of the ramp's force, and no rest to speak of after it
    path = Path(-0.3).hold(0.5).to(0.02, 2).hold(0.5).to(-0.3, 2).hold(0.2).to(2.0, 80).hold(6)
    f = fit(of_path(path, rate_hz=1000.0), method="fast", law="exponential", order=1)
    force = f.model.pad.law.force(np.array([2.0])).item()
    assert force == pytest.approx(2.24 / 0.69 * np.expm1(0.69 * 2.0), rel=0.03)
    assert f.figures["depth_read"] == pytest.approx(1.0, abs=0.02)


def test_a_press_just_before_does():
    path = Path(-0.3).hold(0.5).to(1.0, 80).hold(2).to(-0.3, 80).hold(0.5).to(2.0, 80).hold(6)
    f = fit(of_path(path, rate_hz=1000.0), method="fast", law="exponential", order=1)
    assert f.figures["depth_read"] == pytest.approx(0.5, abs=0.02)
    assert any("1 rising ramp from a recovered pad" in note for note in f.notes)
    assert any("end at 1 mm of 2 mm" in note and "`long_hold`" in note for note in f.notes)


def test_of_a_quick_and_a_slow_ramp_the_quick_one_is_read():
    path = Path(-0.3).hold(0.5).to(2.0, 80).hold(1).to(-0.3, 80).hold(15).to(2.0, 0.5).hold(4)
    f = fit(of_path(path, rate_hz=1000.0), method="fast", law="exponential", order=1)
    assert any("1 rising ramp from a recovered pad" in note for note in f.notes)
    assert 0 <= f.figures["loss_in_ramp"] < 0.05


def test_it_refuses_ramps_that_show_too_little_and_says_what_would_do():
    path = Path(-0.3).hold(0.5).to(0.2, 80).hold(2).to(2.0, 80).hold(6)
    with pytest.raises(InputError, match="end at 0.2 mm of 2") as caught:
        fit(of_path(path, rate_hz=1000.0), method="fast", law="exponential", order=1)
    assert "60 mm/s or more" in str(caught.value) and "`long_hold`" in str(caught.value)


def test_preconditioning_is_history_for_it_too():
    m = of_path(Path(-0.3).hold(0.5).to(2.0, 80).hold(0.1).to(-0.3, 80).hold(15).to(1.0, 80).hold(6), rate_hz=1000.0)
    counted = replace(m, fit_from_s=5.0)
    f = fit(counted, method="fast", law="exponential", order=1)
    assert f.figures["depth_read"] == pytest.approx(0.5, abs=0.02)


def test_a_spline_is_refused_with_the_reason():
    for method in ("iterative", "recursive"):
        with pytest.raises(InputError, match="more numbers than these methods can tell") as caught:
            fit(measurement(steps()), method=method, law="spline")
        assert "--method continuous" in str(caught.value)


# --- the recursion's order ---


def test_the_recursion_takes_no_mode_that_is_not_there():
    found = []
    for seed in range(6):
        rng = np.random.default_rng([3, seed])
        drawn = draw.pad(rng, ["exponential"], (1 + seed % 2,))
        motion = draw.motion(rng, drawn.depth_mm, ["staircase", "rate_sweep"])
        data = make(drawn.pad, motion, 200.0, Noise(White(0.002 * drawn.force_N)), rng)
        f = fit(measurement(data), method="recursive", law="exponential")
        chosen = next(e for e in f.evidence if e.chosen)
        assert chosen.eligible or not any(e.eligible for e in f.evidence)
        found.append(f.order - len(drawn.pad.rates))
    assert max(found) <= 0 and found.count(0) >= 5


def test_a_mode_more_must_be_a_clear_gain():
    from types import SimpleNamespace

    from bench.identify.recursive import _pick
    from bench.identify.select import CLEAR

    def one(size: int, distinct: bool = True, converged: bool = True):
        return SimpleNamespace(
            physical=True, converged=converged, distinct=distinct, structure=SimpleNamespace(size=size)
        )

    small, large, twin = one(4), one(6), one(8, distinct=False)
    assert _pick([(0.0, large), (CLEAR / 2, small)]) is small  # type: ignore[list-item]
    assert _pick([(0.0, large), (2 * CLEAR, small)]) is large  # type: ignore[list-item]
    assert _pick([(0.0, twin), (50.0, large)]) is large  # type: ignore[list-item]
    assert _pick([(0.0, twin)]) is twin  # type: ignore[list-item]


@pytest.mark.parametrize(("share", "said"), [(0.7, "leaves 2 samples to fit"), (1.2, "leaves 1 sample to fit")])
def test_a_sample_time_that_leaves_next_to_nothing(share, said):
    data = of_path(Path(-0.3).hold(0.5).to(2.0, 80).hold(3))
    with pytest.raises(InputError, match=said):
        sampled([data], share * float(np.ptp(data.force_time_s)))


# --- what the grid does ---


@pytest.mark.parametrize("method", ["noniterative", "iv"])
def test_what_the_grid_shifts_is_in_the_standard_errors_and_said(method):
    """Fast ramps between the samples of a grid of 20 ms: the quick share comes out too small, whatever the noise."""
    path = Path(-0.5).hold(0.5).to(1.2, 80).hold(4).to(2.4, 80).hold(4).to(0.6, 80).hold(4)
    z, shifted = [], 0
    for seed in range(6):
        found = fit(of_path(path, seed), method=method, law="exponential", order=2, sample_time=0.02)
        truth = draw.POLYURETHANE.parameters()
        z += [(found.parameters[n].value - truth[n]) / found.parameters[n].std for n in ("c_1", "c_2", "nu_1", "nu_2")]
        shifted += any("The grid shifts its numbers" in note and "c_1 by -" in note for note in found.notes)
        assert found.model_dict["pad"]["std"]["c_1"] == found.parameters["c_1"].std
    assert np.mean(np.abs(z) < 2) > 0.85 and shifted == 6
