"""Ctrl-C in long work: it ends the piece under way, and keeps all pieces that are done; SIGTERM, where it is alike."""

import signal
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager, nullcontext
from threading import current_thread, main_thread
from types import FrameType
from typing import Any, TypeVar

Piece = TypeVar("Piece")
SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Whether Ctrl-C has ended a run. One object serves all loops of a run: once it is noted, all of them are over."""

    def __init__(self) -> None:
        self.noted = False
        self._working = False

    def pieces(self, source: Iterable[Piece]) -> Iterator[Piece]:
        """The pieces of a source until Ctrl-C, or another signal that raises KeyboardInterrupt.

        The signal interrupts the source while it computes a piece, which is lost. It never interrupts what the caller
        does with a piece, such as writing it."""
        iterator: Any = iter(source)
        with self._handling(), closing(iterator) if hasattr(iterator, "close") else nullcontext():
            while not self.noted:
                try:
                    self._working = True
                    piece = next(iterator)
                    self._working = False
                except StopIteration:
                    return
                except KeyboardInterrupt:
                    self.noted = True
                    return
                except Exception:
                    if self._is_over():  # of the same signal, such as the end of a worker which got it too
                        return
                    raise
                finally:
                    self._working = False
                yield piece

    def _is_over(self) -> bool:
        return self.noted

    @contextmanager
    def _handling(self) -> Iterator[None]:
        if current_thread() is not main_thread():  # which alone handles signals
            yield
            return
        taken = [number for number in SIGNALS if signal.getsignal(number) is signal.default_int_handler]
        try:
            for number in taken:
                signal.signal(number, self._note)
            yield
        finally:
            for number in taken:
                signal.signal(number, signal.default_int_handler)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self.noted = True
        if self._working:
            raise KeyboardInterrupt
