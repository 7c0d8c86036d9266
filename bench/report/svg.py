"""From a drawing to inline SVG: small, the same bytes every time, in the page's colours, nothing fetched."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from bench.report.style import COLOURS, light

POINTS_PER_INCH = 72
"""One unit of the SVG is one point, and about one CSS pixel on a wide screen."""

_COMMENT = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", re.DOTALL)
_ID = re.compile(r'\s+id="([^"]+)"')
_REFERENCE = re.compile(r'url\(#([^)]+)\)|href="#([^"]+)"')
_PATH = re.compile(r'(?<=\sd=")[^"]*')
_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_ATTRIBUTE = re.compile(r'(\s(?:x|y|width|height)=")(-?\d+\.\d+)(?=")')
_COLOUR = {pair[0].lower(): f"var(--{name})" for name, pair in COLOURS.items()}
_STYLE = re.compile(r'\sstyle="[^"]*"')
_HEX = re.compile("|".join(_COLOUR))


def render(name: str, label: str, width: float, height: float, draw: Callable[[Figure], None]) -> str:
    """Draw a figure of `width` × `height` points and return it as an `<svg>` element for a page.

    `name` (a word) keeps the ids of several figures on one page apart; `label` is what a screen reader says.
    Matplotlib's settings are the defaults plus ours while it draws, and the caller's again afterwards: a user's own
    matplotlibrc does not reach the page. Not safe to call from two threads at once, as those settings are global.
    """
    with _settings():
        figure = Figure(figsize=(width / POINTS_PER_INCH, height / POINTS_PER_INCH), dpi=POINTS_PER_INCH)
        FigureCanvasSVG(figure)
        figure.patch.set_visible(False)
        draw(figure)
        out = io.StringIO()
        # dpi here is that of rasterised parts: three pixels a point stay crisp on a dense screen
        figure.savefig(out, format="svg", metadata={"Date": None}, dpi=3 * POINTS_PER_INCH)
    return _clean(out.getvalue(), name, label, width, height)


@contextmanager
def _settings() -> Iterator[None]:
    with mpl.rc_context():
        mpl.rcdefaults()
        ink, muted, grid = light("ink"), light("muted"), light("grid")
        mpl.rcParams.update(
            {
                "svg.fonttype": "none",  # letters stay letters: small, searchable, in the page's own font
                "svg.hashsalt": "padbench",
                "text.parse_math": False,  # a `$` in a name is a dollar sign
                "font.family": "DejaVu Sans",  # comes with matplotlib, so that the layout is the same everywhere
                "font.size": 11,
                "axes.labelsize": 11,
                "axes.titlesize": 11,
                "legend.fontsize": 10.5,
                "xtick.labelsize": 10.5,
                "ytick.labelsize": 10.5,
                "text.color": ink,
                "axes.labelcolor": muted,
                "axes.edgecolor": muted,
                "axes.linewidth": 0.7,
                "axes.facecolor": "none",
                "axes.spines.top": False,
                "axes.spines.right": False,
                "axes.grid": True,
                "axes.axisbelow": True,
                "axes.formatter.useoffset": False,
                "axes.xmargin": 0.01,
                "grid.color": grid,
                "grid.linewidth": 0.7,
                "xtick.color": muted,
                "ytick.color": muted,
                "legend.frameon": False,
                "legend.borderpad": 0.0,
                "lines.linewidth": 1.2,
                "path.simplify": True,
            }
        )
        yield


def _clean(text: str, name: str, label: str, width: float, height: float) -> str:
    text = _COMMENT.sub("", text[text.index("<svg") :])
    text = text[text.index(">") + 1 :].replace("xlink:href", "href")
    used = {a or b for a, b in _REFERENCE.findall(text)}
    text = _ID.sub(lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
    text = text.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    text = _PATH.sub(lambda m: _short_path(m[0]), text)
    text = _ATTRIBUTE.sub(lambda m: m[1] + _short(m[2], 2), text)
    text = _STYLE.sub(lambda m: _HEX.sub(lambda c: _COLOUR[c[0]], m[0]), text)
    text = re.sub(r">\s+<", "><", text)
    head = f'<svg class="plot" role="img" aria-label="{html.escape(label)}" viewBox="0 0 {width:g} {height:g}">'
    return head + text.strip()


def _short_path(path: str) -> str:
    """The same path with coordinates to a tenth of a pixel (a hundredth in small shapes such as markers)."""
    digits = 1 if len(path) > 600 else 2
    words = " ".join(_NUMBER.sub(lambda m: _short(m[0], digits), path).split())
    # after `M x y` further pairs are lines already; only after a curve would a bare pair mean something else
    return words if "C" in words or "Q" in words else words.replace(" L ", " ")


def _short(number: str, digits: int) -> str:
    text = f"{float(number):.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("", "-0") else text
