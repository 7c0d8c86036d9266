"""Compilation on first use, and where the compiled code is kept.

Nothing here imports numba until something compiled is needed, so `import sim` is cheap and `padbench --help` quick.

Three kinds of function are compiled:

- `@compiled("float64(float64, int64)")`: a plain function, called from Python or from other compiled functions;
- `@block`: one scalar step `(dt_s, u, state, parameters) -> float`, called by address (`call_block`), so that any
  combination of blocks runs in one generic loop that was compiled once;
- `call_block`: the call of a block by its address, and `pointer`, for compiled functions only.

A module-level function may call any of these by their global name. Left alone, each is an ordinary Python function
over ordinary sequences (`block.python`, `compiled.python`), which is how they are tested against themselves.

**The cache.** numba keeps compiled code on disk, and looks only at the file a function stands in: an edit in a *called*
function of another file goes unnoticed. So the folder is named after a hash of all of sim's sources; for a function
that stands elsewhere, of the sources beside it too.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
import types
from collections.abc import Callable, Iterable, Iterator, MutableSequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

State = MutableSequence[float]
"""What a block remembers between steps; a pointer into the plant's state when compiled, a list when not."""

Step = Callable[[float, float, State, State], float]

KEEP_FOLDERS = 8
KEEP_UNUSED_S = 30 * 86400.0


SIM = Path(__file__).resolve().parent

_CACHE_LOCK = threading.Lock()


def sources_hash(files: Iterable[Path]) -> str:
    """Hash of the files with their names, of numba's version and of Python's."""
    from importlib.metadata import version

    digest = hashlib.sha256(f"{version('numba')} {sys.version}".encode())
    for path in sorted(files):
        digest.update(str(path).encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _roots() -> Iterator[Path]:
    """Folders to try, best first."""
    for variable in ("PADBENCH_CACHE_DIR", "NUMBA_CACHE_DIR"):
        if os.environ.get(variable):
            yield Path(os.environ[variable]) / "padbench"
    if os.environ.get("XDG_CACHE_HOME"):
        yield Path(os.environ["XDG_CACHE_HOME"]) / "padbench"
    with suppress(RuntimeError):  # no home folder
        yield Path.home() / ".cache" / "padbench"


@functools.cache
def cache_folder() -> Path:
    """The folder of this version's compiled code: made, writable, and the only one numba is shown.

    Without a writable cache folder it is a private one under the system's temporary folder: compiled code is loaded
    and run, so a folder that others can write to will not do.
    """
    name = sources_hash(SIM.rglob("*.py"))
    for root in _roots():
        folder = root / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "used").touch()
        except OSError:
            continue
        _prune(root, keep=folder)
        return folder
    folder = _private_temporary() / name
    folder.mkdir(exist_ok=True)
    return folder


def _private_temporary() -> Path:
    """A folder of this user alone; where somebody else made it, a new one that goes with the process."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"padbench-{user}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        info = folder.lstat()
        ours = info.st_uid == user and not info.st_mode & 0o077
        if stat.S_ISDIR(info.st_mode) and (ours or not hasattr(os, "getuid")) and os.access(folder, os.W_OK):
            return folder
    fresh = Path(tempfile.mkdtemp(prefix="padbench-"))
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return fresh


def _prune(root: Path, keep: Path) -> None:
    """Remove folders of other versions: all but the newest few, and those not used for a month."""
    ages: list[tuple[float, Path]] = []
    for marker in root.glob("*/used"):
        with suppress(OSError):
            ages.append((time.time() - marker.stat().st_mtime, marker.parent))
    for rank, (age, folder) in enumerate(sorted(ages)):
        if folder != keep and (rank >= KEEP_FOLDERS or age > KEEP_UNUSED_S):
            shutil.rmtree(folder, ignore_errors=True)


@functools.cache
def _folder_for(beside: Path) -> Path:
    """Where code compiled from sources in the folder `beside` is kept."""
    if beside.resolve().is_relative_to(SIM):
        return cache_folder()
    return cache_folder() / sources_hash(beside.glob("*.py"))


@contextmanager
def _numba_cache(function: Callable[..., Any]) -> Iterator[Any]:
    """Numba, with its cache in our folder while it looks (other users of numba in this process keep theirs). One thread
    at a time: another that put the setting back amid a look would leave the cache in the working directory."""
    import numba

    config: Any = numba.config
    with _CACHE_LOCK:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(_folder_for(Path(function.__code__.co_filename).parent))
        try:
            yield numba
        finally:
            config.CACHE_DIR = before


def _names(code: types.CodeType) -> set[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= _names(constant)
    return names


class _Deferred:
    """Something that becomes a numba object when it is first needed."""

    def numba_object(self) -> Any:
        raise NotImplementedError


def _bound(function: Callable[..., Any]) -> types.FunctionType:
    """`function` over globals in which the deferred functions it names are numba's own objects."""
    assert isinstance(function, types.FunctionType)
    namespace = dict(function.__globals__)
    for name in _names(function.__code__):
        value = namespace.get(name)
        if isinstance(value, _Deferred):
            namespace[name] = value.numba_object()
    copy = types.FunctionType(function.__code__, namespace, function.__name__, function.__defaults__)
    copy.__qualname__ = function.__qualname__
    copy.__module__ = function.__module__
    copy.__doc__ = function.__doc__
    return copy


class Compiled(_Deferred, Generic[P, R]):
    """A function compiled for one signature on its first call. `python` is the function as written."""

    def __init__(self, function: Callable[P, R], signature: str) -> None:
        self.python = function
        self.signature = signature
        functools.update_wrapper(self, function)

    @functools.cached_property
    def native(self) -> Callable[P, R]:
        """The compiled function itself; call this one where 0.1 µs a call matters."""
        bound = _bound(self.python)
        with _numba_cache(bound) as numba:
            result: Callable[P, R] = numba.njit(self.signature, cache=True, error_model="numpy", nogil=True)(bound)
        return result

    def numba_object(self) -> Any:
        """What a compiled caller calls."""
        return self.native

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the compiled function."""
        return self.native(*args, **kwargs)


def compiled(signature: str) -> Callable[[Callable[P, R]], Compiled[P, R]]:
    """Compile the decorated module-level function for `signature` (numba's notation) when it is first needed."""

    def decorate(function: Callable[P, R]) -> Compiled[P, R]:
        return Compiled(function, signature)

    return decorate


class Block(_Deferred):
    """A scalar step; `address` is where its compiled form stands. Calling it runs the Python form."""

    def __init__(self, function: Step) -> None:
        self.python = function
        functools.update_wrapper(self, function)

    @functools.cached_property
    def _native(self) -> Any:
        bound = _bound(self.python)
        with _numba_cache(bound) as numba:
            pointer = numba.types.CPointer(numba.types.float64)
            double = numba.types.float64
            return numba.cfunc(double(double, double, pointer, pointer), cache=True, error_model="numpy")(bound)

    def __reduce__(self) -> str:
        return self.python.__qualname__  # pickled and copied by name, as functions are

    @property
    def address(self) -> int:
        """Address of the compiled step; good for the life of the process."""
        return int(self._native.address)

    def numba_object(self) -> Any:
        """Raises TypeError: a call by name would need a compilation for each combination of blocks."""
        raise TypeError(f"{self.python.__name__} is a block; compiled code calls it by address")

    def __call__(self, dt_s: float, u: float, state: State, parameters: State) -> float:
        """Run the Python form."""
        return self.python(dt_s, u, state, parameters)


def block(function: Step) -> Block:
    """Mark a module-level function `(dt_s, u, state, parameters) -> float` as a block."""
    return Block(function)


class _Intrinsic(_Deferred):
    """A primitive of compiled code that numba does not have; made from `typed` when it is first needed."""

    def __init__(self, name: str, typed: Callable[[], Any]) -> None:
        self.name = name
        self._typed = typed

    @functools.cached_property
    def _object(self) -> Any:
        from numba.extending import intrinsic

        return intrinsic(self._typed())

    def numba_object(self) -> Any:
        return self._object

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.name} works in compiled code only")


def _numba_types() -> Any:
    import numba

    return numba.types


def _call_block() -> Any:
    from llvmlite import ir

    nt = _numba_types()
    doubles = nt.CPointer(nt.float64)

    def typed(typing: Any, address: Any, dt: Any, u: Any, state: Any, i: Any, parameters: Any, j: Any) -> Any:
        signature = nt.float64(nt.int64, nt.float64, nt.float64, doubles, nt.int64, doubles, nt.int64)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place, dt, u, state, i, parameters, j = arguments
            double = ir.DoubleType()
            step = ir.FunctionType(double, [double, double, double.as_pointer(), double.as_pointer()])
            function = builder.inttoptr(place, step.as_pointer())
            return builder.call(function, [dt, u, builder.gep(state, [i]), builder.gep(parameters, [j])])

        return signature, generate

    return typed


def _pointer() -> Any:
    nt = _numba_types()

    def typed(typing: Any, array: Any) -> Any:
        signature = nt.CPointer(array.dtype)(array)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return context.make_array(array)(context, builder, arguments[0]).data

        return signature, generate

    return typed


call_block = _Intrinsic("call_block", _call_block)
"""`call_block(address, dt, u, state, i, parameters, j)`: the block at `address` on `state[i:]` and `parameters[j:]`."""

pointer = _Intrinsic("pointer", _pointer)
"""`pointer(array)`: to its first element. Arrays are counted references, which costs at every call."""
