"""What a run was given, as its recording holds it: bench, believed model, and what was expected of the protocol."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel

from bench import yamlfile
from bench.config import Bench
from bench.errors import InputError
from bench.plan import plan
from bench.predict import Prediction, TooLong, predict
from bench.protocol import Protocol
from bench.recording import Recording
from bench.recording.schemas import BENCH_FILE, PROTOCOL_FILE
from bench.shipped import MODEL
from sim.model import Model

M = TypeVar("M", bound=BaseModel)


def bench_in(recording: Recording) -> Bench | None:
    """The bench file; None where there is none that can be read. Of a simulated bench it holds no truth."""
    return _read(recording, BENCH_FILE, Bench, simulation={})


def model_in(recording: Recording) -> Model | None:
    """The pad that was believed in (`--pad`); None where there was none."""
    return _read(recording, MODEL, Model)


def described_in(recording: Recording) -> str:
    """The description of the protocol that was run; empty where there is none."""
    protocol = _read(recording, PROTOCOL_FILE, Protocol)
    return protocol.description if protocol is not None else ""


def prediction_in(recording: Recording, believed: Model | None) -> Prediction | None:
    """What the protocol was expected to do on this bench; None where the recording does not say."""
    bench, protocol = bench_in(recording), _read(recording, PROTOCOL_FILE, Protocol)
    if bench is None or protocol is None:
        return None
    if protocol.in_air:
        believed = None
    try:
        return predict(plan(protocol, bench, believed), believed)
    except TooLong:
        return None


def _read(recording: Recording, name: str, cls: type[M], **cut_out: Any) -> M | None:
    """An attached file, with what was cut out of it before it was attached; None where it is not there, or of another
    version, or needs files beside it."""
    content = recording.attachments.get(name)
    if content is None:
        return None
    try:
        document = yamlfile.parse(content.decode(errors="replace"), recording.source)
        if isinstance(document.data, dict):
            document.data.update(cut_out)
        return yamlfile.validate(document, cls)
    except InputError:
        return None
