"""How far a series is: one small file in its folder, written whole after every run, read again tomorrow."""

from __future__ import annotations

import datetime
import hashlib
import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bench.daily.series_file import Series
from bench.daily.yaml_edit import write_whole
from bench.errors import InputError
from bench.yamlfile import read_text

STATE = "series.json"

Status = Literal["done", "stopped", "skipped"]


class _Kept(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Turn(_Kept):
    """One run of a pad: its folder (in the series' folder), how it ended, since when the pad had been left alone."""

    folder: str
    status: Status
    cause: str = ""
    ended: datetime.datetime
    rested_s: float | None = None


class PadState(_Kept):
    """What became of one pad; `status` None: it has not had its turn, or is to have another."""

    status: Status | None = None
    turns: list[Turn] = Field(default_factory=list)


class State(_Kept):
    """The whole file. The hashes are of the files that the series began with."""

    protocol_sha256: str
    bench_sha256: str
    pads: Annotated[dict[str, PadState], Field(default_factory=dict)]

    def of(self, pad_id: str) -> PadState:
        """The state of a pad, a new one where it has none."""
        return self.pads.setdefault(pad_id, PadState())

    def write(self, out: Path) -> None:
        """Write it whole: who is interrupted finds the old file or the new one."""
        write_whole(out / STATE, json.dumps(self.model_dump(mode="json"), indent=2) + "\n")


def read_state(series: Series, *, changed: bool = False) -> State:
    """The state of a series, a new one where it has not begun.

    Raises `InputError` where the file is none of ours, or (unless `changed`) protocol or bench are not what the
    series began with: its pads could not be compared.
    """
    hashes = {
        "protocol_sha256": hashlib.sha256(series.protocol.text.encode()).hexdigest(),
        "bench_sha256": hashlib.sha256(series.bench.text.encode()).hexdigest(),
    }
    path = series.out / STATE
    if not path.exists():
        return State(**hashes, pads={})
    try:
        state = State.model_validate_json(read_text(path))
    except ValidationError as error:
        where = ".".join(str(key) for key in error.errors()[0]["loc"]) or "the whole file"
        raise InputError(
            str(path), f"is no state of a series (at {where}: {error.errors()[0]['msg']})",
            "give the series another `out`, or take the file away: finished runs keep their folders",
        ) from None  # fmt: skip
    for key, now in hashes.items():
        if getattr(state, key) != now and not changed:
            what = key.removesuffix("_sha256")
            raise InputError(
                str(path), f"the {what} file is not the one that this series began with",
                "begin another series (a new `out`), or say --changed: pads before and after differ by more than pads",
            )  # fmt: skip
    return state.model_copy(update=hashes)
