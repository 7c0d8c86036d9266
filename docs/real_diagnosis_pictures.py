"""The pictures of real_diagnosis.py: the worked example, and what is left of each set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from docs.real_outcome import Held, Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 1500  # of a curve
BEFORE, AFTER, MEASURED = "tab:blue", "tab:red", "0.6"


def example_pictures(o: Outcome, folder: Path) -> list[str]:
    """Two pictures, learnt and held out; the Markdown that shows them."""
    d = o.diagnosis
    assert d is not None
    figure, axes = _figure(1)
    _row(axes[0], d.time_s, d.position_mm, d.force_N, d.before_N, d.after_N, f"learnt from: {o.name}")
    _save(figure, folder / "real_example_learnt.png")
    figure, axes = _figure(len(o.held))
    for row, h in zip(axes, o.held, strict=True):
        c = h.counted
        _row(
            row,
            h.time_s[c],
            h.position_mm[c],
            h.force_N[c],
            h.by_plain_N[c],
            h.by_extended_N[c],
            f"predicted: {h.name}",
        )
    _save(figure, folder / "real_example_held_out.png")
    return [
        "![the run learnt from](img/real_example_learnt.png)", "",
        "![the runs held out](img/real_example_held_out.png)", "",
        "Grey: measured. Blue: the best plain law. Red: the extended model.", "",
    ]  # fmt: skip


def left_picture(found: dict[str, list[Outcome]], titles: dict[str, str], path: Path) -> bool:
    """A panel a set: the residual of its median file over what was held out. False where there is nothing to show."""
    shown: list[tuple[str, Outcome]] = []
    for folder, rows in found.items():
        able = sorted((o for o in rows if o.held), key=lambda o: o.gain)
        if able:
            shown.append((titles[folder], able[len(able) // 2]))
    if not shown:
        return False
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    down = -(-len(shown) // 3)
    figure, axes = plt.subplots(down, 3, figsize=(11, 1.7 * down), squeeze=False)
    for ax in axes.ravel():
        ax.set_visible(False)
    for ax, (title, o) in zip(axes.ravel(), shown, strict=False):
        ax.set_visible(True)
        h = o.held[0]
        keep = _some(h)
        ax.plot(h.time_s[keep], (h.force_N - h.by_plain_N)[keep], color=BEFORE, lw=0.7)
        ax.plot(h.time_s[keep], (h.force_N - h.by_extended_N)[keep], color=AFTER, lw=0.7)
        ax.set_title(f"{title.split(',')[0]}\n{o.name}, {100 * o.gain:+.0f} %", fontsize=7, loc="left", pad=2)
        ax.tick_params(labelsize=6)
    _save(figure, path)
    return True


def _some(h: Held) -> np.ndarray:
    counted = np.flatnonzero(h.counted)
    return np.asarray(counted[np.unique(np.linspace(0, len(counted) - 1, POINTS).astype(int))])


def _figure(rows: int) -> tuple[Figure, np.ndarray]:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(rows, 3, figsize=(11, 2.3 * rows), squeeze=False)
    for ax in axes.ravel():
        ax.tick_params(labelsize=6)
    return figure, axes


def _row(
    axes: np.ndarray, time: np.ndarray, depth: np.ndarray, force: np.ndarray, before: np.ndarray, after: np.ndarray,
    title: str,
) -> None:  # fmt: skip
    """Force in time, residuals in time, force over depth."""
    keep = np.unique(np.linspace(0, len(time) - 1, POINTS).astype(int))
    time, depth, force, before, after = (a[keep] for a in (time, depth, force, before, after))
    _three(axes[0], time, force, before, after)
    axes[1].plot(time, force - before, color=BEFORE, lw=0.7)
    axes[1].plot(time, force - after, color=AFTER, lw=0.7)
    _three(axes[2], depth, force, before, after)
    axes[0].set_ylabel("N", fontsize=7)
    for ax, said in zip(axes, (f"{title}; over time, s", "measured − simulated, N", "over depth, mm"), strict=True):
        ax.set_title(said, fontsize=7, loc="left", pad=2)


def _three(ax: Axes, x: np.ndarray, force: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
    ax.plot(x, force, color=MEASURED, lw=1.8)
    ax.plot(x, before, color=BEFORE, lw=0.7)
    ax.plot(x, after, color=AFTER, lw=0.7)


def _save(figure: Figure, path: Path) -> None:
    import matplotlib.pyplot as plt

    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=75, metadata={"Software": None}, pil_kwargs={"optimize": True})
    plt.close(figure)
