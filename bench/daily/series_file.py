"""The list of a series: one bench, one protocol, many pads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from bench.complaints import FieldError
from bench.config import Bench, load_bench, load_model, simulated
from bench.errors import InputError
from bench.protocol import Name, NotNegative, Protocol, Sample, Word, load_protocol
from bench.shipped import find_file
from bench.yamlfile import Document, read_yaml, validate
from sim.model import Model

_NO_FILE_NAME = re.compile(r"[^A-Za-z0-9._-]+")


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Pad(Sample):
    """One pad of the list; as a protocol's `sample`, but that the `id` is needed."""

    id: Name


FileName = Annotated[Word, Field(min_length=1, max_length=1000)]
"""A file or folder, from where the list is, or from the root."""


class SeriesFile(_Part):
    """A list file. Files in it are relative to it."""

    name: Word = ""
    bench: FileName = Field(description="bench file or shipped name")
    protocol: FileName = Field(description="protocol file or shipped name")
    pad: Word | None = Field(None, description="the pads as the lab believes them to be: model file or shipped name")
    out: FileName = Field(description="folder of the series: a run folder for each pad, series.json, series.csv")
    rest_s: NotNegative = Field(0.0, description="s, from mounting a pad (or its last contact) to its run")
    operator: Word | None = None
    conditions: Word | None = None
    law: Literal["auto", "exponential", "power", "polynomial", "spline"] = Field("auto", description="as `fit --law`")
    order: Annotated[Word, Field(pattern=r"^(auto|[1-9]\d?)$")] = Field("auto", description="as `fit --order`")
    contact: Literal["auto", "bonded", "unilateral"] = Field("auto", description="as `fit --contact`")
    degree: Annotated[int, Field(ge=1)] | None = Field(None, description="of a polynomial law, as `fit --degree`")
    samples: Annotated[list[Pad], Field(min_length=1)]

    @model_validator(mode="after")
    def _each_once(self) -> SeriesFile:
        seen: dict[str, int] = {}
        for index, pad in enumerate(self.samples):
            name = folder_name(pad.id)
            if name in seen:
                message = f"`{pad.id}` makes the same folder as the id of samples[{seen[name]}]"
                raise FieldError(("samples", index, "id"), message, "give each pad an id of its own")
            seen[name] = index
        return self


@dataclass(frozen=True)
class Series:
    """A list with what it names, read and checked; `out` is the series' folder."""

    name: str
    bench: Bench
    protocol: Protocol
    believed: Model | None
    believed_text: str | None
    out: Path
    rest_s: float
    operator: str | None
    conditions: str | None
    pads: list[Pad]
    structure: dict[str, Any]
    """What is fitted to every pad: `law`, `order`, `contact`, `degree`, as `identify.fit` takes them."""


def folder_name(pad_id: str) -> str:
    """A pad's id as the name of a folder."""
    return _NO_FILE_NAME.sub("-", pad_id).strip(".") or "pad"


def load_series(path: Path, *, dry_run: bool = False) -> Series:
    """The list of a file; `dry_run`: its bench with simulated ports. Raises `InputError` with place and cure."""
    document = read_yaml(path)
    listed = validate(document, SeriesFile)
    bench = load_bench(_beside(document, "bench", listed.bench))
    believed = _beside(document, "pad", listed.pad) if listed.pad is not None else None
    return Series(
        name=listed.name or path.stem,
        bench=simulated(bench) if dry_run else bench,
        protocol=load_protocol(_beside(document, "protocol", listed.protocol)),
        believed=load_model(believed) if believed is not None else None,
        believed_text=believed.read_text("utf-8") if believed is not None else None,
        out=path.parent / listed.out,
        rest_s=listed.rest_s,
        operator=listed.operator,
        conditions=listed.conditions,
        pads=listed.samples,
        structure={name: getattr(listed, name) for name in ("law", "order", "contact", "degree")},
    )


def _beside(document: Document, key: Literal["bench", "protocol", "pad"], name: str) -> Path:
    beside = document.path.parent / name
    if beside.is_file():
        return beside
    try:
        return find_file(key, name)
    except InputError as error:
        raise document.error((key,), f"`{name}`: {error.message}", error.cure) from None
