"""Interrupts: sections that Ctrl-C does not interrupt, and notes about what an interrupt leaves.

An interrupt, such as Ctrl-C, is an exception that may be raised between any two steps of a program.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType


@contextmanager
def noting(words: Callable[[], str]) -> Iterator[None]:
    """Add a note to any exception that ends the block: what is kept, and how to continue.

    The program prints the note when the user has stopped it. Of nested blocks the innermost one
    adds its note.

    Args:
        words: Returns the note; called when an exception ends the block.
    """
    try:
        yield
    except BaseException as error:
        if not notes(error):
            error.add_note(words())
        raise


def notes(error: BaseException | None) -> list[str]:
    """The notes of an exception, or else those of its nearest cause that has some."""
    return next((each.__notes__ for each in chain(error) if hasattr(each, "__notes__")), [])


def chain(error: BaseException | None) -> Iterator[BaseException]:
    """An exception and all its causes, each once."""
    waiting, known = [error], set()
    while waiting:
        each = waiting.pop()
        if each is not None and id(each) not in known:
            known.add(id(each))
            waiting += [each.__context__, each.__cause__]
            yield each


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C until the block is done, and block it in the processes that it starts.

    A terminal sends Ctrl-C to all processes of a program. Starting processes must not stop halfway,
    and their parent is to end them. They inherit the blocked signal from the start.
    """
    from multiprocessing import resource_tracker
    from threading import current_thread, main_thread

    if current_thread() is not main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    arrived: list[int] = []

    def note(number: int, where: "FrameType | None") -> None:
        arrived.append(number)

    # Python starts the resource tracker with the first process, which unblocks the signal.
    resource_tracker.ensure_running()
    # Blocking is not enough: another thread of this process may receive the signal.
    before = signal.getsignal(signal.SIGINT)
    if callable(before):
        signal.signal(signal.SIGINT, note)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        if callable(before):
            # Unblocking delivers a pending signal, which goes to the same handler.
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            signal.signal(signal.SIGINT, before)
            if arrived:
                signal.raise_signal(signal.SIGINT)
        else:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
