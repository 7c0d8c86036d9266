"""Elastic responses F^e(δ): one interface, one file a law."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from sim.elastic.base import ElasticLaw
from sim.elastic.exponential import Exponential
from sim.elastic.none import NoPad
from sim.elastic.polynomial import Polynomial
from sim.elastic.power import Power
from sim.elastic.spline import Spline

LAWS: dict[str, type[ElasticLaw]] = {cls.name: cls for cls in (Exponential, Power, Polynomial, Spline, NoPad)}

__all__ = ["LAWS", "ElasticLaw", "Exponential", "NoPad", "Polynomial", "Power", "Spline", "law"]


def law(name: str, params: Mapping[str, Any]) -> ElasticLaw:
    """The law `name` with the model file's parameters (lists where the file has lists).

    Raises ValueError for an unknown law, and for missing or unknown parameters.
    """
    if name not in LAWS:
        near = difflib.get_close_matches(name, LAWS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(LAWS)}"
        raise ValueError(f"no elastic law {name!r}{hint}")
    values = {k: tuple(map(float, v)) if isinstance(v, list | tuple) else float(v) for k, v in params.items()}
    try:
        return LAWS[name](**values)
    except TypeError as error:
        raise ValueError(f"parameters of the law {name!r} do not fit: {', '.join(params) or 'none given'}") from error
