"""The second shapes of the catalogue's effects against closed forms, beside those of test_truth_effects."""

import numpy as np
import pytest

from .cases import draw_case, null_case
from .effects import EFFECTS, effect, more_shapes
from .effects.registry import _FIRST, _MORE
from .effects.second_machine import Rough
from .effects.second_pad import Gent
from .laws import Power
from .motion import Path, rich
from .pad import Pad
from .test_truth_effects import disturbed, hidden, numbers

SHORT = rich(2.0, (60.0, 8.0), hold_s=0.15, long_hold_s=0.6)
QUIET = {"noise_N": 1e-6, "jitter": "none", "own_clock": False, "rate_hz": 1000.0, "motion": SHORT, "law": "power"}


def test_further_shapes_come_before_or_after_the_first(monkeypatch):
    for known in (EFFECTS, _FIRST, _MORE):
        monkeypatch.setitem(known, "wobble", None)
        monkeypatch.delitem(known, "wobble")
    more_shapes("wobble", "late")(lambda build, shape, size: {"more": size})
    assert "wobble" not in EFFECTS
    effect("wobble", "early", contact="bonded")(lambda build, shape, size: {"first": size})
    more_shapes("wobble", "later")(lambda build, shape, size: {"most": size})
    made = EFFECTS["wobble"]
    assert made.shapes == ("early", "late", "later") and made.drawn == ("early",) and made.contact == "bonded"
    told = [made.hide(None, shape, 2.0) for shape in made.shapes]
    assert told == [{"first": 2.0}, {"more": 2.0}, {"most": 2.0}]


def test_a_seed_draws_among_the_first_shapes():
    drawn = {draw_case(seed, ("friction",), motion=SHORT, rate_hz=200.0).truth.shapes["friction"] for seed in range(12)}
    assert "dwell" not in drawn and drawn <= set(EFFECTS["friction"].shapes)
    assert draw_case(0, ("friction",), 1.0, "dwell", motion=SHORT).truth.shapes == {"friction": "dwell"}


def test_play_closes_by_itself():
    motion = Path(0.0).to(1.0, 5.0).to(0.5, 5.0).hold(3.0).motion()
    fine, told, _ = hidden("backlash", "greased", motion=motion)
    rest = fine.time_s > 0.35
    left, t = (fine.probe_mm - fine.reported_mm)[rest], fine.time_s[rest]
    decay = np.diff(np.log(left[::1000])) / np.diff(t[::1000])
    assert left[0] == pytest.approx(told["gap"], rel=0.3) and np.ptp(decay) < 1e-6 and -1 / 0.3 <= decay[0] <= -1 / 2


def test_a_joint_gives_way_beyond_its_preload():
    told = {"frame_form": 3, "frame_mm_N": 0.02, "frame_force_N": 2.0, "frame_stiff_share": 0.5}
    fine = numbers(Path(-0.5).to(2.0, 20.0).hold(0.2).motion(), **told)
    force = fine.cell_N
    wanted = 0.01 * force + 0.01 * np.maximum(force - 2.0, 0)
    assert np.allclose(fine.reported_mm - fine.probe_mm, wanted, atol=1e-9) and force.max() > 4


def test_friction_grows_with_the_logarithm_of_rest():
    peaks = []
    for rest_s in (0.5, 2.0, 8.0):
        motion = Path(-1.5).to(-1.0, 5.0).hold(rest_s).to(-0.5, 5.0).motion()
        fine, told, _ = hidden("friction", "dwell", motion=motion, seed=4)
        after = fine.time_s > rest_s + 0.1
        peaks.append(fine.force_N[after].max() / told["coulomb"])
    steps = np.diff(peaks)
    assert peaks[0] > 1.02 and np.all(steps > 0) and steps[1] == pytest.approx(steps[0], rel=0.15)


def test_laws_made_of_others():
    law = Rough(Power(3.0, 0.0), 0.02)
    assert law.force(0.0) == 0 and law.force(1.0) == pytest.approx(3 * (1 - 0.05))
    assert 0 < law.force(0.02) < 3 * 0.02
    # Small strains: 3 A δ/H; near the limit of the chains far above the law without it.
    assert Gent(2.0, 5.0, 50.0).force(0.01) == pytest.approx(3 * 2.0 * 0.01 / 50, rel=1e-3)
    assert Gent(1.0, 1.0, 4.0).force(2.0) > 2 * Gent(1.0, 100.0, 4.0).force(2.0)


def test_a_bond_bears_tension_once():
    pad = Pad(Power(3.0, 0.0), (0.5,), (3.0,))
    path = Path(0.0)
    for _ in range(2):
        path.to(2.0, 50.0).hold(2.0).to(-0.2, 50.0).hold(4.0)
    fine, _, build = hidden("separation", "bond_breaks", pad=pad, motion=path.motion())
    first = fine.time_s < 4
    assert build.believed.contact == "bonded"
    assert -0.06 <= fine.force_N[first].min() < -0.04 and fine.force_N[~first].min() == 0


def test_zeros_of_a_resonance():
    # Long after the start a swing at the frequency of the zeros comes through damped by theirs alone.
    fine, told, build = hidden("resonance", "antiresonance", motion=SHORT)
    (_, stage), t = build.plant.sensor[0], np.arange(0, 3, 1e-4)

    def gain(frequency):
        return np.max(np.abs(stage(t, np.sin(2 * np.pi * frequency * t))[t > 2.5]))

    tones = told["frequency"] * np.linspace(1.2, 2.4, 25)
    least = tones[np.argmin([gain(f) for f in tones])] / told["frequency"]
    assert 1.3 < least < 2.3 and min(gain(f) for f in tones) < 0.3 and gain(told["frequency"]) > 1.2
    assert gain(0.5) == pytest.approx(1.0, abs=1e-2)


def test_a_polled_force_is_late_by_the_mean_delay():
    _, told, build = hidden("force_delay", "polled")
    t = np.arange(20_000) / build.rate_hz + 1e-4
    measured = build.delays[0](t, None)
    lateness, delay = t - measured, told["delay"]
    assert np.mean(lateness) == pytest.approx(delay, rel=0.03) and np.std(lateness) > 0.05 * delay
    assert lateness.min() > 0.49 * delay and lateness.max() < 1.51 * delay
    assert np.all(np.diff(measured) > 0)  # no reading comes twice


def test_a_clock_that_walks_has_its_mean_skew():
    case = draw_case(5, ("clock_skew",), 1.0, "random_walk", **(QUIET | {"own_clock": True}))
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    end = 1e-6 * case.truth.parameters["clock_skew"]["skew"] * t[-1]
    assert off[-1] == pytest.approx(end, rel=0.5) and np.all(np.diff(case.force_time_s) > 0)
    assert np.max(np.abs(off - np.polyval(np.polyfit(t, off, 1), t))) > 1e-3 * abs(end)


def test_a_bias_settles():
    t = np.linspace(0, 100, 2000)
    samples, told = disturbed("force_bias", "settling", t)
    assert samples.clean_N[0] == pytest.approx(7 / 6 * told["bias"])
    assert samples.clean_N[-1] == pytest.approx(told["bias"], rel=1e-3)


def test_faults_of_the_second_shapes():
    shapes = {"outliers": "bit_errors", "stuck_samples": "beat", "saturation": "slow_recovery"}
    case = draw_case(2, tuple(shapes), 1.0, shapes, motion=SHORT, rate_hz=1000.0, noise_kind="white")
    truth = case.truth
    stuck, off = truth.flags["stuck"], truth.flags["outlier"] & ~truth.flags["stuck"]
    assert np.ptp(np.diff(np.flatnonzero(stuck))) <= 1
    assert np.array_equal(case.force_N[stuck], case.force_N[np.flatnonzero(stuck) - 1])
    sizes = np.abs(truth.fault_N[off])
    unit = sizes.min()
    assert unit > 19.9 * truth.noise.std and np.all(np.isclose(sizes, unit) | np.isclose(sizes, 2 * unit))
    plain = null_case(2, motion=SHORT, rate_hz=1000.0, noise_kind="white").truth.clean_N
    limit = truth.parameters["saturation"]["limit"]
    recovering = truth.flags["saturated"] & (plain < limit - 0.01)
    assert recovering.any() and np.all(truth.clean_N[recovering] == limit)
