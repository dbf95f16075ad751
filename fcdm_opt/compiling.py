"""How kernels are compiled: with which options, for which types of arrays, where the code is kept, and how far it is.

`kernel` and `step` are numba's `njit` with five differences, as most of a first run is compiling:

- one version of each function, whatever the flags of the arrays and whether a number is known in advance: numba would
  compile `f` again for a read-only array, and again for each literal. What arrives read-only from Python is read as if
  it were not; a kernel writes into nothing but what its docstring says that it fills.
- kernels call the code of others, as it was compiled once; numba would take it into each of theirs and compile it there
  again. Steps, and functions whose names start with an underscore, are taken in: those are to be small, or called once.
- a function that only other kernels call, named with an underscore, gets no entry from Python. Where one calls it all
  the same, as tests do, it is compiled for that too.
- a *light* kernel takes little time on little data: its first calls on such run as plain Python, so that what is asked
  once needs no compiling, unless compiled code is kept already.
- the code that is kept is found by what it was made from: a function's instructions and those of all that it calls, in
  whichever file, and each number that these take from their modules. So no change anywhere can leave old code in use.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from time import perf_counter
from types import CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numba
import numpy as np
from numba import types
from numba.core import config as numba_config
from numba.core import event
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import OmittedArg
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

from fcdm_opt.doors import upper

config: Any = numba_config
_Dispatcher: Any = CPUDispatcher

# no fastmath, as NaN and the order of sums matter; no bounds checks; "numpy" division: nothing tests for zero twice
_OPTIONS = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
_INNER = _OPTIONS | {"no_cpython_wrapper": True}
# nothing is allocated in a step, so arrays need no counting of references, which would take half of the time
_STEP = _INNER | {"forceinline": True, "_nrt": False}


Needed = dict[tuple[str, str, tuple[Any, ...]], str]
"""Compiled code that other code calls: module, name and types of each kernel, and the symbol of its code."""
_NEEDED: list[Needed] = []  # of what is being compiled, the innermost last

PATIENCE = 0.4  # seconds that a light kernel may take in plain Python, in all, before it is compiled
LITTLE = 6000  # entries of all its arrays up to which it is light


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep the code for later runs.

    With `NUMBA_DISABLE_JIT=1` it stays as it is.
    """
    if config.DISABLE_JIT:
        return function
    inner = function.__name__.startswith("_")
    made = (_Inner if inner else _Compiled)(function, targetoptions=_INNER if inner else _OPTIONS)
    made.keep()
    _ALL[made] = None
    return made


def light(made: Any) -> Any:
    """Let a kernel run as plain Python until it has taken `PATIENCE`: for those whose work is little on little data."""
    if not config.DISABLE_JIT:
        made.patience = PATIENCE
    return made


def step(function: Callable[..., Any]) -> Any:
    """Compile a function into every kernel that calls it: handing over arrays costs more than most steps take."""
    return function if config.DISABLE_JIT else _Inner(function, targetoptions=_STEP)


class _Compiled(_Dispatcher):
    """A compiled function whose versions differ in what its arguments are, not in flags of arrays and known values."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.patience = 0.0
        self.needed: dict[tuple[Any, ...], Needed] = {}  # of each version: others that must be there before it
        self._served: set[tuple[Any, ...]] = set()

    def keep(self) -> None:
        """Keep its code on disk."""
        self._cache = _Kept(self.py_func)

    def compile(self, sig: Any) -> Any:
        """Compile for some types, or return what serves them."""
        args = tuple(map(types.unliteral, sig if isinstance(sig, tuple) else sig.args))
        with global_compiler_lock:
            if args not in self.overloads:
                _NEEDED.append({})
                try:
                    super().compile(args)
                finally:
                    self.needed[args] = _NEEDED.pop()
                self._register(self.overloads[args])
            return self.overloads[args].entry_point

    def _register(self, made: Any) -> None:
        """Have kernels that call it call the code that there is, instead of each taking its code into its own."""
        self.targetctx.remove_user_function(made.entry_point)
        self.targetctx.insert_user_function(made.entry_point, made.fndesc, ())

    def get_overload(self, sig: Any) -> Any:
        """Return the version that a kernel calls, and note that it does."""
        entry = super().get_overload(sig)
        if _NEEDED:
            _NEEDED[-1].update(self._needed_for(tuple(sig if isinstance(sig, tuple) else sig.args)))
        return entry

    def _needed_for(self, args: tuple[Any, ...]) -> Needed:
        key = self.py_func.__module__, self.py_func.__name__, args
        return {key: self.overloads[args].fndesc.llvm_func_name}

    def _compile_for_args(self, *args: Any, **keywords: Any) -> Any:
        """Return what a call from Python is to go to."""
        self._compilation_chain_init_hook()
        given: tuple[Any, ...] = tuple(
            types.Omitted(a.value) if isinstance(a, OmittedArg) else self.typeof_pyval(a) for a in args
        )
        wanted = tuple(map(_plain, given))
        if self.patience > 0.0 and not keywords and self._is_little(args, wanted):
            return self._interpreted
        entry = self.compile(wanted)
        if given != wanted and given not in self._served:
            self._served.add(given)
            self._insert([type_._code for type_ in given], entry, False)
        return entry

    def _is_little(self, args: tuple[Any, ...], wanted: tuple[Any, ...]) -> bool:
        if wanted in self.overloads or self._cache.has(wanted, self.targetctx):
            return False
        return sum(a.size for a in args if isinstance(a, np.ndarray)) <= LITTLE

    def _interpreted(self, *args: Any) -> Any:
        """Run as plain Python, with all that it calls."""
        start = perf_counter()
        with np.errstate(all="ignore"):
            found = _written(self)(*args)
        self.patience -= perf_counter() - start
        return _unboxed(found)


class _Inner(_Compiled):
    """One that kernels call: what Python calls is compiled apart, when it does."""

    def add_overload(self, made: Any) -> None:
        """Register a version for kernels alone."""
        self.overloads[tuple(made.signature.args)] = made

    def _register(self, made: Any) -> None:
        """Leave it to be taken into the code of those that call it."""

    def _needed_for(self, args: tuple[Any, ...]) -> Needed:
        return self.needed[args]

    def _compile_for_args(self, *args: Any, **keywords: Any) -> Any:
        entry = _outer(self)._compile_for_args(*args, **keywords)
        given: tuple[Any, ...] = tuple(self.typeof_pyval(a) for a in args)
        if given not in self._served:
            self._served.add(given)
            self._insert([type_._code for type_ in given], entry, False)
        return entry


@cache
def _outer(inner: _Inner) -> _Compiled:
    return _Compiled(inner.py_func, targetoptions=_OPTIONS)


def _plain(type_: Any) -> Any:
    """Return the type that stands for one: an array that may be written to, a number that is not known in advance."""
    if isinstance(type_, types.Array) and not type_.mutable:
        return type_.copy(readonly=False)
    if isinstance(type_, types.UniTuple):
        return types.UniTuple(_plain(type_.dtype), type_.count)
    if isinstance(type_, types.Tuple):
        return types.Tuple(tuple(_plain(part) for part in type_.types))
    return types.unliteral(type_)


@cache
def _written(made: _Compiled) -> Callable[..., Any]:
    """Return a kernel as plain Python, which calls others as plain Python."""
    function = made.py_func
    return FunctionType(function.__code__, _names(function), function.__name__, function.__defaults__)


_NAMES: dict[str, dict[str, Any]] = {}  # of each module, with plain Python in place of what is compiled


def _names(function: Any) -> dict[str, Any]:
    names = _NAMES.get(function.__module__)
    if names is None:
        names = _NAMES[function.__module__] = dict(function.__globals__)
        names |= {name: _written(value) for name, value in names.items() if isinstance(value, _Compiled)}
    return names


def _unboxed(found: Any) -> Any:
    """Return what compiled code would: numbers of Python."""
    if isinstance(found, tuple):
        return tuple(map(_unboxed, found))
    return found.item() if isinstance(found, np.generic) else found


# ------------------------------------------------------------------------------------------------ code that is kept


class _Kept(_Cache):
    """The compiled versions of a function on disk, one file each, named by all that it was made from.

    Parameters
    ----------
    function : function
        As written.
    """

    def __init__(self, function: Any) -> None:
        self._function, self._enabled = function, True
        self._folder: Path | None = None

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(self._folder or "")

    def has(self, sig: Any, target_context: Any) -> bool:
        """Tell whether a version is on the disk."""
        path = self._path(sig, target_context.codegen())
        return path is not None and path.is_file()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a version from the disk, None if it is not there or cannot be read."""
        path = self._path(sig, target_context.codegen())
        if path is None or not path.is_file():
            return None
        target_context.refresh()
        try:
            needed, parts = pickle.loads(path.read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):
            return None
        for (module, name, args), symbol in needed.items():
            made = getattr(import_module(module), name)
            made.compile(args)
            if made.overloads[args].fndesc.llvm_func_name != symbol:  # compiled anew since
                return None
        _NEEDED[-1].update(needed)
        return CompileResult._rebuild(target_context, *parts)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write a version, whole or not at all; what other code left under the same name goes."""
        path = self._path(sig, data.codegen)
        if path is None or data.library.has_dynamic_globals:
            return
        unfinished = path.with_suffix(f".{os.getpid()}")
        try:
            unfinished.write_bytes(dumps((_NEEDED[-1], data._replace(type_annotation="")._reduce())))
            unfinished.replace(path)
            if path.parent.name == "__pycache__":  # of this tree alone
                name, stamp, _ = path.stem.rsplit("-", 2)
                for other in path.parent.glob(f"{name}-*.nb?"):
                    if not other.name.startswith(f"{name}-{stamp}-"):
                        other.unlink(missing_ok=True)
        except OSError:
            unfinished.unlink(missing_ok=True)

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        if self._folder is None:
            self._folder = _folder(Path(self._function.__code__.co_filename))
        if not self._enabled or not self._folder.name:
            return None
        version = hashlib.sha256(repr((str(sig), codegen.magic_tuple(), sys.version, numba.__version__)).encode())
        name = f"{self._function.__module__.rpartition('.')[2]}.{self._function.__qualname__}"
        return self._folder / f"{name}-{stamp_of(self._function)[:16]}-{version.hexdigest()[:16]}.nbc"

    def enable(self) -> None:
        """Use it."""
        self._enabled = True

    def disable(self) -> None:
        """Leave it alone."""
        self._enabled = False

    def flush(self) -> None:
        """Nothing waits to be written."""


def _folder(source: Path) -> Path:
    """Return where the code of a source file is kept: `NUMBA_CACHE_DIR`, beside it, with the user's caches; or none."""
    folders = [source.parent / "__pycache__", Path(AppDirs("fcdm_opt", False).user_cache_dir)]
    for folder in [Path(config.CACHE_DIR)] if config.CACHE_DIR else folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path()


_STAMPS: WeakKeyDictionary[Any, str] = WeakKeyDictionary()


def stamp_of(function: Any) -> str:
    """Return a hash of all that a function is compiled from: its instructions, what it calls, and the numbers it takes.

    Parameters
    ----------
    function : function
        As written; what it calls may be compiled or not.
    """
    known = _STAMPS.get(function)
    if known is None:
        _STAMPS[function] = ""  # where it calls itself
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        said = _read(function.__code__, function, cells)
        known = _STAMPS[function] = hashlib.sha256(
            repr((_OPTIONS, _STEP, function.__defaults__, said)).encode()
        ).hexdigest()
    return known


def _read(code: CodeType, function: Any, values: list[Any]) -> list[Any]:
    """Return what some code of a function says, but for its docstring and lines, and what stands behind its names."""
    said: list[Any] = [code.co_code, code.co_names, code.co_argcount, code.co_varnames]
    for k, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            said += _read(constant, function, [])
        elif k or constant != function.__doc__:
            said.append(constant)
    names = function.__globals__
    values += [names[name] for name in code.co_names if name in names]
    for value in values:
        value = getattr(value, "py_func", value)
        if isinstance(value, FunctionType):
            said.append(stamp_of(value))
        elif isinstance(value, np.ndarray):
            said += [value.dtype.str, value.shape, value.tobytes()]
        elif isinstance(value, ModuleType | type):
            said.append(value.__name__)
            if value.__name__.startswith("fcdm_opt."):  # what is taken from another module by its name
                values += [vars(value)[name] for name in code.co_names if name in vars(value)]
        else:
            said.append(value)
    return said


# ----------------------------------------------------------------------------------------------------- how far it is

_ALL: WeakKeyDictionary[_Compiled, None] = WeakKeyDictionary()


class _Progress(event.Listener):
    """Tells how far compiling is: a bar on a terminal, once a line elsewhere. What is kept is not compiled."""

    def __init__(self) -> None:
        self._depth = 0
        self._said = False
        self._bar: Any = None

    def on_start(self, event: Any) -> None:
        """Note that a function is about to be compiled."""
        if event.data["dispatcher"] not in _ALL:
            return
        self._depth += 1
        if self._depth > 1:
            return
        if sys.stderr is not None and sys.stderr.isatty():
            from rich.progress import BarColumn, Progress, TextColumn

            columns = TextColumn("compiling numerical kernels"), BarColumn(), TextColumn("{task.description}")
            self._bar = Progress(*columns, console=upper("show.printing:console")(stderr=True), transient=True)
            self._bar.add_task("")
            self._show()
            self._bar.start()
        elif not self._said:
            self._said = True
            logging.getLogger("fcdm_opt").warning(
                "compiling numerical kernels that were not used before: a minute or two in all, kept for later runs"
            )

    def on_end(self, event: Any) -> None:
        """Note that it is done."""
        if event.data["dispatcher"] not in _ALL:
            return
        self._depth -= 1
        if self._bar is not None:
            self._show()
            if self._depth == 0:
                self._bar.stop()
                self._bar = None

    def _show(self) -> None:
        done = sum(1 for made in list(_ALL) if made.overloads)
        text = f"{done} of at most {len(_ALL)}, kept for later runs"
        self._bar.update(self._bar.task_ids[0], completed=done, total=len(_ALL), description=text)


event.register("numba:compile", _Progress())
