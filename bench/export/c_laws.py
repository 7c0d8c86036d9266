"""The elastic laws as C: the body of a function of `delta_mm` > 0 that returns F^e."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sim.elastic import ElasticLaw, Exponential, NoPad, Polynomial, Power, Spline


def number(value: float) -> str:
    """A constant of the header's own type, to the last digit."""
    return f"({{p}}_real){float(value)!r}"


def array(name: str, values: Sequence[float]) -> str:
    """A constant array."""
    return f"static const {{p}}_real {name}[{len(values)}] = {{{{{', '.join(map(number, values))}}}}};"


def formula(law: ElasticLaw) -> str:
    """The law in one line for a comment, with the paper's equation number where it has one."""
    if isinstance(law, Exponential):
        return "exponential, equation (9): F^e = (m/b)(e^(b delta) - 1)"
    if isinstance(law, Power):
        return "power, equation (10): F^e = p/(q+1) delta^(q+1)"
    if isinstance(law, Polynomial):
        return "polynomial, equation (14): F^e = sum of alpha_i delta^i"
    if isinstance(law, Spline):
        return "monotone cubic through points; a line beyond the last"
    return "none: no force at any depth"


def body(law: ElasticLaw) -> list[str]:
    """Lines of C, with `{p}` and `{P}` for the prefix. Raises NotImplementedError for a law without one."""
    for kind, writer in _WRITERS.items():
        if isinstance(law, kind):
            return writer(law)
    raise NotImplementedError(f"the law {law.name!r} has no C form")


def _exponential(law: Exponential) -> list[str]:
    linear = f"return {number(law.m)} * delta_mm;"
    if law.b == 0.0:
        return [linear]
    return [
        f"const {{p}}_real x = {number(law.b)} * delta_mm;",
        f"if (x == 0) {linear}",
        f"return {number(law.m)} * delta_mm * ({{P}}_MATH(expm1)(x) / x);",
    ]


def _power(law: Power) -> list[str]:
    exponent = law.q + 1.0
    if exponent == 1.0:
        return [f"return {number(law.p)} * delta_mm;"]
    return [f"return {number(law.p / exponent)} * {{P}}_MATH(pow)(delta_mm, {number(exponent)});"]


def _polynomial(law: Polynomial) -> list[str]:
    lines = [f"{{p}}_real force_N = {number(law.alpha[-1])};"]
    lines += [f"force_N = force_N * delta_mm + {number(alpha)};" for alpha in reversed(law.alpha[:-1])]
    return [*lines, "return force_N;"]


def _spline(law: Spline) -> list[str]:
    parameters = law.kernel_parameters
    n = int(parameters[0])
    knots, forces, slopes = (parameters[1 + k * n : 1 + (k + 1) * n] for k in range(3))
    return [
        array("knot_mm", knots),
        array("force_N", forces),
        array("slope", slopes),
        f"int low = 0, high = {n - 1};",
        "{p}_real h, t, u;",
        f"if (delta_mm >= knot_mm[{n - 1}]) {{{{",
        f"    return force_N[{n - 1}] + slope[{n - 1}] * (delta_mm - knot_mm[{n - 1}]);",
        "}}",
        "while (high - low > 1) {{",
        "    const int middle = (low + high) / 2;",
        "    if (knot_mm[middle] <= delta_mm) {{",
        "        low = middle;",
        "    }} else {{",
        "        high = middle;",
        "    }}",
        "}}",
        "h = knot_mm[low + 1] - knot_mm[low];",
        "t = (delta_mm - knot_mm[low]) / h;",
        "u = 1 - t;",
        "return u * u * ((1 + 2 * t) * force_N[low] + h * t * slope[low])",
        "       + t * t * ((3 - 2 * t) * force_N[low + 1] - h * u * slope[low + 1]);",
    ]


def _nothing(law: NoPad) -> list[str]:
    return ["(void)delta_mm;", "return 0;"]


_WRITERS: dict[type[ElasticLaw], Callable[..., list[str]]] = {
    Exponential: _exponential,
    Power: _power,
    Polynomial: _polynomial,
    Spline: _spline,
    NoPad: _nothing,
}
