"""How a method came to its numbers, on the page: poles, convergence, numbers against the sample time."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from bench.fitview import fit_view, over_times
from bench.identify import fit
from bench.report import OverTimes
from bench.report.page import report_page
from bench.report.scheme import convergence, section
from tests.bench.identify.discrete_data import measurement, steps

from . import samples
from .html_check import check

POLES = {"sample_time_s": 0.01, "a": [1, -1.0, 0.2], "b": [1, 0, 0], "poles": [[0.9, 0.0], [-0.5, 0.0], [0.3, 0.4]]}


def of_method(**changes):
    run = samples.recording(rate_Hz=200.0, force_rate_Hz=200.0)
    return run, dataclasses.replace(samples.fit(run, filter=POLES, iterations=3), **changes)


def test_the_default_method_has_no_such_section():
    run = samples.recording(rate_Hz=200.0, force_rate_Hz=200.0)
    assert section(samples.fit(run)) == "" and section(None) == ""


def test_poles_are_read_as_rates_or_said_to_be_none():
    run, view = of_method(history={"V": [3.0, 2.0, 1.0]})
    words = check(report_page(run, view)).shown
    # −ln 0.9 / 0.01 s
    assert "0.9000 0.9000 10.54" in words
    assert "−0.5000 0.5000 – no relaxation" in words and "0.3000 + 0.4000 i 0.5000 – no relaxation" in words
    assert "V of (16) after each of 3 iterations" in words


def test_V_falls_as_many_times_as_there_were_iterations():
    _, view = of_method(history={"V": [1.0, 0.1, 0.01, 0.001]})
    svg = convergence(view)
    pairs = [re.findall(r"(-?[\d.]+) (-?[\d.]+)", d) for d in re.findall(r'\sd="(M[^"a-zC]*)"', svg)]
    [line] = [several for several in pairs if len(several) == 4]
    y = [float(y) for _, y in line]
    steps_down = np.diff(y)  # even on a logarithmic axis; the SVG's y goes down
    assert len(y) == 4 and np.all(steps_down > 0) and np.allclose(steps_down, steps_down[0], rtol=0.01)
    assert convergence(of_method(history={"V": [1.0]})[1]) == ""


def test_over_sample_times_both_panels_and_what_was_refused():
    T = np.array([0.01, 0.02, 0.04])
    over = OverTimes(
        T,
        {"m": np.array([2.0, 2.1, 2.4])},
        np.array([[4.0, 0.3], [4.1, 0.3], [np.nan, np.nan]]),
        np.array([True, True, False]),
        0.02,
        {0.001: "shorter than the samples"},
    )
    run, view = of_method(over_times=over)
    seen = check(report_page(run, view))
    assert "law, over this fit's" in seen.words and "sample time T, s" in seen.words
    assert "T = 0.00100 s: shorter than the samples" in seen.shown


@pytest.mark.long
def test_a_discrete_fit_is_repeated_at_other_sample_times():
    m = measurement(steps())
    result = fit(m, method="iv", law="exponential", order=2, sample_time=0.02)
    over = over_times(result, [m])
    assert over is not None and over.chosen == 0.02 and len(over.T) == 5
    here = over.T == 0.02
    assert over.numbers["m"][here] == pytest.approx(result.parameters["m"].value, rel=1e-6)
    # iv is consistent, and the truth does not hang on T
    assert over.physical.all() and np.allclose(over.rates, [[4.0, 0.35]], rtol=0.2)
    assert fit_view(result, over).over_times is over and set(fit_view(result).history) >= {"V", "m"}
    assert over_times(fit(m, method="recursive", law="exponential", order=2), [m]) is None


def test_no_relaxation_is_drawn_where_the_filter_is_none():
    # ARX at a short T, with noise: a negative pole
    result = fit(measurement(steps()), method="iterative", law="exponential", order=2)
    assert not result.physical and fit_view(result).relaxation is None
