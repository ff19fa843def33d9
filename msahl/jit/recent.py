"""A small store of results that were computed last, for all threads of a process."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Recent(Generic[Value]):
    """The last results by their keys, at most ``most`` of them; the oldest one is dropped first."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._known: OrderedDict[Hashable, Value] = OrderedDict()
        self._lock = Lock()

    def get(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return the result of this ``key``; ``compute`` it if it is not known.

        Two threads may compute the same result at once; both then go on with the first one.
        """
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        value = compute()
        with self._lock:
            value = self._known.setdefault(key, value)
            if len(self._known) > self.most:
                self._known.popitem(last=False)
        return value
