"""Make docs/real_data.md: the default fit of every force-displacement file in a directory of measured data.

    python -m docs.real_data DATA_DIR [--out DIR] [--only FOLDER]

Writes DIR/real_data.md and DIR/img/measured_*.png (DIR: docs). The files are read from DATA_DIR and never copied.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.errors import PadbenchError
from bench.identify import FitResult, fit
from bench.identify.remainder import gist, is_foreign
from docs.data_sets import LEFT_OUT, SETS, DataSet

COLUMNS = 3  # panels of a picture's row: force in time, residual in time, force over depth
POINTS = 1500  # of a curve in a picture


@dataclass(frozen=True)
class Row:
    """One file: its fit, or why there is none."""

    name: str
    result: FitResult | None
    refusal: str = ""


def rows_of(directory: Path, data: DataSet) -> list[Row]:
    """Fit every CSV file of a set."""
    rows = []
    for path in sorted((directory / data.folder).glob("*.csv")):
        print(f"{data.folder}/{path.name} …", end=" ", file=sys.stderr, flush=True)
        try:
            result = fit(data.read(path))
            rows.append(Row(path.name, result))
            print(f"{result.law} r={result.order}, {result.seconds:.1f} s", file=sys.stderr)
        except PadbenchError as error:
            rows.append(Row(path.name, None, str(error).replace(str(path), path.name)))
            print("no fit", file=sys.stderr)
    return rows


def table(data: DataSet, rows: list[Row]) -> list[str]:
    """The Markdown table of a set, and below it what is left of each file."""
    out = [
        f"| file | law, order | contact | error ({data.unit}) | noise of its holds | error / noise | fit % |"
        " held-out error | not told |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        f = row.result
        if f is None:
            out.append(f"| `{row.name}` | no fit | | | | | | | |")
            continue
        law = f"{f.law}{f' {f.degree}' if f.degree else ''}, {f.order}"
        mark = "" if f.noise and f.noise.from_holds else " *"
        out.append(
            f"| `{row.name}` | {law} | {f.contact} | {f.rmse * data.scale:.3g} | {f.noise_floor * data.scale:.3g}{mark}"
            f" | {f.rmse / f.noise_floor:.1f} | {f.fit_percent:.1f} | {f.held_out_rmse * data.scale:.3g}"
            f" | {', '.join(f.undetermined) or '–'} |"
        )
    if any(row.result and row.result.noise and not row.result.noise.from_holds for row in rows):
        out += ["", "\\* no hold in the file: noise from local parabolas through the motion."]
    out += ["", "What is plainly not explained (share of the error's power beyond the noise):", ""]
    return out + left_of(rows)


def left_of(rows: list[Row]) -> list[str]:
    """One line a pattern, with the files that show it."""
    groups: dict[str, list[str]] = {}
    for row in rows:
        for what in _said(row, most=1 if len(rows) > 10 else 2):
            told, _, share = what.partition("|")
            groups.setdefault(told, []).append(f"`{row.name}`" + (f" ({share} %)" if share else ""))
    return [f"- {what}: {', '.join(files)}." for what, files in groups.items()]


def _said(row: Row, most: int) -> list[str]:
    """What there is to say of a file, without its numbers; the share of the error after a bar."""
    f = row.result
    if f is None:
        return [f"No fit, {row.refusal}"]
    out = []
    for line in gist(f, most).split("; "):
        share, _, what = line.partition(" % ")
        if not line:
            out.append("Nothing: the error is that of the noise")
        elif not share.isdigit():
            out.append("No simple pattern of motion, depth or time")
        elif is_foreign(f):
            out.append(f"The model does not describe the data; their force {what}|{share}")
        else:
            out.append("The error " + re.sub(r" \(\d+ % of the samples\)", "", what) + f"|{share}")
    if not is_foreign(f):
        starts = ("The force", "The data begin", "The slowest", "In air")
        out += [NUMBER.sub("…", note).rstrip(".") for note in f.notes if note.startswith(starts)]
    return out


NUMBER = re.compile(r"(?<![\d.])[-+]?(?!0 mm)\d[\d.]*(e[-+]?\d+)?")


def picture(data: DataSet, rows: list[Row], path: Path) -> None:
    """One row a file: force and simulation in time, residual in time, both over depth."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fitted = [row for row in rows if row.result]
    many = len(fitted) > 10
    across = 4 if many else COLUMNS
    down = -(-len(fitted) // across) if many else len(fitted)
    figure, axes = plt.subplots(down, across, figsize=(11, (1.35 if many else 1.6) * down + 0.4), squeeze=False)
    for ax in axes.ravel():
        ax.tick_params(labelsize=6)
        ax.set_visible(not many)
    for i, row in enumerate(fitted):
        assert row.result is not None
        t = row.result.traces[0]
        keep = (
            np.unique(np.linspace(0, len(t.time_s) - 1, POINTS).astype(int)) if len(t.time_s) > POINTS else slice(None)
        )
        time, depth = t.time_s[keep], t.position_mm[keep]
        force, model = t.force_N[keep] * data.scale, t.simulated_N[keep] * data.scale
        panels = [axes[i // across][i % across]] if many else list(axes[i])
        for ax in panels:
            ax.set_visible(True)
        panels[0].plot(time, force, color="0.6", lw=1.6)
        panels[0].plot(time, model, color="tab:red", lw=0.7)
        panels[0].set_title(row.name, fontsize=7, loc="left", pad=2)
        if not many:
            panels[0].set_ylabel(data.unit, fontsize=7)
            panels[1].plot(time, force - model, color="tab:blue", lw=0.6)
            panels[1].set_title("measured − simulated", fontsize=7, loc="left", pad=2)
            panels[2].plot(depth, force, color="0.6", lw=1.6)
            panels[2].plot(depth, model, color="tab:red", lw=0.7)
            panels[2].set_title("over depth, mm", fontsize=7, loc="left", pad=2)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=75, metadata={"Software": None}, pil_kwargs={"optimize": True})
    plt.close(figure)


HEAD = """# Measured data

The default fit (`padbench fit FILE`: law, order and contact chosen from the data) of every force-displacement file of
the project's collection of measured data. Made by

    python -m docs.real_data DATA_DIR

which reads the files where they are; they belong to others and are not part of padbench. Where each came from stands in
the `PROVENANCE.md` beside it.

How to read the tables: *error* is the RMS of the simulated force against the measured one, over the whole file, from
measured motion alone. *Noise of its holds* is what such an error would be with nothing left to explain: the scatter
about smooth curves through the holds, with the position's noise carried through the stiffness. *Held-out error* is the
same RMS for time blocks that the fit did not see. *Not told*: what the fit calls `undetermined` ([fit.md](fit.md)): a
standard error above 0.6 of the value, or above the value at another place that explains the data as well, or the edge
of what the data can show. In the pictures measured is grey, simulated red.

The model is one elastic response and one linear relaxation, from rest (or, where a file begins with a force on the pad,
from a state that is fitted). On measured pads its error is a few times the
noise, seldom one: what is left is said below each table, from simple regressions of the residual on motion, depth and
time. That is a description, not a diagnosis.
"""


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m docs.real_data", description=__doc__.split("\n")[0])
    parser.add_argument("directory", type=Path, metavar="DATA_DIR")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--only", help="one folder of DATA_DIR")
    options = parser.parse_args()
    write(options.directory, options.out, [s for s in SETS if options.only in (None, s.folder)])


def write(directory: Path, out: Path, sets: list[DataSet]) -> None:
    """The page and its pictures."""
    (out / "img").mkdir(parents=True, exist_ok=True)
    lines = [HEAD]
    for number, data in enumerate(sets, 1):
        rows = rows_of(directory, data)
        if not rows:
            lines += [f"## {data.title}", "", f"No files in `{data.folder}`.", ""]
            continue
        lines += [f"## {data.title}", "", f"`{data.folder}`, {len(rows)} files. {data.reading}", ""]
        if any(row.result for row in rows):
            name = f"measured_{number}.png"
            picture(data, rows, out / "img" / name)
            lines += [f"![measured and simulated force](img/{name})", ""]
        lines += [*table(data, rows), ""]
    lines += ["## Left out", ""]
    lines += [f"- `{folder}`: {reason}." for folder, reason in LEFT_OUT.items()]
    (out / "real_data.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
