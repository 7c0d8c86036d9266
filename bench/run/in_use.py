"""One process at a time speaks to a bench, also over ports that two may open (TCP), and whoever comes second is told.

A small file for each port in the system's folder for temporary files, held as long as the ports are open; it says who
holds it. It stays when they are closed, and means nothing then.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.errors import Refused
from bench.recording.lock import hold, is_alive

COMMAND = "another command"
"""What uses a port, where it is no run."""


@contextmanager
def using(ports: Iterable[str], what: str = COMMAND) -> Iterator[None]:
    """Be the one that uses these ports of a bench file, as long as it lasts; `what` is told to whoever comes meanwhile.

    Simulated ports belong to their process, and are free always. Raises `Refused` where a port is in use already.
    """
    held: list[int] = []
    try:
        for url in sorted({_same(port) for port in ports if not port.startswith("sim://")}):
            descriptor = _open(_file(url))
            if descriptor is None:
                continue
            held.append(descriptor)
            if not hold(descriptor):
                raise Refused(f"port {url} is in use: {_holder(descriptor)}\n  wait for its end, or end it there")
            _sign(descriptor, what)
        yield
    finally:
        for descriptor in held:
            os.close(descriptor)


def _same(port: str) -> str:
    """One name for one port: `/dev/serial/by-id/…` is a link."""
    return port if "://" in port else os.path.realpath(port)


def _file(url: str) -> Path:
    return Path(tempfile.gettempdir()) / f"padbench-port-{hashlib.sha256(url.encode()).hexdigest()[:16]}.lock"


def _open(path: Path) -> int | None:
    """The file, made where it is not there; None where it cannot be: the port's own exclusion is left then."""
    flags = getattr(os, "O_NOFOLLOW", 0)
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except OSError:
        try:
            return os.open(path, os.O_RDONLY | flags)  # somebody else's: it can be held all the same
        except OSError:
            return None
    return descriptor


def _sign(descriptor: int, what: str) -> None:
    text = json.dumps({"process": os.getpid(), "what": what}).encode()
    try:
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, text)
    except OSError:
        return  # not ours to write


def _holder(descriptor: int) -> str:
    try:
        said = json.loads(os.read(descriptor, 65536))
        if is_alive(said["process"]):
            return f"{said['what']} is going on (process {said['process']})"
    except (OSError, ValueError, KeyError, TypeError):
        pass  # its holder could not write into it, or is about to
    return "another process has it"
