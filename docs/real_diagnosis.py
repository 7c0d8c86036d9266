"""Make docs/real_diagnosis.md: what a diagnosis finds in every force-displacement file of a directory of measured data.

    python -m docs.real_diagnosis DATA_DIR [--out DIR] [--only FOLDER] [--jobs N] [--keep DIR]

Writes DIR/real_diagnosis.md and DIR/img/real_*.png (DIR: docs). The files are read from DATA_DIR and never copied;
with --keep results are kept in a folder, and those found there are taken (delete it when the diagnosis has changed).
What people wrote of the results stands in real_diagnosis_text/*.md and is taken in as it is.
"""

from __future__ import annotations

import argparse
import pickle
import statistics
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from bench.diagnose.result import CauseFound, Diagnosis
from bench.diagnose.words import name_of, percent
from docs.data_sets import SETS
from docs.real_cases import cases
from docs.real_diagnosis_pictures import example_pictures, left_picture
from docs.real_outcome import Outcome, outcome

TEXT = Path(__file__).parent / "real_diagnosis_text"

EXTRA = {
    "cascaded_tanks": "Two water tanks (no force, no displacement)",
    "relaxation_modulus_pyrheo": "Relaxation moduli against time (no displacement)",
}
"""Folders that data_sets.py leaves out: what a diagnosis says to them."""

FOLDERS = {s.folder: s.title for s in SETS} | EXTRA
NO_PAD = ("emps_linear_axis", "pneumatic_cylinder_friction", *EXTRA)
PAD_EFFECTS = ("adhesion", "elastic_law", "stress_softening", "damage", "permanent_set", "missing_relaxation_mode",
               "depth_dependent_relaxation", "viscous_damping", "separation")  # fmt: skip
"""Names that say something of a pad; the others are of the bench."""

EXAMPLE = ("pneumatic_cylinder_friction", "Kidney_2bar.csv")
"""The worked example."""


def outcomes(directory: Path, folders: list[str], jobs: int, keep: Path | None) -> dict[str, list[Outcome]]:
    """Every file of the folders, by folder."""
    names = [
        (str(directory), folder, name, str(keep or "")) for folder in folders for name, _ in cases(directory, folder)
    ]
    with ProcessPoolExecutor(jobs) as pool:
        done = list(pool.map(_one, names))
    return {folder: [o for o in done if o.folder == folder] for folder in folders}


def _one(job: tuple[str, str, str, str]) -> Outcome:
    directory, folder, name, keep = job
    kept = Path(keep) / f"{folder}__{name}.pkl"
    if keep and kept.exists():
        found: Outcome = pickle.loads(kept.read_bytes())
        return found
    result = outcome(folder, name, dict(cases(Path(directory), folder))[name])
    said = result.diagnosis.verdict if result.diagnosis else "refused"
    print(f"{folder}/{name}: {said}", file=sys.stderr, flush=True)
    if keep:
        Path(keep).mkdir(parents=True, exist_ok=True)
        kept.write_bytes(pickle.dumps(result))
    return result


def overview(found: dict[str, list[Outcome]]) -> list[str]:
    """One row a set."""
    out = ["| set | files | consistent | explained | unexplained | refused | held-out gain, median (least … most) |",
           "|---|--:|--:|--:|--:|--:|---|"]  # fmt: skip
    for folder, rows in found.items():
        verdicts = [o.diagnosis.verdict if o.diagnosis else "refused" for o in rows]
        counts = " | ".join(str(verdicts.count(v)) for v in ("consistent", "explained", "unexplained", "refused"))
        gains = [100 * o.gain for o in rows if o.held]
        told = f"{statistics.median(gains):+.0f} % ({min(gains):+.0f} … {max(gains):+.0f} %)" if gains else "–"
        out.append(f"| {FOLDERS[folder]} | {len(rows)} | {counts} | {told} |")
    return out


def table(rows: list[Outcome], scale: float, unit: str) -> list[str]:
    """One row a file; refusals below."""
    out = [f"| file | plain law, order | verdict | causes: gain, how sure | left | noise ({unit})"
           f" | held out: plain → extended ({unit}) | gain |", "|---|---|---|---|--:|--:|---|--:|"]  # fmt: skip
    for o in rows:
        if o.fit is None or o.diagnosis is None:
            continue
        d = o.diagnosis
        law = f"{o.fit.law}{f' {o.fit.degree}' if o.fit.degree else ''}, {o.fit.order}"
        held = "; ".join(
            f"{h.name.removesuffix('.csv')}: {h.plain_N * scale:.3g} → {h.extended_N * scale:.3g}" for h in o.held
        )
        out.append(
            f"| `{o.name}` | {law} | {d.verdict} | {'; '.join(_cause(c) for c in d.causes) or '–'} | {_left(d)}"
            f" | {d.noise_floor * scale:.3g} | {held} | {100 * o.gain:+.0f} % |"
        )
    told = [f"- `{o.name}` refused: {o.refusal}" for o in rows if o.refusal]
    return [*(out if len(out) > 2 else []), *([""] if told else []), *told]


def _left(d: Diagnosis) -> str:
    return percent(d.left) if d.causes else "100 %"


def _cause(c: CauseFound) -> str:
    """Name, gain and confidence, and the contract's number."""
    open_ = [name_of(a.id) for a in c.alternatives if not a.excluded]
    first = next(iter(c.parameters.items()), None)
    number = f", {first[0]} {first[1].value:.3g} {first[1].unit}" if first else ""
    doubt = f"; or {', '.join(open_[:2])}" if open_ else ""
    return f"**{name_of(c.id)}** ({c.form}{number}): {percent(c.gain)}, {100 * c.confidence:.0f} %{doubt}"


def remainders(rows: list[Outcome]) -> list[str]:
    """What the residual looks like after the diagnosis, by pattern: the files, with its share."""
    groups: dict[str, list[str]] = {}
    for o in rows:
        if o.diagnosis is None:
            continue
        told = [r for r in o.diagnosis.remainders if r.passed and r.name != "memory"][:2]
        for r in told:
            groups.setdefault(f"What is left {r.sentence}", []).append(f"`{o.name}` ({percent(r.share)})")
        if not told and any(r.passed for r in o.diagnosis.remainders):
            groups.setdefault("What is left is smooth and follows no group of samples", []).append(f"`{o.name}`")
        elif not told:
            groups.setdefault("Nothing left that stands out of the noise", []).append(f"`{o.name}`")
    return [f"- {what}: {', '.join(files)}." for what, files in groups.items()]


def misnamed(found: dict[str, list[Outcome]], sure: float = 0.8) -> list[str]:
    """Where data without a pad were given a pad's effect with confidence."""
    return [
        f"`{o.name}`: {name_of(c.id)}, {100 * c.confidence:.0f} %"
        for folder in NO_PAD
        for o in found.get(folder, [])
        if o.diagnosis is not None and o.diagnosis.verdict == "explained"
        for c in o.diagnosis.causes
        if c.id in PAD_EFFECTS and c.confidence >= sure
    ]


def text(name: str) -> list[str]:
    """A part that people wrote; nothing where it is not there."""
    path = TEXT / f"{name}.md"
    return [path.read_text(encoding="utf-8").rstrip(), ""] if path.exists() else []


def write(found: dict[str, list[Outcome]], out: Path) -> None:
    """The page and its pictures."""
    (out / "img").mkdir(parents=True, exist_ok=True)
    lines = [*text("head"), "## Overview", "", *overview(found), ""]
    wrong = misnamed(found)
    lines += [
        "Names that belong to a pad, given with 80 % or more to data without one: "
        + ("; ".join(wrong) or "none")
        + ".",
        "",
    ]
    example = next((o for o in found.get(EXAMPLE[0], []) if o.name == EXAMPLE[1]), None)
    if example is not None and example.diagnosis is not None:
        lines += ["## Worked example", "", *example_pictures(example, out / "img"), *text("example")]
    if left_picture(found, FOLDERS, out / "img" / "real_left.png"):
        lines += ["![what is left, before and after](img/real_left.png)", ""]
    units = {s.folder: (s.scale, s.unit) for s in SETS}
    for folder, rows in found.items():
        scale, unit = units.get(folder, (1.0, "V" if folder == "cascaded_tanks" else "N"))
        lines += [f"## {FOLDERS[folder]}", "", f"`{folder}`, {len(rows)} files.", "", *table(rows, scale, unit), ""]
        lines += [*remainders(rows), ""]
    lines += [*text("verdicts"), *text("authors")]
    (out / "real_diagnosis.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m docs.real_diagnosis", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("directory", type=Path, metavar="DATA_DIR")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--only", help="one folder of DATA_DIR")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    folders = [f for f in FOLDERS if options.only in (None, f)]
    write(outcomes(options.directory, folders, options.jobs, options.keep), options.out)


if __name__ == "__main__":
    main()
