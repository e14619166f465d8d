from __future__ import annotations

import random
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any


class Shuffled(Executor):
    """Runs the waiting tasks in a random order."""

    def __init__(self, seed: int = 0) -> None:
        self.most_waiting = 0
        self._random = random.Random(seed)
        self._lock = threading.Lock()
        self._waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        with self._lock:
            self._waiting.append((future, lambda: fn(*args, **kwargs)))
            self.most_waiting = max(self.most_waiting, len(self._waiting))
        threading.Thread(target=self._one).start()
        return future

    def _one(self) -> None:
        with self._lock:
            future, work = self._waiting.pop(self._random.randrange(len(self._waiting)))
        if future.set_running_or_notify_cancel():
            future.set_result(work())
