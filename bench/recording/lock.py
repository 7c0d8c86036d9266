"""Who has a file: a lock that the system itself takes away when the process that holds it is gone, however it went.

Advisory locks of whole files (`flock`): reading and copying go on. Where there are none (Windows, some network disks)
nothing is held and nobody is known to hold anything.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # not POSIX
    fcntl = None  # type: ignore[assignment]  # a module, or nothing

TRIES, PAUSE_S = 20, 0.005
"""Whoever asks whether a file is held holds it himself for a moment."""


def hold(descriptor: int) -> bool:
    """Hold an open file until it is closed; False where another process has it (or another opening of this one)."""
    if fcntl is None:
        return True
    for _ in range(TRIES):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(PAUSE_S)
        except OSError:
            return True  # a disk without locks
        else:
            return True
    return False


@contextmanager
def holding(folder: Path) -> Iterator[bool]:
    """Hold a folder until the end; False where another process has it. On a system that opens no folder nobody is known
    to hold any."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        yield True
        return
    try:
        yield hold(descriptor)
    finally:
        os.close(descriptor)


def is_held(path: Path) -> bool:
    """Whether somebody holds the file now; False where it is not there, or nobody can say."""
    if fcntl is None:
        return False
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    else:
        return False
    finally:
        os.close(descriptor)


def is_alive(process: int) -> bool:
    """Whether a process of that number is there (another may have it by now)."""
    if fcntl is None:
        return True  # asking so would end it there
    try:
        os.kill(process, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return True
