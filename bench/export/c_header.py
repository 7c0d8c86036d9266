"""The pad as one C99 header (C++ takes it too): no allocation, no dependency but math.h."""

from __future__ import annotations

import math
import re
import textwrap

from bench.errors import InputError
from bench.export.c_laws import array, body, formula, number
from bench.export.realtime import DEFAULT_RATE_HZ, RealTimePad, checked_rate, digest, real_time_pad, version
from sim.kernel import ramp_gain
from sim.model import Model

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}", re.ASCII)

_KEYWORDS = frozenset(
    [
        "alignas",
        "alignof",
        "and",
        "asm",
        "auto",
        "bitand",
        "bitor",
        "bool",
        "break",
        "case",
        "catch",
        "char",
        "class",
        "compl",
        "concept",
        "const",
        "consteval",
        "constexpr",
        "constinit",
        "continue",
        "decltype",
        "default",
        "delete",
        "do",
        "double",
        "dynamic_cast",
        "else",
        "enum",
        "explicit",
        "export",
        "extern",
        "false",
        "float",
        "for",
        "friend",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "mutable",
        "namespace",
        "new",
        "noexcept",
        "not",
        "nullptr",
        "operator",
        "or",
        "private",
        "protected",
        "public",
        "register",
        "reinterpret_cast",
        "requires",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "static_assert",
        "static_cast",
        "struct",
        "switch",
        "template",
        "this",
        "thread_local",
        "throw",
        "true",
        "try",
        "typedef",
        "typeid",
        "typename",
        "typeof",
        "union",
        "unsigned",
        "using",
        "virtual",
        "void",
        "volatile",
        "wchar_t",
        "while",
        "xor",
    ]
)
"""Of C23 and C++20; what begins with an underscore is no name here anyway."""


def c_header(
    model: Model,
    rate_hz: float = DEFAULT_RATE_HZ,
    *,
    name: str = "pad",
    source: str = "",
    pad_only: bool = False,
) -> str:
    """The header's text for a loop of `rate_hz`; `name` is the prefix of all it defines.

    Raises `Refused` for effects that have no form here (unless `pad_only`), `InputError` for a rate that is none or
    a name that is no C identifier.
    """
    T = 1.0 / checked_rate(rate_hz)
    if not _NAME.fullmatch(name):
        raise InputError("--name", f"`{name}` is no C identifier", "letters, digits and _, a letter first")
    if name in _KEYWORDS:
        raise InputError("--name", f"`{name}` is a word of the language C or C++", "give a name of your own")
    pad = real_time_pad(model, pad_only=pad_only)
    modes = pad.relaxation.order
    c_0 = _filled(number(pad.relaxation.c_0), name)
    places = {
        "p": name,
        "P": name.upper(),
        "slots": max(modes, 1),
        "modes": modes,
        "T": repr(T),
        "law": _indented(body(pad.law), name),
        "shares": _filled(array("share", pad.relaxation.shares or (0.0,)), name),
        "rates": _filled(array("rate", pad.relaxation.rates or (0.0,)), name),
        "lost": _filled(array("lost", [-math.expm1(-nu * T) for nu in pad.relaxation.rates] or (0.0,)), name),
        "gain": _filled(array("gain", [ramp_gain.python(nu * T) for nu in pad.relaxation.rates] or (0.0,)), name),
        "c_0": c_0,
        "let_go": _LET_GO.format(p=name, P=name.upper(), c_0=c_0) if pad.unilateral else "",
    }
    return _comment(model, pad, rate_hz, name, source) + _CODE.format(**places)


def _filled(text: str, name: str) -> str:
    return text.format(p=name, P=name.upper())


def _indented(lines: list[str], name: str) -> str:
    return "\n".join("        " + _filled(line, name) for line in lines)


def _comment(model: Model, pad: RealTimePad, rate_hz: float, name: str, source: str) -> str:
    """What the header is, where it comes from, and what its numbers are."""
    std, believed = model.pad.std or {}, model.pad.parameters
    lines = [
        f"{name}.h: force of a soft pad against the depth a probe is pressed into it, for a loop of {rate_hz:g} Hz.",
        "",
        f"    static {name}_state state;                             // zeroed, or {name}_reset(&state): never touched",
        f"    force_N = {name}_step(&state, depth_mm);               // every {1.0 / rate_hz:g} s",
        f"    force_N = {name}_step_dt(&state, depth_mm, elapsed_s); // or with the time since the last step",
        "",
        "Depth in mm, 0 at the surface, growing into the pad; force in N, positive in compression. The elastic force",
        "is taken as linear between steps, and the filter is exact for that at any rate. The first step after a reset",
        "takes no time. A depth that is not a number, or makes the elastic force overflow, counts as the last one.",
        f"Numbers are float, or double where {name.upper()}_DOUBLE is defined before the header is read.",
        "",
        f"Model:    {_safe(source) or 'not from a file'}, sha256 of its content {digest(model)}",
        *([f"Name:     {_safe(model.name)}"] if model.name else []),
        f"Made by:  padbench {version()}, padbench export --to c --rate {rate_hz:g}",
        f"Elastic:  {formula(pad.law)}",
        f"Contact:  {_CONTACT[pad.contact]}",
        f"Relaxation (6): c_0 = {pad.relaxation.c_0:.9g}",
    ]
    for parameter, (value, unit) in pad.parameters.items():
        known = parameter in std and believed.get(parameter) == value
        doubt = f" +- {std[parameter]:.2g}" if known else ""
        lines.append(f"    {parameter} = {value:.9g}{doubt}{'' if unit == '1' else ' ' + unit}")
    if pad.left_out:
        lines.append(f"Left out: {', '.join(pad.left_out)}")
    wrapped = [part for line in lines for part in (textwrap.wrap(line, 110, subsequent_indent="          ") or [""])]
    return "/*\n" + "".join(f" * {line}".rstrip() + "\n" for line in wrapped) + " */\n"


def _safe(text: str | None) -> str:
    """Text that stands in a comment: one line of plain characters that cannot end it."""
    words = " ".join((text or "").split()).encode("ascii", "replace").decode()
    words = "".join(character if character.isprintable() else "?" for character in words)
    return words.replace("\\", "/").replace("?", ".").replace("*/", "* /").replace("/*", "/ *")


_CONTACT = {
    "unilateral": "unilateral: the pad lets go where it would pull, and its surface recovers by relaxation",
    "bonded": "bonded: the pad may pull, F may be negative",
}

_CODE = """\
#ifndef {P}_H_INCLUDED
#define {P}_H_INCLUDED

#include <math.h>

#ifdef {P}_DOUBLE
typedef double {p}_real;
#define {P}_MATH(function) function
#else
typedef float {p}_real;
#define {P}_MATH(function) function##f
#ifdef __FAST_MATH__
#error "-ffast-math undoes the compensated sums that slow modes need in float: leave it out, or define {P}_DOUBLE"
#endif
#endif

#define {P}_MODES {modes}
#define {P}_SAMPLE_TIME_S {T}

typedef struct {p}_state {{
    {p}_real elastic_N;       /* F^e of the last step; where the pad has let go, the one that gives no force */
    {p}_real mode_N[{slots}];       /* outputs of the modes */
    {p}_real rounding_N[{slots}];   /* what adding to them lost: slow modes change by less than a float's last digit */
    int started;
}} {p}_state;

/* Back to rest, never touched. */
static inline void {p}_reset({p}_state *state)
{{
    int i;
    state->elastic_N = 0;
    for (i = 0; i < {slots}; ++i) {{
        state->mode_N[i] = 0;
        state->rounding_N[i] = 0;
    }}
    state->started = 0;
}}

/* Elastic response F^e in N. */
static inline {p}_real {p}_elastic_N({p}_real delta_mm)
{{
    if (delta_mm <= 0) return 0;
    {{
{law}
    }}
}}

/* One step of the relaxation: a mode loses the share lost[i] of itself, and gains gain[i] of what F^e changes by. */
static inline {p}_real {p}_relax({p}_state *state, {p}_real elastic_N, const {p}_real *lost, const {p}_real *gain)
{{
    {shares}
    {p}_real change[{slots}] = {{0}};
    {p}_real rise, force_N;
    int i;
    if (!(elastic_N - elastic_N == 0)) elastic_N = state->elastic_N; /* not a finite number */
    rise = elastic_N - state->elastic_N;
    force_N = {c_0} * elastic_N;
    for (i = 0; i < {P}_MODES; ++i) {{
        change[i] = gain[i] * rise - lost[i] * state->mode_N[i];
        force_N += share[i] * (state->mode_N[i] + change[i]);
    }}
{let_go}\
    state->elastic_N = elastic_N;
    for (i = 0; i < {P}_MODES; ++i) {{
        const {p}_real term = change[i] - state->rounding_N[i];
        const {p}_real sum = state->mode_N[i] + term;
        state->rounding_N[i] = (sum - state->mode_N[i]) - term;
        state->mode_N[i] = sum;
        if (sum < ({p}_real)1e-25 && sum > ({p}_real)-1e-25) {{ /* denormal numbers are slow */
            state->mode_N[i] = 0;
            state->rounding_N[i] = 0;
        }}
    }}
    return force_N;
}}

/* Force in N at depth delta_mm, dt_s after the last step. No time passes for a dt_s that is not above 0. */
static inline {p}_real {p}_step_dt({p}_state *state, {p}_real delta_mm, {p}_real dt_s)
{{
    {rates}
    {p}_real lost[{slots}] = {{0}}, gain[{slots}] = {{0}};
    int i;
    for (i = 0; i < {P}_MODES; ++i) {{
        const {p}_real x = state->started && dt_s > 0 ? rate[i] * dt_s : 0;
        lost[i] = -{P}_MATH(expm1)(-x);
        gain[i] = x > 0 ? lost[i] / x : 1;
    }}
    state->started = 1;
    return {p}_relax(state, {p}_elastic_N(delta_mm), lost, gain);
}}

/* Force in N at depth delta_mm, {P}_SAMPLE_TIME_S after the last step. */
static inline {p}_real {p}_step({p}_state *state, {p}_real delta_mm)
{{
    {lost}
    {gain}
    if (!state->started) return {p}_step_dt(state, delta_mm, 0);
    return {p}_relax(state, {p}_elastic_N(delta_mm), lost, gain);
}}

#endif
"""

_LET_GO = """\
    if (force_N < 0) {{ /* the pad lets go: its surface is where it carries no force */
        {p}_real stiffness = {c_0}, back;
        for (i = 0; i < {P}_MODES; ++i) stiffness += share[i] * gain[i];
        back = stiffness > 0 ? force_N / stiffness : elastic_N;
        elastic_N -= back;
        for (i = 0; i < {P}_MODES; ++i) change[i] -= gain[i] * back;
        force_N = 0;
    }}
"""
