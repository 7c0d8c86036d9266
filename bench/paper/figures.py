"""The paper's figures from the simulated pads: 1, 4 and 5, and 6 to 9 from draw 0."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.identify.discrete.series import Data, sampled
from bench.paper.draws import Draw
from bench.paper.experiment import ORDERS, PADS, Fitted, measured, response
from bench.paper.findings import best, of
from bench.paper.settings import Array, PadName, Settings
from bench.report import axes as parts
from bench.report.style import TIME_RAMP, light
from bench.report.svg import render
from sim.model import Model

SLOWEST_MM_S, QUICKEST_MM_S = 1e-3, 1e6  # between which "fast enough" is looked for
POINTS = 600  # of a curve of Fig. 1


@dataclass(frozen=True)
class Picture:
    """A figure: file name without its ending, title, caption, SVG for a page."""

    name: str
    title: str
    caption: str
    svg: str

    @property
    def standalone(self) -> str:
        """The SVG as a file of its own: with its name space, a white ground, and colours instead of the page's."""
        plain = re.sub(r"var\(--([a-z0-9-]+)\)", lambda m: light(m[1]), self.svg)
        head, rest = plain.split(">", 1)
        ground = f'<rect width="100%" height="100%" fill="{light("paper")}"/>'
        fonts = "<style>text{font-family:sans-serif}</style>"
        return f'{head} xmlns="http://www.w3.org/2000/svg">{fonts}{ground}{rest}\n'


def ramp_force(model: Model, depth_mm: float, speed_mm_s: float) -> tuple[Array, Array]:
    """Depth (n,) and force (n,) of a ramp at constant speed to `depth_mm`."""
    depth = np.linspace(0.0, depth_mm, POINTS)
    return depth, model.simulate(depth / speed_mm_s, depth)


def fast_enough(model: Model, depth_mm: float, short: float) -> float:
    """The least speed (mm/s) of a ramp whose force at `depth_mm` is within the share `short` of F^e there."""
    elastic = float(model.pad.law.force(np.array([depth_mm]))[0])
    low, high = np.log(SLOWEST_MM_S), np.log(QUICKEST_MM_S)
    for _ in range(50):
        middle = (low + high) / 2
        reached = ramp_force(model, depth_mm, float(np.exp(middle)))[1][-1] >= (1 - short) * elastic
        low, high = (low, middle) if reached else (middle, high)
    return float(np.exp(high))


def pictures(settings: Settings, draws: Sequence[Draw]) -> list[Picture]:
    """All of them."""
    grids = {pad: sampled([measured(settings, pad, 0)], settings.sample_time_s) for pad in PADS}
    out = [_fig_1(settings), _fig_4(grids["polyurethane"]), _fig_5(settings)]
    for name, title, pad, method, law in (
        ("fig6", "Fig. 6: polyurethane, noniterative", "polyurethane", "noniterative", "power"),
        ("fig7", "Fig. 7: polyurethane, iterative", "polyurethane", "iterative", "exponential"),
        ("fig8", "Fig. 8: silicone, iterative", "silicone", "iterative", "exponential"),
        ("fig9", "Fig. 9: polyurethane, fast", "polyurethane", "fast", "exponential"),
    ):
        fits = next(of(draws[:1], pad, method, law))
        out.append(_responses(settings, grids["silicone" if pad == "silicone" else "polyurethane"], name, title, fits))
    return out


def _fig_1(settings: Settings) -> Picture:
    depth = settings.trajectory.depth_mm
    lines = []
    for pad in PADS:
        speeds = [f"{fast_enough(settings.pad(pad), depth, s):.3g} mm/s for {100 * s:g} %"
                  for s in settings.criteria.fast_enough]  # fmt: skip
        lines.append(f"{pad}: {', '.join(speeds)}")

    def draw(figure: Figure) -> None:
        for ax, pad in zip(_grid(figure, 1), PADS, strict=True):
            _fig_1_panel(ax, settings, pad)

    caption = (f"Force of ramps at constant speed, and the elastic response they tend to. How fast is fast enough, for "
               f"a force at {depth:g} mm within so much of Fᵉ: {'; '.join(lines)}.")  # fmt: skip
    svg = render("fig1", "Force against depth at several speeds", parts.WIDE, 340.0, draw)
    return Picture("fig1", "Fig. 1: force against depth", caption, svg)


def _fig_1_panel(ax: Axes, settings: Settings, pad: PadName) -> None:
    model, depth_mm = settings.pad(pad), settings.trajectory.depth_mm
    speeds = settings.speeds_mm_s
    for i, speed in enumerate(speeds):
        colour = light(f"time-{round(i * (len(TIME_RAMP) - 1) / max(len(speeds) - 1, 1))}")
        ax.plot(*ramp_force(model, depth_mm, speed), color=colour, label=f"{speed:g} mm/s")
    depth = np.linspace(0.0, depth_mm, POINTS)
    ax.plot(depth, model.pad.law.force(depth), "--", color=light("ink"), label="Fᵉ")
    ax.set_title(pad, loc="left")
    ax.set_xlabel("depth / mm")
    ax.set_ylabel("force / N")
    parts.legend(ax, above=False)


def _fig_4(data: Data) -> Picture:
    run = data.runs[0]

    def draw(figure: Figure) -> None:
        depth, force = parts.panels(figure, [150.0, 190.0], top=12.0)
        parts.line(depth, run.time_s, run.depth_mm, "commanded")
        depth.set_ylabel("depth / mm")
        parts.line(force, run.time_s, run.y * data.force_N, "measured")
        force.set_ylabel("force / N")
        force.set_xlabel("time / s")

    svg = render("fig4", "Depth and force over time", parts.WIDE, parts.stacked([150.0, 190.0], 12.0), draw)
    return Picture("fig4", "Fig. 4: the data", "Polyurethane, draw 0, as the methods have it: a mean over every "
                   f"{1e3 * data.T:g} ms.", svg)  # fmt: skip


def _fig_5(settings: Settings) -> Picture:
    t, x = settings.trajectory.sampled(settings.force_spacing_s)
    begin = settings.trajectory.rest_s
    near = (t >= begin - 0.01) & (t <= begin + 0.04)

    def draw(figure: Figure) -> None:
        whole, ramp = _grid(figure, 1)
        parts.line(whole, t, x, "commanded")
        ramp.plot(1e3 * (t[near] - begin), x[near], ".-", color=light("commanded"))
        for ax, unit, words in ((whole, "s", "(a) ramps and (b) holds"), (ramp, "ms", "phase (a), the first ramp")):
            ax.set_title(words, loc="left")
            ax.set_xlabel(f"time / {unit}")
            ax.set_ylabel("depth / mm")

    svg = render("fig5", "Depth over time", parts.WIDE, 290.0, draw)
    return Picture("fig5", "Fig. 5: the trajectory", "Ramps as fast as a linear motor makes them, and holds. Points: "
                   "the load cell's samples.", svg)  # fmt: skip


def _responses(settings: Settings, data: Data, name: str, title: str, fits: Sequence[Fitted]) -> Picture:
    run = data.runs[0]
    least = best(fits)

    def draw(figure: Figure) -> None:
        for ax, r in zip(_grid(figure, 2), ORDERS, strict=True):
            ax.plot(run.time_s, run.y * data.force_N, color=light("measured"), lw=2.6, alpha=0.55, label="data")
            others = [f for f in fits if f.order == r and not f.failed]
            if len(others) > 1:
                worst = max(others, key=lambda f: f.V)
                ax.plot(*response(data, worst), "--", color=light("residual"), label="worst of the starts")
            said = "no fit"
            if r in least:
                label = "best of the starts" if len(others) > 1 else "model"
                ax.plot(*response(data, least[r]), color=light("simulated"), label=label)
                said = f"V = {least[r].V:.4f} N²"
            ax.set_ylim(-0.1 * data.force_N, 1.35 * data.force_N)
            ax.set_title(f"r = {r}: {said}", loc="left")
            ax.set_xlabel("time / s")
            ax.set_ylabel("force / N")
        parts.legend(figure.axes[0], above=False)

    law = {"power": "(10)", "exponential": "(9)"}[fits[0].law]
    caption = (f"Draw 0, elastic law {law}, r = 1 to 4. V of the noise alone would be {settings.noise_V_N2:.4f} N². "
               "What is far off the data is cut off.")  # fmt: skip
    return Picture(name, title, caption, render(name, title, parts.WIDE, 290.0 * 2, draw))


def _grid(figure: Figure, rows: int) -> list[Axes]:
    """Panels two in a row."""
    axes = figure.subplots(rows, 2, squeeze=False)
    height = figure.get_figheight() * figure.dpi
    figure.subplots_adjust(left=0.065, right=0.985, bottom=46.0 / height, top=1 - 26.0 / height, wspace=0.16,
                           hspace=0.36)  # fmt: skip
    return list(axes.flat)
