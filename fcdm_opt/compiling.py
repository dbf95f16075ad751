"""How kernels are compiled: with which options, for which types of arrays, where the code is kept, and how far it is.

`kernel` and `step` are numba's `njit` with six differences, as most of a first run is compiling:

- one version of each function, whatever the flags of the arrays and whether a number is known in advance: numba would
  compile `f` again for a read-only array, and again for each literal. What arrives read-only from Python is read as if
  it were not; a kernel writes into nothing but what its docstring says that it fills.
- kernels call the code of others, as it was compiled once; numba would take it into each of theirs and compile it there
  again. Steps, and functions whose names start with an underscore, are taken in: those are to be small, or called once.
- what only kernels call, a step or named with an underscore, gets no entry from Python: there it runs as it is written.
- a *light* kernel takes little time on little data: its first calls on such run as plain Python, so that what is asked
  once needs no compiling, unless compiled code is kept already, or all is to be compiled (`eager`). That lasts until
  plain Python has taken as long as compiling would, in this process and its copies together; what it took in all
  runs is noted beside the code.
- of processes that want the same kernel one compiles it; the others wait, and take what it keeps. Nobody waits for
  what is compiled in the background (`stay_behind`): at its low priority that may take minutes.
- the code that is kept is known by what it was made from: a function's instructions and those of all that it calls, in
  whichever file, and each number that these take from their modules. So no change anywhere can leave old code in use.
"""

from __future__ import annotations

import glob
import hashlib
import logging
import math
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import count
from mmap import mmap
from pathlib import Path
from threading import local
from time import perf_counter, thread_time
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numba import __version__ as numba_version
from numba import types
from numba.core import config as numba_config
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import TargetConfig
from numba.extending import overload
from numba.np import arrayobj

from fcdm_opt import pacing
from fcdm_opt.version import __version__ as version

fcntl: Any = import_module("fcntl") if find_spec("fcntl") else None  # not on Windows

config: Any = numba_config
_Dispatcher: Any = CPUDispatcher
_Format: Any = CompileResultCacheImpl
_Files: Any = FunctionCache
_Library: Any = JITCodeLibrary
_Passes: Any = Compiler
_Flags: Any = TargetConfig

# no fastmath, as NaN and the order of sums matter; no bounds checks; "numpy" division: nothing tests for zero twice
_OPTIONS = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
_INNER = _OPTIONS | {"no_cpython_wrapper": True}
# nothing is allocated in a step, so arrays need no counting of references, which would take half of the time
_STEP = _INNER | {"forceinline": True, "_nrt": False}

Needed = set[tuple[str, str, tuple[Any, ...]]]
"""Compiled code that other code calls: module, name and types of each kernel."""
_NEEDED: list[Needed] = []  # of what is being compiled, the innermost last

COMPILING = 2.1e-4  # seconds a byte of instructions
OFTEN = 0.16  # share of the time of compiling that a kernel runs as written which has a few calls or thousands
IN_ALL = 30.0  # seconds of plain Python that light kernels may take together in one run
IN_RUNS = 40.0  # and in all runs, as noted where their code is kept: compiling all of them takes about as long
SHORTEST = 1e-4  # seconds that a call counts at least
LOOKS = 32  # calls of kernels by one another between two looks at the clock, which takes as long as many of these do
NOTICED = 2.0  # seconds of compiling after which a library call says why it takes long
NOTICE = "compiling numerical kernels, kept for later runs: three minutes at most"
ALL_AT_ONCE = "fcdm-opt warmup compiles them all"
LITTLE = 400000  # entries of all its arrays up to which it is light
PLACES = 1 << 16  # of kernels in what processes share
_allowance = np.frombuffer(mmap(-1, 8))  # seconds, of this process and all that are copies of it
_allowance[0] = IN_ALL
_spent = np.frombuffer(mmap(-1, 8 * PLACES))  # seconds of each kernel, in all these processes
_made = [0]  # how many kernels were compiled
_taken = [0.0]  # seconds that are to be noted
_behind = [0]  # in how many times `ALL_PLACE` the kernels' locks of processes in the background begin
ALL_PLACE = 1 << 32  # past every checksum, in the file of locks
NOTE, NOTED = "seconds-of-plain-python", 0.2  # where, and how many at least
KEPT_AS = 2  # how code is kept: with another number it is made anew


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep the code for later runs.

    With `NUMBA_DISABLE_JIT=1` it stays as it is.
    """
    if config.DISABLE_JIT:
        return function
    if function.__name__.startswith("_"):
        made = _Inner(function, targetoptions=_INNER, pipeline_class=_Within)
    else:
        made = _Compiled(function, targetoptions=_OPTIONS, pipeline_class=_SameSymbols)
        made.keeps = True
    _ALL[made] = None
    return made


def light(made: Any, share: float = 1.0) -> Any:
    """Let a kernel run as plain Python for as long as compiling it takes: one whose work is little on little data."""
    if not config.DISABLE_JIT:
        made.patience, made.share = math.inf, share  # what it calls need not be there yet
    return made


def often(made: Any) -> Any:
    """Let a kernel run so for a share of that: one that is called either a few times or very often."""
    return light(made, OFTEN)


def _with_called(made: _Compiled, known: set[_Compiled]) -> set[_Compiled]:
    """Add a kernel to those known, and all that it calls: what is to be compiled with it."""
    known.add(made)
    for name in made.py_func.__code__.co_names:
        called = made.py_func.__globals__.get(name)
        if isinstance(called, _Compiled) and called not in known and not called.is_there():
            _with_called(called, known)
    return known


def eager() -> None:
    """Compile light kernels, too, when they are first called: from now on, in this process."""
    _allowance[0] = 0.0


def stay_behind(nice: int) -> None:
    """Go on at a lower priority: processes that do so hold each other off from a kernel, but none of the others."""
    os.nice(nice)
    _behind[0] = 2


def step(function: Callable[..., Any]) -> Any:
    """Compile a function into every kernel that calls it: handing over arrays costs more than most steps take."""
    return function if config.DISABLE_JIT else _Inner(function, targetoptions=_STEP, pipeline_class=_Within)


class _Compiled(_Dispatcher):
    """A compiled function whose versions differ in what its arguments are, not in flags of arrays and known values."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._cache: Any = NullCache()
        self.keeps = False  # its code on disk
        self.patience, self.share = 0.0, 1.0
        self.place = zlib.crc32(f"{self.py_func.__module__}.{self.py_func.__name__}".encode())
        self.kept, self.asked = False, -1  # by earlier runs; how many had been compiled when it was last asked that
        self.needed: dict[tuple[Any, ...], Needed] = {}  # of each version: others that must be there before it
        self._served: set[tuple[Any, ...]] = set()

    def compile(self, sig: Any) -> Any:
        """Compile for some types, or return what serves them."""
        args = tuple(map(types.unliteral, sig if isinstance(sig, tuple) else sig.args))
        with global_compiler_lock:
            if args not in self.overloads:
                self._find_files()
                with _locked(self):
                    _NEEDED.append(set())
                    try:
                        super().compile(args)
                        _made[0] += 1
                    finally:
                        self.needed[args] = _NEEDED.pop()
                self._register(self.overloads[args])
            return self.overloads[args].entry_point

    def _find_files(self) -> None:
        if self.keeps and isinstance(self._cache, NullCache):
            try:
                self._cache = _Kept(self.py_func)
            except RuntimeError:  # nowhere to write
                self.keeps = False

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
        return {key}

    def _compile_for_args(self, *args: Any, **keywords: Any) -> Any:
        """Return what a call from Python is to go to."""
        self._compilation_chain_init_hook()
        if self._lasting() > 0.0 and not keywords and self._is_little(args):
            return self._interpreted
        given: tuple[Any, ...] = tuple(map(self.typeof_pyval, args))
        wanted = tuple(map(_plain, given))
        entry = self.compile(wanted)
        if given != wanted and given not in self._served:
            self._served.add(given)
            self._insert([type_._code for type_ in given], entry, False)
        return entry

    def _lasting(self) -> float:
        """Return for how many seconds it may still run as plain Python, here and in copies of this process."""
        return self.patience - float(_spent[self.place % PLACES])

    def _is_little(self, args: tuple[Any, ...]) -> bool:
        _count_runs()
        if self.patience == math.inf or self.asked < _made[0]:
            called = () if self.is_there() else _with_called(self, set())
            self.asked, code = _made[0], sum(len(each.py_func.__code__.co_code) for each in called)
            self.patience = min(self.patience, self.share * COMPILING * code)
        lasting = min(self._lasting(), _allowance[0]) > 0.0 and not self.overloads
        return lasting and sum(array.size for array in _arrays(args)) <= LITTLE

    def is_there(self) -> bool:
        """Return whether some version is compiled, by this run or an earlier one."""
        if self.keeps and self.asked < 0:
            self._find_files()
            found: Any = self._cache
            self.kept, self.asked = self.keeps and found._enabled and bool(found._cache_file._load_index()), 0
        return self.keeps and (self.kept or bool(self.overloads))

    def _interpreted(self, *args: Any) -> Any:
        """Run as plain Python, with all that it calls, or compiled where that takes too long.

        What it takes is not counted against time limits: compiled, it would take next to none.
        """
        start, clock, given = perf_counter(), thread_time(), [(each, each.copy()) for each in _arrays(args)]
        _until.clock = clock + self._lasting()
        try:
            with np.errstate(all="ignore"):
                return _unboxed(_written(self)(*args))
        except (_CostlyError, ArithmeticError):  # numbers of Python are not divided by zero
            for array, before in given:
                if array.flags.writeable:
                    array[...] = before
            self.patience = 0.0
        finally:
            took = thread_time() - clock
            _spent[self.place % PLACES] += max(took, SHORTEST)
            _note(took)
            pacing.exclude_time(perf_counter() - start)
        return self(*args)


@cache
def _count_runs() -> None:
    """Allow plain Python what earlier runs left of it."""
    with suppress(RuntimeError, OSError, ValueError):  # nowhere to write, or not written by this
        _allowance[0] = min(_allowance[0], IN_RUNS - sum(map(float, _kept_in(NOTE).read_text("ascii").split())))


def _note(took: float) -> None:
    """Note seconds of plain Python for this run and later ones, when they are enough to be noted."""
    _allowance[0] -= took
    _taken[0] += took
    if _taken[0] >= NOTED:
        with suppress(RuntimeError, OSError), _kept_in(NOTE).open("a", encoding="ascii") as file:
            file.write(f"{_taken[0]:.1f}\n")
        _taken[0] = 0.0


def _kept_in(name: str) -> Path:
    """Return the path of a file beside the code that is kept."""
    return Path(_Files(_kept_in)._cache_path) / name


def compiles_all() -> bool:
    """Return whether this process is the one that compiles all kernels, until it ends: one at a time does."""
    with suppress(OSError, TypeError):  # somebody else does, or there are no locks
        fcntl.lockf(_locks(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, ALL_PLACE)
        return True
    return False


def all_kept(note: bool = False) -> bool:
    """Return whether all kernels of this version were compiled and kept, or cannot be; or note that they were."""
    known = f"{version} {numba_version}"
    with suppress(RuntimeError, OSError):  # nowhere to write
        place = _kept_in("all-kept")
        if note:
            place.write_text(known, "ascii")
        return fcntl is None or (place.is_file() and place.read_text("ascii") == known)
    return True


@contextmanager
def _locked(made: _Compiled) -> Iterator[None]:
    """Hold off other processes that want the same kernel: what is compiled here, they take from where it is kept."""
    locks = _locks() if made.keeps else None
    if locks is None:
        yield
        return
    start, own = perf_counter(), made.place + _behind[0] * ALL_PLACE
    with suppress(OSError):  # a file system without locks
        fcntl.lockf(locks, fcntl.LOCK_EX, 1, own)
        if _behind[0]:  # until nobody in front is at it; who wants it now does not wait for this
            fcntl.lockf(locks, fcntl.LOCK_EX, 1, made.place)
            fcntl.lockf(locks, fcntl.LOCK_UN, 1, made.place)
    if not _NEEDED:
        pacing.exclude_time(perf_counter() - start)
    try:
        yield
    finally:
        with suppress(OSError):
            fcntl.lockf(locks, fcntl.LOCK_UN, 1, own)


@cache
def _locks() -> int | None:
    """Return a descriptor of the file in which each kernel has a byte to lock, None without; open to the end."""
    with suppress(RuntimeError, OSError):  # nowhere to write
        return os.open(_kept_in("locks"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666) if fcntl else None
    return None


class _Inner(_Compiled):
    """One that kernels call: taken into the code of each of them, so that there is none of its own to make or keep."""

    def add_overload(self, made: Any) -> None:
        """Register a version for kernels alone."""
        made = made._replace(entry_point=object())  # a name that is its own
        self.targetctx.insert_user_function(made.entry_point, made.fndesc, [made.library])
        self.overloads[tuple(made.signature.args)] = made

    def _register(self, made: Any) -> None:
        """Leave it as it is registered."""

    def _needed_for(self, args: tuple[Any, ...]) -> Needed:
        return self.needed[args]

    def _compile_for_args(self, *_: Any, **__: Any) -> Any:
        return _written(self)


class _Instructions(_Library):
    """Code for others to take in, of which no machine code is made."""

    def _optimize_final_module(self) -> None:
        """Leave that to what takes it in."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


def _refuse_shapes(source: Any, place: Any) -> None:
    """Raise as an array is written to a place of another shape."""
    raise ValueError("arrays of different shapes")


@overload(_refuse_shapes)
def _refusing(source: Any, place: Any) -> Any:
    return _refuse_shapes


# numba's own puts both shapes into words, for which it compiles its strings: that takes longer than most kernels
arrayobj.raise_with_shape_context = _refuse_shapes
# compared some thousand times for each kernel, flag by flag
_Flags.__eq__ = lambda own, other: own._values == other._values or own.values() == other.values()
_Flags.__hash__ = lambda own: 0


class _SameSymbols(_Passes):
    """The passes, with symbols that are the same in each process: numba's count what was compiled before."""

    def _compile_bytecode(self) -> Any:
        function = self.state.func_id
        function.unique_id = stamp_of(function.func)[:16]
        function.unique_name = f"{function.func_qualname}${function.unique_id}"
        return super()._compile_bytecode()


class _Within(_SameSymbols):
    """The passes that compile what is taken into others."""

    def __init__(self, types_: Any, target: Any, library: Any, args: Any, result: Any, flags: Any, names: Any) -> None:
        super().__init__(types_, target, library, args, result, flags, names)
        self.state.library = _Instructions(target.codegen(), "within")
        self.state.flags.no_compile = True


def _plain(type_: Any) -> Any:
    """Return the type that stands for one: an array that may be written to, a number that is not known in advance."""
    if isinstance(type_, types.Array) and not type_.mutable:
        return type_.copy(readonly=False)
    if isinstance(type_, types.BaseAnonymousTuple):
        parts: Any = type_
        return types.BaseTuple.from_types(tuple(_plain(part) for part in parts))
    return types.unliteral(type_)


class _CostlyError(Exception):
    """Raised in plain Python that has taken as long as compiling would."""


_until = local()  # this clock of the thread a kernel may run as plain Python
_calls = count()


def _arrays(args: tuple[Any, ...]) -> Iterator[Any]:
    """Go through the arrays among arguments, and in tuples of these."""
    for value in args:
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            yield from _arrays(value)


def _without_errors(function: Any, other: Any) -> Callable[..., Any]:
    """Return a function of `math` that answers as compiled code does where it has no value: as NumPy's does."""

    def answered(*args: Any) -> Any:
        try:
            return np.float64(function(*args))
        except (ValueError, OverflowError):
            return other(*args)

    return answered


_MATH = SimpleNamespace(**vars(math))
for _name in ("sqrt", "exp", "log", "sin", "cos", "tan"):
    setattr(_MATH, _name, _without_errors(getattr(math, _name), getattr(np, _name)))

_ARRAYS = SimpleNamespace(**vars(np))
_ARRAYS.uintp, _ARRAYS.abs = int, abs  # as they answer, in a tenth of the time
_INSTEAD = {math: _MATH, np: _ARRAYS}
_NAMES: dict[str, dict[str, Any]] = {}  # of each module, with plain Python in place of what is compiled


@cache
def _written(made: _Compiled) -> Callable[..., Any]:
    """Return a kernel as plain Python, which calls others as plain Python, too, but those that are compiled."""
    written: Any = made.py_func
    names = _NAMES.get(written.__module__)
    if names is None:
        names = _NAMES[written.__module__] = dict(written.__globals__)
        names |= {name: _written(value) for name, value in names.items() if isinstance(value, _Compiled)}
        modules = {name: value for name, value in names.items() if isinstance(value, ModuleType)}
        names |= {name: _INSTEAD.get(value, value) for name, value in modules.items()}
    function = FunctionType(written.__code__, names, written.__name__, written.__defaults__)

    def clocked(*args: Any) -> Any:
        if made.is_there():
            return made(*args)
        if next(_calls) % LOOKS == 0 and thread_time() > _until.clock:
            raise _CostlyError
        return function(*args)

    return function if isinstance(made, _Inner) else clocked


def _unboxed(found: Any) -> Any:
    """Return what compiled code would: numbers of Python."""
    if isinstance(found, tuple):
        return tuple(map(_unboxed, found))
    return found.item() if isinstance(found, np.generic) else found


# ------------------------------------------------------------------------------------------------ code that is kept


class _Payload(_Format):
    """What is written of a version: the code that it calls, and its own."""

    def reduce(self, data: Any) -> Any:
        return _NEEDED[-1], super().reduce(data._replace(type_annotation=""))

    def rebuild(self, target_context: Any, reduced_data: Any) -> Any:
        """Return the version, None if what it calls has moved."""
        needed, parts = reduced_data
        for module, name, args in needed:
            try:
                made = getattr(import_module(module), name)
            except (ImportError, AttributeError):
                return None
            made.compile(args)
        _NEEDED[-1].update(needed)
        return super().rebuild(target_context, parts)

    def check_cachable(self, data: Any) -> bool:
        """Tell whether it may be written."""
        return not data.library.has_dynamic_globals


class _Versions(IndexDataCacheFile):
    """The versions of a function: an index, and a file for each, named by what it holds.

    numba numbers these files: of two processes that compile at once, one would write over what the other's index names.
    """

    def _load_data(self, name: Any) -> Any:
        try:
            return super()._load_data(name)
        except (ImportError, AttributeError) as error:  # made before a module that it took from was moved
            raise OSError(f"{name} is out of date") from error

    def save(self, key: Any, data: Any) -> None:
        """Write a version, then the index: what that names is there."""
        identity = repr((self._source_stamp, str(key[0]), *key[1:])).encode()
        name = self._data_name_pattern.replace("{number:d}", hashlib.sha256(identity).hexdigest()[:16])
        self._save_data(name, data)
        known = self._load_index()
        self._save_index({**known, key: name})
        if not known:  # none of this stamp: others are what was changed since
            folder, stem = Path(self._cache_path), self._index_name.removesuffix(".nbi")
            for other in folder.glob(f"{glob.escape(stem)}.*.nbc"):
                if other.name != name:
                    other.unlink(missing_ok=True)


class _Kept(_Files):
    """The compiled versions of a function on disk, stamped with all that it was made from."""

    _impl_class = _Payload

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file: Any = _Versions(self._cache_path, self._impl.filename_base, stamp_of(function))


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
        parts = _read(function.__code__, function, cells)
        known = _STAMPS[function] = hashlib.sha256(
            repr((KEPT_AS, _OPTIONS, _STEP, function.__defaults__, parts)).encode()
        ).hexdigest()
    return known


def _read(code: CodeType, function: Any, values: list[Any]) -> list[Any]:
    """Return what some code of a function says, but for its docstring and lines, and what stands behind its names."""
    parts: list[Any] = [code.co_code, code.co_names, code.co_argcount, code.co_varnames]
    for k, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            parts += _read(constant, function, [])
        elif k or constant != function.__doc__:
            parts.append(constant)
    names = function.__globals__
    values += [names[name] for name in code.co_names if name in names]
    for value in values:
        if isinstance(value, _Compiled):
            parts.append(value.targetoptions)
            value = value.py_func
        if isinstance(value, FunctionType):
            parts.append(stamp_of(value))
        elif isinstance(value, np.ndarray):
            parts += [value.dtype.str, value.shape, value.tobytes()]
        elif isinstance(value, ModuleType | type):
            parts.append(value.__name__)
            if value.__name__.startswith("fcdm_opt."):  # what is taken from another module by its name
                values += [vars(value)[name] for name in code.co_names if name in vars(value)]
        else:
            parts.append(value)
    return parts


# ----------------------------------------------------------------------------------------------------- how far it is

_ALL: WeakKeyDictionary[_Compiled, None] = WeakKeyDictionary()


class _Progress(event.Listener):
    """Tells whoever listens that it compiles, else a log: once as a warning, which is seen."""

    def __init__(self) -> None:
        self._depth, self._start, self._took, self._process = 0, 0.0, 0.0, os.getpid()

    def on_start(self, event: Any) -> None:
        """Note that a function is about to be compiled."""
        if event.data["dispatcher"] not in _ALL:
            return
        self._depth += 1
        if self._depth == 1:
            self._start = perf_counter()
            self._tell()

    def on_end(self, event: Any) -> None:
        """Note that it is done."""
        if event.data["dispatcher"] not in _ALL:
            return
        self._depth -= 1
        if self._depth == 0:
            pacing.exclude_time(perf_counter() - self._start)
            before, self._took = self._took, self._took + perf_counter() - self._start
            if before < NOTICED <= self._took and os.getpid() == self._process and not pacing.has_listeners():
                logging.getLogger("fcdm_opt").warning("%s; %s", NOTICE, ALL_AT_ONCE)
            if pacing.has_listeners():
                self._tell()

    def _tell(self) -> None:
        if pacing.has_listeners():
            pacing.at(NOTICE)
        else:
            logging.getLogger("fcdm_opt").info("compiling kernels: %d so far", sum(bool(own.overloads) for own in _ALL))


event.register("numba:compile", _Progress())
