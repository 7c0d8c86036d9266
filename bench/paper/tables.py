"""Tables I to III of the paper as data, and what their filters are: poles, static gain, relaxation or not.

The numbers stand in tables.yaml as printed. Everything else here is computed from them. The paper gives no sample time,
so rates are per sample (ν T), and its coefficients have four decimals, so a pole near 1 is known to some 1e-4 only.
"""

from __future__ import annotations

import functools
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from bench.yamlfile import load
from sim.digital import Filter
from sim.elastic import ElasticLaw, Exponential, Power
from sim.inverse import NotARelaxation, relaxation_of

Number = Annotated[float, Field(allow_inf_nan=False)]
Coefficients = Annotated[tuple[Number, ...], Field(min_length=1)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PrintedRow(_Part):
    """One line of a table as printed: a_1 … a_r, b_1 … b_r, (γ_1, γ_2), and V in N² where it is given."""

    a: Coefficients
    b: Coefficients
    gamma: tuple[Number, Number]
    V: Number | None = None

    @model_validator(mode="after")
    def _match(self) -> PrintedRow:
        if len(self.a) != len(self.b):
            raise ValueError(f"{len(self.a)} coefficients a but {len(self.b)} b: the paper has l = r")
        return self


class PrintedTable(_Part):
    """One of the paper's tables as printed."""

    number: Literal["I", "II", "III"]
    pad: str
    method: Literal["noniterative", "iterative", "fast"]
    law: Literal["exponential", "power"]
    rows: tuple[PrintedRow, ...]


class _File(_Part):
    tables: tuple[PrintedTable, ...]


class Row:
    """One row of one table, with what follows from its numbers."""

    def __init__(self, table: PrintedTable, printed: PrintedRow) -> None:
        self.table = table
        self.printed = printed
        self.filter = Filter((1.0, *printed.a), (1.0, *printed.b))

    def __repr__(self) -> str:
        return f"<Table {self.table.number}, r = {self.order}>"

    @property
    def order(self) -> int:
        """r."""
        return self.filter.order

    @property
    def V(self) -> float | None:
        """The mean squared prediction error (16) as printed, N²."""
        return self.printed.V

    @property
    def law(self) -> ElasticLaw:
        """F^e: (10) with p/(q+1) = γ_1 and q + 1 = γ_2, or (9) with m = γ_1 and b = γ_2."""
        first, second = self.printed.gamma
        return Power(first * second, second - 1.0) if self.table.law == "power" else Exponential(first, second)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of the filter, the largest in magnitude first."""
        return self.filter.poles

    @property
    def stable(self) -> bool:
        """All poles are inside the unit circle."""
        return self.filter.stable

    @property
    def static_gain(self) -> float:
        """Force at the end of an endless hold over the elastic force, if the filter is stable."""
        return self.filter.static_gain

    @property
    def relaxation(self) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Shares c_1 …, and rates per sample ν_1 T …; None where the filter is no relaxation."""
        try:
            return relaxation_of(self.filter, 1.0)
        except NotARelaxation:
            return None

    @property
    def reason(self) -> str:
        """Why the filter is no relaxation, in words; empty where it is one."""
        try:
            relaxation_of(self.filter, 1.0)
        except NotARelaxation as error:
            return error.reason
        return ""


class Table:
    """One of the paper's tables."""

    def __init__(self, printed: PrintedTable) -> None:
        self.printed = printed
        self.rows = tuple(Row(printed, row) for row in printed.rows)

    def row(self, order: int) -> Row:
        """The row of order r; KeyError where the table has none."""
        for row in self.rows:
            if row.order == order:
                return row
        raise KeyError(order)


@functools.cache
def tables() -> dict[str, Table]:
    """The tables by their numbers I, II, III."""
    content, _ = load(Path(str(files("bench.paper") / "tables.yaml")), _File)
    return {table.number: Table(table) for table in content.tables}


def rows() -> tuple[Row, ...]:
    """All nine rows, in the paper's order."""
    return tuple(row for table in tables().values() for row in table.rows)
