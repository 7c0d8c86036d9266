"""One case for a person to look at."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .count import Line, pattern, wrongs
from .judge import run
from .plan import Item


def shown(lines: Sequence[Line], key: str, again: bool, keep: Path | None) -> int:
    """Print the cases that the key, or a part of it, names; `again` diagnoses them anew."""
    chosen = [line for line in lines if line["key"] == key] or [line for line in lines if key in line["key"]]
    if not chosen:
        print(f"no case {key}", file=sys.stderr)
        return 2
    for line in chosen:
        print(text(run(Item.from_json(line["item"]), keep) if again else line), end="\n\n")
    return 0


def text(line: Line) -> str:
    """Truth, what was said, the ranking."""
    out = [line["key"], f"  wrong: {', '.join(wrongs(line)) or 'nothing'}; code {line['code']}"]
    item = line["item"]
    for id, shape, size in zip(item["ids"], item["shapes"], item["sizes"], strict=True):
        parameters = line.get("truth", {}).get("parameters", {}).get(id, {})
        out.append(f"  hidden: {id}, {shape}, {size:g} times the typical: {_numbers(parameters)}")
    if "truth" in line:
        t = line["truth"]
        out += [
            f"  pad: {t['law']}, {t['modes']} modes, {t['contact']}; protocol: {t['protocol']}",
            f"  sampling: {t['samples']} at {t['rate_hz']:g} Hz{', own clock' if t['own_clock'] else ''}; "
            f"χ² of its coarseness {t['coarse_chi2']:.3g}",
            f"  noise: {t['noise']}, {_mN(t['noise_N'])}, with the position's ({1e3 * t['position_std_mm']:.3g} µm) "
            f"{_mN(t['floor_N'])}",
            f"  seen: χ² {t['chi2']:.4g}, faults {t['faults']:.4g} ({'' if t['detectable'] else 'not '}detectable), "
            f"{100 * t['of_noise_power']:.3g} % of the noise power, misfit {_mN(t['misfit_N'])} {t['alone'] or ''}",
        ]
    if "error" in line:
        return "\n".join([*out, line["error"]])
    said = line["said"]
    out += [
        f"  said: {said['verdict']}, left {said['left']:.4f}; {line['seconds']:.1f} s",
        f"  errors: before {_mN(said['rmse_before'])}, after {_mN(said['rmse_after'])}; held out "
        f"{_mN(said['held_out_before'])} → {_mN(said['held_out_after'])}; floor {_mN(said['noise_floor'])}",
    ]
    for cause in said["causes"]:
        numbers = ", ".join(
            f"{name} {n['value']:.5g} ± {n['std'] if n['std'] is None else format(n['std'], '.2g')} {n['unit']}"
            for name, n in cause["parameters"].items()
        )
        out.append(
            f"    {cause['id']} ({cause['form']}): gain {cause['gain']:.4f}, "
            f"confidence {cause['confidence']:.3f}; {numbers}"
        )
        out += [
            f"      {'strongest rival, excluded' if a.get('excluded') else 'not excluded'}: {a['id']} "
            f"({a['gain_share']:.4f} of the gain, Δχ² {a['delta_chi2']:.4g})"
            for a in cause["alternatives"]
        ]
    if line["ranking"]:
        out.append("  first candidates:")
        out += [
            f"    {a['id']} ({a['form']}): {a['gain_share']:.4f}, Δχ² {a['delta_chi2']:.4g}" for a in line["ranking"]
        ]
    out += [f"  left over: {r['sentence']} ({100 * r['share']:.2g} %)" for r in said.get("remains", [])]
    out += [
        f"  flags of {fault}: {hit} of {n} right, {true} there"
        for fault, (hit, n, true) in line["flags"].items()
        if n or true
    ]
    out += [f"  bound of {name}: {bound:.3g}" for name, bound in line.get("bounds", {}).items()]
    return "\n".join(out)


def _mN(force_N: float | None) -> str:
    return "–" if force_N is None else f"{1e3 * force_N:.4g} mN"


def _numbers(parameters: dict[str, Any]) -> str:
    return (
        ", ".join(f"{k} {v:.5g}" if isinstance(v, float) else f"{k} {v}" for k, v in parameters.items()) or "no numbers"
    )


def failures(lines: Sequence[Line]) -> str:
    """Failing cases by kind of failure, alike ones together."""
    kinds: dict[str, dict[str, list[Line]]] = {}
    for line in lines:
        for kind in wrongs(line):
            kinds.setdefault(kind, {}).setdefault(pattern(line), []).append(line)
    out = []
    for kind, patterns in sorted(kinds.items(), key=lambda pair: -sum(map(len, pair[1].values()))):
        out.append(f"{kind}: {sum(map(len, patterns.values()))}")
        for text, own in sorted(patterns.items(), key=lambda pair: -len(pair[1])):
            out.append(f"  {text}")
            out += [f"    {line['key']}  {_setting(line)}" for line in own]
    return "\n".join(out)


def _setting(line: Line) -> str:
    if "truth" not in line:
        return ""
    t = line["truth"]
    said = ""
    if "said" in line:
        said = f", left {line['said']['left']:.3f}, floor stated {_mN(line['said']['noise_floor'])}"
    return (
        f"χ² {t['chi2'] + t['faults']:.3g} ({100 * t['of_noise_power']:.2g} % of the noise), {t['rate_hz']:g} Hz, "
        f"{t['protocol']}, {t['law']}, {t['noise']} {_mN(t['noise_N'])} ({_mN(t['floor_N'])} with "
        f"the position's), coarse {t['coarse_chi2']:.2g}{', own clock' if t['own_clock'] else ''}{said}"
    )
