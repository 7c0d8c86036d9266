"""Data that cannot tell everything: the fit says so; data that cannot be fitted at all: it refuses clearly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.errors import InputError
from bench.identify import fit
from bench.recording.types import Measurement
from tests.truth.laws import Exponential
from tests.truth.motion import Path, sinusoids
from tests.truth.pad import Pad, simulate

from .closed_form import measured, measurement

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))


def notes(data: Measurement, **options: object) -> str:
    return "\n".join(fit(data, law="exponential", order=2, **options).notes)  # type: ignore[arg-type]


def of_path(pad: Pad, path: Path, rate_hz: float = 100.0, noise_N: float = 0.01) -> Measurement:
    motion = path.motion()
    time = np.arange(0, motion.duration_s, 1 / rate_hz)
    F = simulate(pad, motion, time).force_N + noise_N * np.random.default_rng(0).standard_normal(len(time))
    return measurement(time, motion.position(time), F)


def test_good_data_bring_no_warning_but_their_range() -> None:
    data = of_path(
        PAD, Path(-0.5).hold(1).to(1, 50).hold(5).to(2.4, 5).hold(9).to(0.5, 20).hold(5).to(-0.5, 50).hold(2)
    )
    (line,) = fit(data, law="exponential", order=2).notes
    assert line.startswith("Measured: times from 0.02 s to") and "depths to 2.4 mm" in line


def test_no_hold() -> None:
    motion = sinusoids(0.5, 2.5, [0.2, 1.0, 3.0], periods=6)
    time = np.arange(2.0, motion.duration_s - 3.5, 0.005)
    F = simulate(PAD, motion, time).force_N + 0.01 * np.random.default_rng(0).standard_normal(len(time))
    assert "There is no hold" in notes(measurement(time, motion.position(time), F))


def test_too_short_for_the_slowest_mode() -> None:
    slow = Pad(Exponential(2.24, 0.69), (0.25, 0.3), (4.0, 0.004))
    data = of_path(slow, Path(-0.5).hold(0.5).to(1, 80).hold(3).to(2.4, 20).hold(4).to(-0.5, 50).hold(1))
    assert "slowest mode" in notes(data)
    result = fit(data, law="exponential", order=2)
    assert "nu_2" in result.undetermined


def test_one_speed() -> None:
    path = Path(-0.5).hold(1).to(1.5, 5).hold(5).to(-0.5, 5).hold(3).to(2, 5).hold(5)
    assert "All moves are at one speed (5 mm/s)" in notes(of_path(PAD, path))


def test_force_lost_in_noise() -> None:
    data = measured(Pad(Exponential(0.01, 0.1), (0.25, 0.15), (4.0, 0.35)), noise_N=0.05)
    result = fit(data)
    assert any("less than ten times its noise" in n for n in result.notes)
    assert "nu_1" in result.undetermined


def test_saturated() -> None:
    data = measured(PAD, noise_N=0.02)
    level = 0.7 * float(data.force_N.max())
    assert f"stands at {level:.4g} N" in notes(replace(data, force_N=np.minimum(data.force_N, level)))
    assert "saturated" not in notes(data)
    assert "saturated" not in notes(replace(data, force_N=np.round(data.force_N / 0.05) * 0.05))


def test_sign_reversed_is_said_and_costs_everything() -> None:
    data = measured(PAD, noise_N=0.02)
    result = fit(replace(data, force_N=-data.force_N))
    assert any("sign is reversed" in n for n in result.notes)
    assert not result.physical or result.fit_percent < 10
    assert {"c_1", "nu_1"} & set(result.undetermined)
    result.to_json()


def test_offset_and_drift_in_air() -> None:
    data = measured(PAD, noise_N=0.02)
    time = data.force_time_s
    said = notes(replace(data, force_N=data.force_N + 0.2 + 0.02 * time), contact="unilateral")
    assert "In air the force reads" in said


def test_data_that_begin_loaded() -> None:
    data = measured(PAD, noise_N=0.02)
    late = data.force_time_s > 5.0
    cut = Measurement(
        "cut", *(a[late] for a in (data.position_time_s, data.position_mm, data.force_time_s, data.force_N))
    )
    assert "The data begin at" in notes(cut)


def test_surface_elsewhere() -> None:
    data = measured(PAD, noise_N=0.02)
    assert "The force rises only from" in notes(replace(data, position_mm=data.position_mm + 5.0))


def in_pad_s(m: Measurement) -> float:
    """When the probe first passes the surface."""
    return float(m.position_time_s[np.argmax(m.position_mm > 0)])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: replace(m, position_mm=-m.position_mm - 1), "never passes the surface"),
        (lambda m: replace(m, fit_to_s=0.9 * in_pad_s(m)), "never in the pad where the force counts"),
        (lambda m: replace(m, surface_std_mm=float(m.position_mm.max()) / 2.9), "never in the pad"),
        (lambda m: replace(m, force_N=0 * m.force_N), "force is zero throughout"),
        (lambda m: replace(m, force_N=0 * m.force_N + 1.5), r"force is 1\.5 N throughout"),
        (lambda m: replace(m, force_time_s=m.force_time_s[:9], force_N=m.force_N[:9]), "only 9 force samples"),
        (lambda m: replace(m, fit_from_s=1e9), "only 0 force samples"),
        (lambda m: replace(m, force_N=np.where(m.force_time_s > 3, np.nan, m.force_N)), "not finite"),
        (lambda m: replace(m, position_time_s=m.position_time_s[::-1]), "do not increase"),
        (lambda m: replace(m, force_time_s=np.array([]), force_N=np.array([])), "no samples"),
    ],
)
def test_refused(change, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        fit(change(measured(PAD)))
    assert str(caught.value).startswith("data:")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "magic"}, "no method `magic`"),
        ({"law": "cubic"}, "no law `cubic`"),
        ({"order": 0}, "`0` is no order"),
        ({"order": "two"}, "`two` is no order"),
        ({"contact": "glued"}, "no contact `glued`"),
        ({"law": "polynomial", "degree": 0}, "0 is no degree"),
        ({"law": "power", "degree": 2}, "power law has no degree"),
    ],
)
def test_unknown_names(options: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fit(measured(PAD), **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="continuous"):
        fit(measured(PAD), method="magic")


@pytest.mark.parametrize("seed", range(3))
def test_samples_too_far_apart_to_tell_their_noise(seed: int) -> None:
    """A row a second of presses and returns: what differs from row to row is the motion, and it was taken for noise."""
    path = Path(-0.5).hold(1)
    for depth in (1.2, 1.6, 2.0, 2.4, 2.2, 1.9):
        path = path.to(depth, 1.0).hold(3).to(-0.2, 1.0).hold(1)
    motion = path.motion()
    time = np.arange(0, motion.duration_s, 0.95)
    F = simulate(PAD, motion, time).force_N + 0.006 * np.random.default_rng(seed).standard_normal(len(time))
    said = notes(measurement(time, motion.position(time), F))
    assert "too far apart to tell their noise" in said and "ten times" not in said
