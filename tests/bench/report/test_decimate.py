import numpy as np
import pytest

from bench.report.decimate import keep, thin, thin_path


def test_extremes_survive_and_points_are_few() -> None:
    random = np.random.default_rng(0)
    t = np.sort(random.uniform(0, 100, 200_000))
    y = random.standard_normal(t.size)
    y[123_457], y[4_321] = 99.0, -77.0
    x, thinned = thin(t, y, 800)
    assert x.size <= 4 * 800 + 2
    assert thinned.max() == 99.0 and thinned.min() == -77.0
    assert (x[0], x[-1]) == (t[0], t[-1])
    assert np.all(np.diff(x) > 0)


def test_every_pixel_column_keeps_its_own_range() -> None:
    random = np.random.default_rng(1)
    t = np.linspace(0.0, 10.0, 50_000)
    y = np.cumsum(random.standard_normal(t.size))
    columns = 300
    index = keep(t, y, columns)
    of = np.minimum((t / 10.0 * columns).astype(int), columns - 1)
    for column in range(columns):
        inside = of == column
        kept = index[of[index] == column]
        assert y[kept].max() == y[inside].max()
        assert y[kept].min() == y[inside].min()
        assert kept[0] == np.flatnonzero(inside)[0] and kept[-1] == np.flatnonzero(inside)[-1]


def test_short_signals_are_left_alone() -> None:
    t = np.arange(100.0)
    x, y = thin(t, t**2, 400)
    assert np.array_equal(x, t) and np.array_equal(y, t**2)


def test_nan_stays_a_break() -> None:
    t = np.linspace(0, 1, 20_000)
    y = np.sin(20 * t)
    y[9_000:11_000] = np.nan
    x, thinned = thin(t, y, 200)
    broken = np.isnan(thinned)
    assert broken.any()
    assert np.all((x[broken] >= t[9_000]) & (x[broken] < t[11_000]))
    # on either side of the gap the line reaches up to it
    assert t[8_999] in x and t[11_000] in x


@pytest.mark.parametrize("n", [0, 1, 2])
def test_almost_nothing(n: int) -> None:
    x, y = thin(np.arange(float(n)), np.zeros(n), 10)
    assert x.size == y.size == n


def test_all_samples_at_one_time() -> None:
    x, y = thin(np.zeros(1000), np.arange(1000.0), 10)
    assert y.max() == 999.0 and y.min() == 0.0 and x.size == y.size


def test_a_loop_run_many_times_is_drawn_once() -> None:
    angle = np.linspace(0, 2 * np.pi * 200, 200 * 720, endpoint=False)
    x, y = thin_path(np.cos(angle), np.sin(angle), 0.005, 0.005)
    assert x.size < 3 * 720
    drawn = np.stack([x, y])[:, np.isfinite(x)]
    for phi in np.linspace(0, 2 * np.pi, 50):
        gap = np.hypot(drawn[0] - np.cos(phi), drawn[1] - np.sin(phi)).min()
        assert gap < 0.01


def test_no_sample_is_further_than_a_pixel_from_the_path() -> None:
    random = np.random.default_rng(2)
    x, y = np.cumsum(random.standard_normal((2, 5_000)), axis=1)
    px, py = thin_path(x, y, 1.5, 1.5)
    good = np.isfinite(px)
    px, py = px[good], py[good]
    for i in range(0, 5_000, 37):
        assert np.maximum(np.abs(px - x[i]), np.abs(py - y[i])).min() <= 1.5
    assert x.max() - px.max() <= 1.5 and y.max() - py.max() <= 1.5


def test_a_path_that_stands_still_is_a_point() -> None:
    x, y = thin_path(np.full(100, 2.0), np.full(100, 3.0), 0.1, 0.1)
    assert x.tolist() == [2.0] and y.tolist() == [3.0]
