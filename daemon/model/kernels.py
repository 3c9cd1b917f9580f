"""Declaration of all numba kernels: simulator, stacks, oracles and analysis.

Machine code is stored on the disk, in one folder for all processes of an installation. The first
call of a missing kernel compiles it; other processes that need it wait. A short run
(:func:`daemon.run.rehearse`) compiles the kernels of a system and lists them, so that later
processes load only these before they fork.
"""

# Much of numba has no annotations.
# mypy: allow-untyped-calls
from __future__ import annotations

import fcntl
import gc
import hashlib
import json
import os
import sys
import types
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, Final, TypeAlias, TypeVar, cast

import numpy as np
from numba import typeof
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from daemon.supervision.child import die_with_parent
from grammars.text.files import user_folder, write_atomically

F = TypeVar("F", bound=Callable[..., Any])
KernelFile: TypeAlias = tuple[str, str, str]
"""Module and name of a kernel, and the file with the machine code that was called.

A module with two empty texts has no called kernel, but must be imported.
"""

CACHE_VARIABLE: Final = "NUMBA_CACHE_DIR"
_CONSTANTS: Final = (bool, int, float, str, bytes, tuple, np.generic)
_COLLECT_RARELY: Final = 50_000
"""Objects made between two collections while numba compiles."""
_SYSTEMS: Final = "daemon.stacks."
"""Prefix of modules that a run imports on demand."""
_OURS: Final = "daemon."
"""Prefix of modules that a list of kernels may name: the list is a file."""


def kernel(function: F) -> F:
    """Compile to machine code on the first call, cached on disk until a source of it changes."""
    # Never ``parallel``: workers fork from a warm parent, and OpenMP's threads do not survive a
    # fork; cores are for runs. Never ``fastmath``: traces must be equal byte for byte, and
    # reordered sums are not. Loading a kernel takes 3 to 10 ms, compiling one 250 to 850 ms.
    # The wrapper for calls from C is left out: it is unused, and takes 4 % of compiling.
    return cast(F, _Kernel(function, targetoptions={"nopython": True, "no_cfunc_wrapper": True}))


class _Kernel(CPUDispatcher):
    """numba's dispatcher of a function, with machine code that processes share."""

    def __init__(self, function: Callable[..., Any], targetoptions: dict[str, bool]) -> None:
        super().__init__(function, targetoptions=targetoptions)
        self._cache = _KernelCache(function)

    @property
    def stamp(self) -> str:
        """Digest of everything compiled into the kernel."""
        return str(self._cache._cache_file._source_stamp)

    def compile(self, sig: Any) -> Any:
        """Return machine code for a signature: from memory, from the disk, or compiled now."""
        arguments, _ = normalize_signature(sig)
        if arguments in self.overloads:
            return super().compile(sig)
        with _compiler.alone(self._cache.place):
            code = super().compile(sig)
        if _compiler.depth == 0:
            _compiler.called[self._entry(arguments)] = None
        return code

    def is_on_disk(self, signature: tuple[Any, ...]) -> bool:
        """Return whether machine code for arguments of these types is on the disk."""
        return self._cache.file_of(signature, self.targetctx) != ""

    def load_file(self, name: str) -> bool:
        """Load the machine code in the file ``name``; return whether it exists and is current."""
        signature = self._cache.signature_in(name, self.targetctx)
        if signature is None:
            return False
        self.compile(signature)
        return True

    def _entry(self, arguments: tuple[Any, ...]) -> KernelFile:
        function = self.py_func
        file = self._cache.file_of(arguments, self.targetctx)
        return function.__module__, function.__qualname__, file


def machine_code(function: F, *arguments: Any) -> F:
    """Return the machine code of a kernel for arguments of the types of ``arguments``.

    Call it with these types only: contiguous arrays must stay contiguous, numbers must not become
    arrays. Useful where many arrays come in named tuples, whose types numba checks one by one: 10
    of 100 us of a control cycle. In :func:`compiling_ahead` another process compiles it, and the
    first call waits for that.
    """
    dispatcher: Any = function
    signature = tuple(cast(Any, typeof)(each) for each in arguments)
    if _compiler.ahead is None or dispatcher.is_on_disk(signature):
        return cast(F, dispatcher.compile(signature))
    parent = os.getpid()
    process = os.fork()
    if not process:
        try:
            die_with_parent(parent)
            dispatcher.compile(signature)
        finally:
            os._exit(0)  # the caller meets the same error
    _compiler.ahead.append(process)
    return function


def cache_folder() -> Path:
    """Return the folder of machine code, the same for every process of an installation.

    ``NUMBA_CACHE_DIR``, or the first writable folder of these: next to the sources, in the user's
    cache, in the state directory.
    """
    if chosen_folder := os.environ.get(CACHE_VARIABLE):
        return Path(chosen_folder) / "scenario"
    package = Path(__file__).parents[1]
    place = hashlib.sha256(bytes(package)).hexdigest()[:8]
    folders = [package / "__pycache__" / "kernels"]
    folders.append(user_folder("cache") / f"kernels-{place}")
    if state := os.environ.get("SCENARIO_STATE"):
        folders.append(Path(state) / f"kernels-{place}")
    return next((folder for folder in folders if _can_be_written(folder)), folders[0])


def _can_be_written(folder: Path) -> bool:
    existing = next(each for each in (folder, *folder.parents) if each.exists())
    return os.access(existing, os.W_OK)


def count_kernels() -> int:
    """Return the number of kernels with machine code on the disk."""
    return sum(1 for _ in cache_folder().glob("*.nbi"))


class _Locator:
    """Place of a kernel's machine code, and the stamp of everything compiled into it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @classmethod
    def from_function(cls, function: Callable[..., Any], _: str) -> _Locator:
        """Return the locator of a function; called by numba."""
        return cls(function)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(_folder())

    def ensure_cache_path(self) -> None:
        """Make the folder; raises ``OSError``."""
        _folder().mkdir(parents=True, exist_ok=True)

    def get_disambiguator(self) -> str:
        """Return a text that distinguishes functions of one name in two modules."""
        module = f"{self._function.__module__}.{self._function.__code__.co_firstlineno}"
        return module.removeprefix(_OURS)

    def get_source_stamp(self) -> str:
        """Return the digest of the function's file and of everything compiled into it.

        numba itself uses the size and time of that file alone. But called kernels and constants of
        other modules are compiled in too: without them an upgraded installation, whose folders keep
        old machine code, would run half of the old version. The time is left out: a copy or a
        container image has the same source with another time.
        """
        code, names = self._function.__code__, self._function.__globals__
        digest = hashlib.sha256(_content(code.co_filename).encode())
        for part in _compiled_in(code, names):
            digest.update(part.encode())
        return digest.hexdigest()


class _CacheImplementation(CompileResultCacheImpl):
    _locator_classes: Any = (_Locator,)


class _IndexFile(IndexDataCacheFile):
    """Index of a kernel's files; an unreadable one counts as empty."""

    def _load_index(self) -> dict[Any, str]:
        # It has pickled types: their class may have moved, or the file may be cut.
        with suppress(OSError, EOFError, UnpicklingError, AttributeError, ImportError):
            return dict(super()._load_index())
        return {}


class _KernelCache(FunctionCache):
    """The machine code of one kernel on the disk, a file for each signature."""

    _impl_class = _CacheImplementation

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _IndexFile(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    @property
    def place(self) -> int:
        """Byte of the lock file for this kernel."""
        return zlib.crc32(self._impl.filename_base.encode())

    def file_of(self, signature: tuple[Any, ...], context: Any) -> str:
        """Return the name of the file with machine code for ``signature``, or an empty text."""
        key = self._index_key(signature, context.codegen())
        return str(self._cache_file._load_index().get(key, ""))

    def signature_in(self, name: str, context: Any) -> tuple[Any, ...] | None:
        """Return the signature of the machine code in the file ``name``, if it is for this CPU."""
        index = self._cache_file._load_index()
        key = next((key for key, file in index.items() if file == name), None)
        if key is None or key != self._index_key(key[0], context.codegen()):
            return None
        signature: tuple[Any, ...] = key[0]
        return signature

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store machine code, and report it."""
        super().save_overload(sig, data)
        _compiler.on_kernel()

    @contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        # With a full disk or a cut file, this process still has what it compiles.
        with suppress(OSError, EOFError, UnpicklingError):
            yield


class _Compiler:
    """Compiling in this process: locks, the garbage collector, and progress.

    ``depth`` counts the nested kernels in compilation: each is called by the one before.
    ``called`` are the kernels that Python has called. ``ahead`` are the processes that compile
    kernels for later, ``None`` outside :func:`compiling_ahead`.
    """

    def __init__(self) -> None:
        self.depth = 0
        self.called: dict[KernelFile, None] = {}
        self.ahead: list[int] | None = None
        self.on_kernel: Callable[[], object] = _ignore
        self._lock: int | None = None

    @contextmanager
    def alone(self, place: int) -> Iterator[None]:
        """Hold the lock of a kernel, so that only one process compiles it."""
        thresholds = gc.get_threshold()
        # numba makes millions of small objects that live until a function is compiled. Python's
        # thresholds spend a quarter of the time on collections; these cost 10 MB of memory.
        gc.set_threshold(max(_COLLECT_RARELY, thresholds[0]), *thresholds[1:])
        self.depth += 1
        self._set_lock(fcntl.LOCK_EX, place)
        try:
            yield
        finally:
            self._set_lock(fcntl.LOCK_UN, place)
            self.depth -= 1
            gc.set_threshold(*thresholds)

    def _set_lock(self, operation: int, place: int) -> None:
        # Without a lock, as on a read-only file system, two processes may compile the same kernel.
        with suppress(OSError):
            if self._lock is None:
                _folder().mkdir(parents=True, exist_ok=True)
                self._lock = os.open(_folder() / "lock", os.O_RDWR | os.O_CREAT, 0o600)
            fcntl.lockf(self._lock, operation, 1, place)


def _ignore() -> None:
    """Ignore that a kernel was compiled."""


_compiler: Final = _Compiler()


@cache
def _folder() -> Path:
    return cache_folder()


@contextmanager
def compiling_ahead(
    on_kernel: Callable[[], object],
) -> Iterator[Callable[[], tuple[KernelFile, ...]]]:
    """Let :func:`machine_code` compile kernels in processes of their own.

    Calls ``on_kernel`` after each kernel, in these processes too. Yields a function that returns
    the kernels this process has called, and the modules of systems it has imported, for
    :func:`keep_list`. For a process without threads.
    """

    def collect() -> tuple[KernelFile, ...]:
        systems = [name for name in sys.modules if name.startswith(_SYSTEMS)]
        return (*_compiler.called, *((name, "", "") for name in systems))

    _compiler.ahead, _compiler.on_kernel = [], on_kernel
    try:
        yield collect
    finally:
        for process in _compiler.ahead:
            os.waitpid(process, 0)
        _compiler.ahead, _compiler.on_kernel = None, _ignore


def keep_list(name: str, kernels: tuple[KernelFile, ...]) -> None:
    """Add the kernels that a kind of system calls to the current ones in its list.

    Raises ``OSError``.
    """
    listed = dict.fromkeys((*(entry for entry in _read_list(name) if _load(*entry)), *kernels))
    write_atomically(_folder() / f"{name}.json", json.dumps(list(listed)).encode())


def load_list(name: str) -> bool:
    """Load the listed kernels of a kind of system from the disk.

    Return whether all were loaded; otherwise a short run has to compile them.
    """
    kernels = _read_list(name)
    missing = [entry for entry in kernels if not _load(*entry)]
    return bool(kernels) and not missing


def _read_list(name: str) -> tuple[KernelFile, ...]:
    try:
        entries = json.loads((_folder() / f"{name}.json").read_bytes())
        return tuple((module, function, file) for module, function, file in entries)
    except (OSError, ValueError, TypeError):
        return ()  # there is no list


def _load(module: str, name: str, file: str) -> bool:
    if not module.startswith(_OURS):
        return False
    if (module, name, file) in _compiler.called:
        return True
    try:
        function = getattr(import_module(module), name, None) if name else import_module(module)
    except ImportError:
        return False  # of another version
    return not name or (isinstance(function, _Kernel) and function.load_file(file))


@cache
def _content(file: str) -> str:
    """Return the digest of a source file."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _compiled_in(code: types.CodeType, names: dict[str, Any]) -> Iterator[str]:
    """Yield the stamps of the kernels and the values of the constants that ``code`` names."""
    for name, value in _named(code, names):
        if isinstance(value, _Kernel):
            yield f"{name} {value.stamp}"
        elif isinstance(value, np.ndarray):
            yield f"{name} {hashlib.sha256(value.tobytes()).hexdigest()}"
        elif isinstance(value, _CONSTANTS):
            yield f"{name} {value!r}"
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _compiled_in(constant, names)


def _named(code: types.CodeType, names: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of the names in ``code``, from its module and modules it names."""
    for name in code.co_names:
        value = names.get(name)
        if isinstance(value, types.ModuleType):
            inside = vars(value)
            yield from ((part, inside[part]) for part in code.co_names if part in inside)
        else:
            yield name, value
