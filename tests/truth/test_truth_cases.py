"""Cases against what they promise, and detectability against arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from . import draw
from .cases import NOISES, draw_case, null_case, pair_case
from .detect import misfit, sampling
from .effects import EFFECTS, Build, effect
from .laws import Power
from .motion import Path, rich
from .pad import Pad
from .sets import written_in

CATALOGUE = (
    *("frame_compliance", "backlash", "contact_offset", "friction", "inertia", "resonance", "cogging", "force_delay"),
    *("clock_skew", "sensor_lag", "force_bias", "force_drift", "mains_hum", "saturation", "outliers", "stuck_samples"),
    *("encoder_error", "separation", "adhesion", "elastic_law", "stress_softening", "damage", "permanent_set"),
    *("missing_relaxation_mode", "depth_dependent_relaxation", "viscous_damping"),
)
SHAPES = written_in(CATALOGUE, "first", "second")
SHORT = rich(2.0, (60.0, 8.0), hold_s=0.15, long_hold_s=0.6)


# --- cases ----------------------------------------------------------------------------------------------------------


def test_every_effect_of_the_catalogue_is_here():
    assert set(CATALOGUE) <= set(EFFECTS)
    assert all(len(EFFECTS[id].shapes) >= 2 for id in CATALOGUE)


# The half of them of every day: the drawing is one for all, and each shape has tests of its own.
@pytest.mark.parametrize(
    ("id", "shape"), [*SHAPES[::2], *(pytest.param(*pair, marks=pytest.mark.long) for pair in SHAPES[1::2])]
)
def test_each_shape_changes_the_recording_at_any_size(id, shape):
    plain = {"motion": SHORT, "rate_hz": 800.0, "noise_kind": "white", "own_clock": False, "jitter": "none"}
    for size in (0.05, 1.0, 2.5):
        case = draw_case(17, (id,), size, shape, **plain)
        columns = [case.time_s, case.position_mm, case.force_N]
        assert all(np.all(np.isfinite(c)) for c in columns) and np.all(np.diff(case.time_s) > 0)
        assert case.truth.shapes == {id: shape} and case.truth.sizes == {id: size}
        assert np.max(np.abs(case.truth.clean_N)) < 80
        numbers = [v for v in case.truth.parameters[id].values() if not isinstance(v, str)]
        assert np.all(np.isfinite(numbers))
    if id == "separation":
        assert case.believed["pad"]["contact"] == "bonded" and case.truth.pad.contact == "unilateral"


@pytest.mark.parametrize("seed", [pytest.param(s, marks=[pytest.mark.long] if s % 3 else []) for s in range(10)])
def test_cases_stay_in_their_ranges(seed):
    case = draw_case(seed, ("friction",))
    truth = case.truth
    assert 30 <= case.time_s[-1] - case.time_s[0] <= 100.1 and len(case.time_s) <= 40_001
    assert 100 <= truth.rate_hz <= 2000 and 0.003 <= truth.noise.std <= 0.0301
    assert 0.3 <= truth.sizes["friction"] <= 2.0
    assert truth.noise_floor_N >= truth.noise.std * (1 - 1e-9)
    off = case.force_N - truth.clean_N
    assert np.std(off) == pytest.approx(truth.noise.std, rel=0.15)
    believed, true = truth.believed.parameters(), truth.structure.parameters()
    assert all(abs(believed[k] / true[k] - 1) <= 0.121 for k in true if true[k])
    again = draw_case(seed, ("friction",))
    assert np.array_equal(again.force_N, case.force_N) and again.believed == case.believed


def test_an_effect_is_the_same_alone_and_in_company():
    pair = pair_case(5, ("friction", "frame_compliance"))
    for id in pair.truth.ids:
        alone = pair.alone(id)
        assert alone.truth.parameters[id] == pair.truth.parameters[id]
        assert alone.truth.pad == pair.truth.pad and np.array_equal(alone.time_s, pair.time_s)
    with pytest.raises(ValueError, match="two ids"):
        pair_case(5, ("friction",))


ELSEWHERE = ("frame_compliance", "separation", "backlash", "encoder_error")  # itself, other contact, other positions


@pytest.mark.parametrize("id", [id for id in CATALOGUE if id not in ELSEWHERE])
def test_the_frame_goes_with_every_other_effect(id):
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = pair_case(7, ("frame_compliance", id), size=1.0, shape={"frame_compliance": "linear"}, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    left = fine.reported_mm - fine.probe_mm - compliance * fine.cell_N
    # Where adhesion snaps no place satisfies both, for a step.
    assert np.sum(np.abs(left[1:]) > 1e-8) <= (12 if id == "adhesion" else 0)


def test_requests_that_cannot_be_met_are_refused():
    with pytest.raises(ValueError, match="no shape"):
        draw_case(0, ("friction",), 1.0, {"friction": "sticky"})
    with pytest.raises(ValueError, match="no override"):
        null_case(0, colour="red")


@pytest.mark.parametrize("kind", NOISES)
def test_faults_are_flagged(kind):
    plain = {"motion": SHORT, "rate_hz": 1000.0, "noise_kind": kind}
    case = draw_case(2, ("outliers", "stuck_samples", "saturation"), 1.0, **plain)
    truth = case.truth
    limit = truth.parameters["saturation"]["limit"]
    assert truth.flagged.sum() > 0.1 * truth.flags["saturated"].sum()
    assert truth.flags["outlier"].mean() == pytest.approx(truth.parameters["outliers"]["fraction"], rel=0.5)
    assert truth.flags["stuck"].mean() == pytest.approx(truth.parameters["stuck_samples"]["fraction"], rel=0.2)
    assert np.all(np.abs(truth.fault_N[truth.flags["outlier"] & ~truth.flags["stuck"]]) > 19.9 * truth.noise.std)
    assert np.all(truth.fault_N[~truth.flags["outlier"] & ~truth.flags["stuck"]] == 0)
    stuck = np.flatnonzero(truth.flags["stuck"])
    assert np.array_equal(case.force_N[stuck], case.force_N[stuck - 1])
    assert truth.clean_N.max() <= limit and truth.flags["saturated"].any()


def test_what_the_lab_gets(tmp_path):
    case = draw_case(8, ("clock_skew",), 1.0, "stamped", motion=SHORT, rate_hz=500.0)
    folder = case.write(tmp_path / "case")
    rows = (folder / "data.csv").read_text().splitlines()
    assert rows[0] == "time_s,position_mm,force_N,force_time_s" and len(rows) == len(case.time_s) + 1
    assert np.allclose(np.loadtxt(rows[1:], delimiter=",")[:, 2], case.force_N, rtol=1e-8)
    assert yaml.safe_load((folder / "believed.yaml").read_text()) == case.believed
    assert set(case.believed["pad"]) == {"elastic", "relaxation", "contact"}


# --- detectability --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_nothing_hidden_leaves_nothing(seed):
    found = misfit(null_case(seed))
    assert found.chi2 < 1 and not found.detectable


def test_misfit_of_hum_is_its_power():
    case = draw_case(4, ("mains_hum",), 1.0, "sine", rate_hz=400.0, noise_kind="white", position_noise_mm=0.0,
                     position_step_mm=0.0, own_clock=False)  # fmt: skip
    truth = case.truth
    expected = len(case.time_s) * truth.parameters["mains_hum"]["amplitude"] ** 2 / (2 * truth.noise.std**2)
    assert misfit(case).chi2 == pytest.approx(expected, rel=0.02)


def test_misfit_goes_with_the_square_of_size():
    plain = {"noise_kind": "white", "rate_hz": 300.0, "own_clock": False}
    small, large = (misfit(draw_case(6, ("cogging",), size, "sine", **plain)).chi2 for size in (0.1, 0.4))
    assert large / small == pytest.approx(16, rel=0.1)
    assert not misfit(draw_case(6, ("cogging",), 1e-4, "sine", **plain)).detectable


def test_refit_absorbs_what_the_structure_can():
    # A gain of the force is another law, and a mode whose share and rate change is still the same structure.
    case = null_case(9, motion=SHORT, noise_kind="white", rate_hz=500.0, law="power")
    truth = case.truth
    stronger = replace(case, truth=replace(truth, clean_N=1.3 * truth.clean_N))
    found = misfit(stronger)
    assert found.chi2 < 0.5
    assert found.refitted.law.p == pytest.approx(1.3 * truth.pad.law.p, rel=1e-2)


def test_whitening_counts_what_slow_noise_hides():
    plain = {"rate_hz": 500.0, "own_clock": False, "jitter": "none", "noise_N": 0.01}
    white, slow = (
        misfit(draw_case(10, ("force_drift",), 1.0, "linear", noise_kind=k, **plain)).chi2
        for k in ("white", "coloured")
    )
    assert slow < white / 2


def test_sampling_is_harmless_in_the_cases_drawn():
    assert np.median([sampling(null_case(seed)) for seed in range(8)]) < 5


def test_noise_of_the_position_is_counted():
    drawn = draw.DrawnPad(Pad(Power(2.0, 0.0), (0.2,), (2.0,)), 2.0, 4.0)
    case = null_case(1, drawn=drawn, motion=Path(1.0).hold(20.0).motion(), noise_N=0.003, position_noise_mm=1e-3,
                     position_step_mm=0.0, rate_hz=200.0)  # fmt: skip
    assert case.truth.noise_floor_N == pytest.approx(np.hypot(0.003, 2.0 * 1e-3), rel=1e-6)
    assert np.std(case.position_mm - 1.0) == pytest.approx(1e-3, rel=0.1)
    assert case.truth.noise.std == pytest.approx(0.003)


def test_an_effect_outside_the_catalogue_takes_its_place(monkeypatch):
    def warming(build: Build, shape: str, size: float) -> dict[str, float]:
        build.plant.gain.append(lambda t, x: 1 - 0.05 * size * -np.expm1(-t / 20))
        return {"softer": 0.05 * size}

    effect("warming", "exponential")(warming)
    monkeypatch.setitem(EFFECTS, "warming", EFFECTS.pop("warming"))
    case = draw_case(3, ("warming",), 1.0, own_clock=False)
    assert case.truth.parameters == {"warming": {"softer": 0.05}} and misfit(case).detectable
