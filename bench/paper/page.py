"""The page: what comes out, the figures, the tables beside the paper's, and what it all stands on."""

from __future__ import annotations

import re
from collections.abc import Sequence

from bench.paper.figures import Picture
from bench.paper.findings import Finding
from bench.paper.output import MADE, Line, poles_text
from bench.paper.rates import Rate
from bench.paper.settings import Settings, source
from bench.paper.tables import rows
from bench.report import markup
from bench.report.markup import digits, section

Physical = Sequence[tuple[str, str, str, int, Rate]]

TITLES = {
    "I": "Table I: polyurethane, noniterative, power law (10)",
    "I, with (9)": "The same with the exponential law (9), which is the truth's own",
    "II": "Table II: polyurethane, iterative, exponential law (9)",
    "II, silicone": "Of Fig. 8: silicone, iterative (the paper gives no table)",
    "III": "Table III: polyurethane, fast, γ from the ramp that begins on a recovered pad",
    "III, all ramps": "The same with γ from every rising ramp",
    "iv": "Not in the paper: iterative with an instrumental variable",
    "continuous": "Not in the paper: the continuous method (a and b are its zero-order hold)",
}
TONES = {"comes out": "good", "comes out in part": "fair", "does not come out": "bad", "open: too few draws": "plain"}


def page(
    settings: Settings, draws: int, starts: int, found: Sequence[Finding], physical: Physical,
    pictures: Sequence[Picture], lines: Sequence[Line],
) -> str:  # fmt: skip
    """The whole page as HTML text."""
    body = "<h1>The paper, remade</h1>\n" + _introduction(settings, draws, starts)
    body += section("What comes out", _summary(found), "summary")
    for finding in found:
        body += _finding(finding)
    body += section("Is the filter a relaxation?", _physical(physical), "physical")
    for picture in pictures:
        body += section(picture.title, markup.figure(picture.svg, picture.caption), picture.name)
    body += section("Tables of draw 0 beside the paper's", _tables(lines), "tables")
    stands_on = source().read_text(encoding="utf-8")
    body += section("What it stands on", markup.folded("settings.yaml", f"<pre>{markup.text(stands_on)}</pre>"))
    return markup.page("The paper, remade", body + "<footer>Written by padbench paper.</footer>")


def _introduction(settings: Settings, draws: int, starts: int) -> str:
    pads = ", ".join(
        f"{name} ({len(pad.relaxation.rates)} modes, c₀ = {1 - sum(pad.relaxation.shares):.2f})"
        for name, pad in (("polyurethane", settings.polyurethane), ("silicone", settings.silicone))
    )
    words = (
        "Robotic Interaction Through Compliant Interfaces: Modelling and Identification. Its experiments, again, on "
        f"simulated pads: {pads}. Their truth is known; white noise of {settings.noise_N:g} N lies on the force "
        f"every {1e3 * settings.force_spacing_s:g} ms; T is {1e3 * settings.sample_time_s:g} ms. "
        f"Rates are over {draws} draws of the noise and {starts} starts each, with 95 % intervals. "
        "Other pads, noise and sample times may give other rates: the paper states neither of the last two."
    )
    return f'<p class="sub">{markup.text(words)}</p>\n'


def _summary(found: Sequence[Finding]) -> str:
    claims = [[f.claim, f.where, f.verdict, "; ".join(str(rate) for rate, _ in f.main)] for f in found]
    missing = [f for f in found if f.verdict in ("does not come out", "comes out in part")]
    said = markup.table(["the paper's finding", "method, figure", "here", "share of cases"], claims)
    if missing:
        said += "<p>What does not come out, or not wholly:</p>\n" + markup.bullets(_plainly(f) for f in missing)
    return said


def _plainly(finding: Finding) -> str:
    """What of a finding stands against it, in one sentence."""
    against = "; ".join(f"“{rate.label}”: {rate}" for rate, least in finding.main if rate.low < least)
    return f"“{finding.claim}” {finding.verdict}: {against}, where it would take {_share(finding)}."


def _share(finding: Finding) -> str:
    least = max(least for _, least in finding.main)
    return f"{100 * least:.0f} % or more with 95 % confidence"


def _finding(finding: Finding) -> str:
    cases = [["criterion", rate.label, str(rate)] for rate, _ in finding.main]
    cases += [["beside it", rate.label, str(rate)] for rate in finding.more]
    body = f"<h2>{markup.text(finding.claim)} <small>({markup.text(finding.verdict)})</small></h2>\n"
    body += f"<p>{markup.text(finding.where)}</p>\n{markup.bullets(_minus(line) for line in finding.numbers)}"
    body += markup.table(["", "of the cases", "share (95 % interval)"], cases)
    tone = TONES[finding.verdict]
    return f'<section class="verdict {tone}" id="{finding.name}">\n{body}\n</section>\n'


def _physical(physical: Physical) -> str:
    cells: dict[tuple[str, str, str], dict[int, str]] = {}
    for pad, method, law, r, rate in physical:
        cells.setdefault((method, pad, law), {})[r] = f"{100 * rate.value:.0f} % ({rate.hits}/{rate.of})"
    orders = sorted({r for *_, r, _ in physical})
    shares = [[*key, *(by_order.get(r, "–") for r in orders)] for key, by_order in cells.items()]
    own = [f"Table {row.table.number} at r = {row.order}" for row in rows() if row.relaxation is not None]
    words = (
        "Share of fits whose filter is a reduced relaxation (6): real poles between 0 and 1 with positive shares, and "
        "what is left at the end not below 0. Only then does the model mean a pad. Of the noniterative method every "
        f"start counts. Intervals are in physical.csv. Of the {len(rows())} rows of the paper's tables those are: "
        f"{', '.join(own)}."
    )
    head = ["method", "pad", "law", *(f"r = {r}" for r in orders)]
    return f"<p>{markup.text(words)}</p>\n" + markup.table(head, shares)


def _tables(lines: Sequence[Line]) -> str:
    body = ""
    for table, *_ in MADE:
        cells, styles = [], []
        for line in (line for line in lines if line["table"] == table):
            stable = "stable" if line["stable"] else "unstable"
            cells.append([
                f"{line['r']}, {line['source']}", _numbers(line["a"]), _numbers(line["b"]), _numbers(line["gamma"]),
                digits(line["V_N2"]) if line["V_N2"] is not None else "–", _minus(poles_text(line["poles"])), stable,
                "yes" if line["relaxation"] else f"no: {_minus(line['reason'])}",
            ])  # fmt: skip
            styles.append("off" if line["source"] == "paper" else "")
        head = ["r", "a", "b", "γ₁, γ₂", "V / N²", "poles", "", "relaxation?"]
        body += f"<h3>{markup.text(TITLES[table])}</h3>\n" + markup.table(head, cells, numeric=(4,), styles=styles)
    return body


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(digits(value) for value in values)


def _minus(words: str) -> str:
    """With the sign that the other numbers have."""
    return re.sub(r"(?<![\w.])-(?=\d)", "−", words)
