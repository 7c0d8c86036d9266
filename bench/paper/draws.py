"""Many draws, over processes.

What is finished is kept, one line of JSON a draw, so that a run that was stopped is taken up again.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.errors import InputError
from bench.one_thread import ONE_THREAD
from bench.paper.experiment import Fitted, fits_of
from bench.paper.settings import Settings

Draw = tuple[Fitted, ...]
FILE = "draws.jsonl"


def run(
    settings: Settings, folder: Path, draws: int, starts: int, jobs: int, told: Callable[[int], None] = lambda _: None
) -> list[Draw]:
    """The fits of draws 0 … `draws` − 1; those in `folder` are taken from there. `told`: how many are done, as it goes.

    Raises InputError where the folder holds draws of other settings or another number of starts.
    """
    path = folder / FILE
    key = _key(settings, starts)
    done = kept(path, key)
    missing = [draw for draw in range(draws) if draw not in done]
    told(draws - len(missing))
    with path.open("a", encoding="utf-8") as file:

        def keep(line: dict[str, Any]) -> None:
            file.write(json.dumps(line, allow_nan=False) + "\n")
            file.flush()
            done[line["draw"]] = _fits(line)
            told(sum(draw in done for draw in range(draws)))

        if jobs == 1 or len(missing) < 2:
            for draw in missing:
                keep(_one(settings, draw, starts, key))
        else:
            _spread(settings, missing, starts, key, jobs, keep)
    return [done[draw] for draw in range(draws)]


def kept(path: Path, key: str) -> dict[int, Draw]:
    """Draws that a file holds, by number; a last line that was cut off is cut out of the file. Raises InputError."""
    if not path.exists():
        return {}
    out: dict[int, Draw] = {}
    whole = 0
    for raw in path.read_bytes().splitlines(keepends=True):
        try:
            line = json.loads(raw)
        except ValueError:
            break
        if not raw.endswith(b"\n"):
            break
        if not isinstance(line, dict) or line.get("key") != key:
            raise InputError(str(path), "holds draws of other settings or starts", "name another folder")
        out[line["draw"]] = _fits(line)
        whole += len(raw)
    if whole < path.stat().st_size:
        with path.open("r+b") as file:
            file.truncate(whole)
    return out


def _spread(
    settings: Settings, missing: list[int], starts: int, key: str, jobs: int, keep: Callable[[dict[str, Any]], None]
) -> None:
    with _environment(ONE_THREAD):  # a process has one core
        pool = ProcessPoolExecutor(min(jobs, len(missing)), multiprocessing.get_context("spawn"), _leave_to_parent)
        futures = [pool.submit(_one, settings, draw, starts, key) for draw in missing]
        try:
            for future in as_completed(list(futures)):
                keep(future.result())
                futures.remove(future)
        finally:
            pool.shutdown(cancel_futures=True)
            for future in futures:  # stopped: those that were under way have ended by now, and are kept too
                if future.done() and not future.cancelled() and future.exception() is None:
                    keep(future.result())


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """What child processes find in theirs; ours is as it was afterwards."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _leave_to_parent() -> None:
    """Ctrl-C reaches the whole group: the parent ends the work, after the draws under way."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _one(settings: Settings, draw: int, starts: int, key: str) -> dict[str, Any]:
    return {"key": key, "draw": draw, "fits": [f.to_json() for f in fits_of(settings, draw, starts)]}


def _fits(line: dict[str, Any]) -> Draw:
    return tuple(Fitted.from_json(entry) for entry in line["fits"])


def _key(settings: Settings, starts: int) -> str:
    """What a draw hangs on; criteria and the number of draws are judged afterwards, and may change."""
    data = settings.model_dump(mode="json", exclude={"criteria", "draws", "starts", "speeds_mm_s"})
    text = json.dumps([data, starts], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
