"""A cache of a method's results that ends with its object."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, ParamSpec, TypeVar, cast
from weakref import proxy

P = ParamSpec("P")
R = TypeVar("R")


def instance_cache(method: Callable[P, R], maxsize: int) -> Callable[P, R]:
    """A bound method that caches its latest results, for its object to hold.

    Unlike a cache of the bound method it does not hold the object, so both end with the last user,
    and nothing is left for the garbage collector, which would interrupt a control loop.
    """
    bound = cast(Any, method)
    without_object = partial(bound.__func__, proxy(bound.__self__))
    return cast(Callable[P, R], lru_cache(maxsize=maxsize)(without_object))
