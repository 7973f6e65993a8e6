"""Memory that an object holds: the sum of the sizes of all objects that only it reaches."""

from __future__ import annotations

import gc
import sys
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

_SHARED = (type, ModuleType, BuiltinFunctionType)


def size_of(thing: Any) -> int:
    """Bytes of a thing and of all that it refers to, but for modules and classes."""
    seen: set[int] = set()
    waiting = [thing]
    size = 0
    while waiting:
        here = waiting.pop()
        if id(here) in seen or isinstance(here, _SHARED):
            continue
        seen.add(id(here))
        size += sys.getsizeof(here)
        if isinstance(here, FunctionType):
            waiting += [cell.cell_contents for cell in here.__closure__ or ()]
        else:
            waiting += gc.get_referents(here)
    return size
