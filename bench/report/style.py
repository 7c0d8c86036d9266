"""Colours and style sheet of every page: one table of colours for light, dark and print, used by text and plots alike.

Plots are drawn in the light colours; `svg.render` then puts the page's CSS variables in their place, so that a plot
follows the reader's choice of light or dark. Hues are Okabe and Ito's (distinguishable to the colour-blind), and no
line is told from another by hue alone where both are dense: styles differ too.
"""

from __future__ import annotations

COLOURS: dict[str, tuple[str, str]] = {
    # name: (light, dark); every light value occurs once, because it is the key of the replacement in svg.py
    "ink": ("#1c2128", "#e6e9ed"),
    "muted": ("#566069", "#a3adb8"),
    "grid": ("#dde2e7", "#353c44"),
    "paper": ("#fefefe", "#15191e"),
    "measured": ("#39424c", "#c5ced8"),
    "simulated": ("#d55e00", "#ff9b52"),
    "commanded": ("#0072b2", "#5cb6f2"),
    "expected": ("#8f6b00", "#e3c35b"),
    "residual": ("#7a4a9e", "#cfa6f0"),
    "noise": ("#009e73", "#35c79b"),
    "event": ("#b3261e", "#ff8f85"),
    "tare": ("#7c8894", "#8c98a4"),
    "approach": ("#56b4e9", "#56b4ea"),
    "precondition": ("#e69f00", "#e6a000"),
    "steps": ("#c8ced5", "#5a646e"),
    "finish": ("#12a87d", "#12a87e"),
}

TIME_RAMP: list[tuple[str, str]] = [
    # early to late, for force against indentation: viridis, cut where it would vanish into the page
    ("#440154", "#6a3d9a"),
    ("#46327e", "#6f5bb8"),
    ("#365c8d", "#5a86c5"),
    ("#277f8e", "#3fa3b5"),
    ("#1fa187", "#2fbf9f"),
    ("#4ac16d", "#6fd58a"),
    ("#8fc03a", "#b5dd52"),
    ("#c9b612", "#f5e53a"),
]
RUNS: list[tuple[str, str]] = [
    # several runs in one plot
    ("#0173b3", "#5cb7f3"),
    ("#d65f01", "#ff9c53"),
    ("#019f74", "#36c89c"),
    ("#c4699c", "#eb9fcb"),
    ("#906c01", "#e4c45c"),
    ("#4d9bd1", "#9ad2f7"),
    ("#57616a", "#a4aeb9"),
]
COLOURS |= {f"time-{i}": pair for i, pair in enumerate(TIME_RAMP)}
COLOURS |= {f"run-{i}": pair for i, pair in enumerate(RUNS)}


def light(name: str) -> str:
    """The colour to draw with, `#rrggbb`; raises KeyError for a name that is not in the table."""
    return COLOURS[name][0]


def _variables(which: int) -> str:
    return "".join(f"--{name}:{pair[which]};" for name, pair in COLOURS.items())


_PAGE_LIGHT = "--page:#f4f5f7;--card:#fefefe;--good:#0b6e4f;--fair:#8a5a00;--bad:#b3261e;--edge:#d5dae0;"
_PAGE_DARK = "--page:#0e1115;--card:#15191e;--good:#4fd1a1;--fair:#f0b849;--bad:#ff8f85;--edge:#2d343c;"

_RULES = """
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;background:var(--page)}
body{margin:0;color:var(--ink);background:var(--page);
 font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
main{max-width:1000px;margin:0 auto;padding:1.2rem 1rem 4rem}
h1{font-size:1.65rem;line-height:1.2;margin:.3rem 0 .2rem;overflow-wrap:anywhere}
h2{font-size:1.15rem;margin:0 0 .6rem}
h3{font-size:.95rem;margin:1.1rem 0 .35rem}
p{margin:.35rem 0 .7rem}
a{color:var(--commanded)}
.sub{color:var(--muted);margin:0 0 1rem;overflow-wrap:anywhere}
h1+section{margin-top:.8rem}
section{background:var(--card);border:1px solid var(--edge);border-radius:10px;padding:1rem 1.1rem;margin:0 0 1rem}
.verdict{border-left:6px solid var(--tone)}
.verdict h2{color:var(--tone);font-size:1.3rem;line-height:1.3;margin-bottom:.3rem}
.good{--tone:var(--good)}.fair{--tone:var(--fair)}.bad{--tone:var(--bad)}.plain{--tone:var(--muted)}
.warn{color:var(--fair)}.fail{color:var(--bad);font-weight:600}.ok{color:var(--good)}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(152px,1fr));gap:.6rem;margin:.9rem 0 .1rem}
.tile{border:1px solid var(--edge);border-radius:8px;padding:.5rem .7rem}
.tile b{display:block;font-size:1.14rem;line-height:1.3;font-variant-numeric:tabular-nums;overflow-wrap:anywhere}
.tile span{color:var(--muted);font-size:.8rem;line-height:1.25;display:block}
nav{font-size:.88rem;margin:0 0 1rem;display:flex;flex-wrap:wrap;gap:.2rem 1rem}
figure{margin:.2rem 0 .4rem}
figcaption{color:var(--muted);font-size:.86rem;margin-top:.3rem;max-width:72ch}
.wide{overflow-x:auto}
svg.plot{display:block;width:100%;height:auto}
.wide svg.plot{min-width:720px}
svg.plot *{stroke-linejoin:round;stroke-linecap:butt}
svg.plot text{font-family:inherit!important;font-variant-numeric:tabular-nums}
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr));gap:1rem}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.92rem;width:100%;font-variant-numeric:tabular-nums}
th,td{text-align:left;padding:.28rem .9rem .28rem 0;border-bottom:1px solid var(--grid);vertical-align:top}
thead th{color:var(--muted);font-weight:600;font-size:.82rem;white-space:nowrap}
tbody th{font-weight:600;white-space:nowrap}
td:last-child:not(.n){min-width:10rem}
td.n,th.n{text-align:right;white-space:nowrap}
.causes td:nth-child(2){white-space:pre}
.causes tbody th{white-space:normal;min-width:6.5rem}
tr.chosen td,tr.chosen th{background:color-mix(in srgb,var(--noise) 14%,transparent)}
tr.off td,tr.off th{color:var(--muted)}
dl{columns:2 340px;column-gap:2rem;margin:0 0 .5rem;font-size:.94rem}
dl div{display:grid;grid-template-columns:8.5rem 1fr;gap:.8rem;padding:.16rem 0;break-inside:avoid}
dt{color:var(--muted)}dd{margin:0;overflow-wrap:anywhere;white-space:pre-line}
pre{overflow-x:auto;font-size:.82rem;line-height:1.4;background:var(--page);border:1px solid var(--edge);
 border-radius:8px;padding:.7rem}
code{font-size:.92em}
summary{cursor:pointer;color:var(--commanded);margin:.3rem 0}
ul{margin:.3rem 0;padding-left:1.2rem}li{margin:.2rem 0;overflow-wrap:anywhere}
footer{color:var(--muted);font-size:.82rem}
@media(max-width:560px){main{padding:.7rem .5rem 2rem}section{padding:.8rem .75rem}
 dl div{grid-template-columns:6.5rem 1fr}h1{font-size:1.35rem}.verdict h2{font-size:1.12rem}}
@media print{html,body{background:#fff}body{font-size:11px}main{max-width:none;padding:0}nav{display:none}
 section{border:none;padding:.2rem 0;break-inside:auto}.verdict{border-left:6px solid var(--tone);padding-left:.8rem}
 figure,table{break-inside:avoid}h2,h3{break-after:avoid}.wide,.scroll{overflow:visible}
 .wide svg.plot{min-width:0}}
"""


def style_sheet() -> str:
    """The CSS of a page: light by default, dark where the reader's system says so, light on paper."""
    bright = f":root{{color-scheme:light dark;{_PAGE_LIGHT}{_variables(0)}}}"
    dark = f"@media screen and (prefers-color-scheme:dark){{:root{{{_PAGE_DARK}{_variables(1)}}}}}"
    return f"{bright}\n{dark}{_RULES}"
