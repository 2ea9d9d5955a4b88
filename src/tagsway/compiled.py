"""Loops that numba compiles: once for a machine, then they are read from its cache."""

import inspect
import zlib
from collections.abc import Callable
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

from numba import njit

_P = ParamSpec("_P")
_R = TypeVar("_R")

# Sums may be taken in any order, and a division by zero gives infinity, else no loop is done sixteen pixels at a time.
# NaN stays NaN.
_HOW: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "contract", "nsz"}}


def compile_part(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that others in the same file, once compiled, can call; nothing is compiled yet."""
    compiled: Callable[_P, _R] = njit(**_HOW)(function)
    return compiled


def compile_whole(
    function: Callable[_P, _R], signature: tuple[Any, ...], *, without_lock: bool = False
) -> Callable[_P, _R]:
    """Return a function compiled for one signature, from the cache where it is there.

    Without the interpreter's lock the decoder goes on meanwhile; but giving it up and taking it again costs as much as
    a short function.

    The cache lies beside the source file, else in the user's own cache folder (NUMBA_CACHE_DIR names another); where
    none of these can be written, or what is there is damaged, the function is compiled anew. It knows when the file
    changes, not when another one does: what is compiled along stands in the same file, or is numbered by
    `number_sources`.
    """
    try:
        return _compile(function, signature, without_lock, cached=True)
    except Exception:  # a damaged file of the cache fails in as many ways as it can be damaged
        return _compile(function, signature, without_lock, cached=False)


def number_sources(*modules: ModuleType) -> int:
    """Return a number, never 0, that is another one where the source of any of some modules is.

    A function that closes over it is compiled anew when one of them changes: numba's cache looks at what a function
    closes over, but not into other files than its own.
    """
    try:
        return zlib.crc32("".join(map(inspect.getsource, modules)).encode()) + 1
    except OSError:  # there are no sources that could change
        return 1


def _compile(
    function: Callable[_P, _R], signature: tuple[Any, ...], without_lock: bool, *, cached: bool
) -> Callable[_P, _R]:
    compiled = njit(**_HOW, nogil=without_lock)(function)
    if cached:
        compiled.enable_caching()
    compiled.compile(signature)
    compiled.disable_compile()  # an array of another layout is taken as it is, not compiled for
    whole: Callable[_P, _R] = compiled
    return whole
