"""Interrupts: work that an interrupt shall not cut in two, and what to say of what it left.

An interrupt, such as Ctrl-C, is an exception that may arise between any two steps of a program.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType


@contextmanager
def noting(words: Callable[[], str]) -> Iterator[None]:
    """Add a note to whatever ends the block early: what is kept, and how to go on from it.

    The program prints the note when the user has stopped it. Of blocks within each other the
    innermost speaks.

    Args:
        words: Returns the note; called when the block has ended early.
    """
    try:
        yield
    except BaseException as error:
        if not notes(error):
            error.add_note(words())
        raise


def notes(error: BaseException | None) -> list[str]:
    """The notes on an exception, or else on the next of those that it arose from."""
    return next((each.__notes__ for each in chain(error) if hasattr(each, "__notes__")), [])


def chain(error: BaseException | None) -> Iterator[BaseException]:
    """An exception and all that it arose from, each once."""
    waiting, known = [error], set()
    while waiting:
        each = waiting.pop()
        if each is not None and id(each) not in known:
            known.add(id(each))
            waiting += [each.__context__, each.__cause__]
            yield each


@contextmanager
def whole() -> Iterator[None]:
    """Keep Ctrl-C back until the block is done, and from the processes that are started in it.

    A terminal sends Ctrl-C to all processes of a program. What starts others must not be stopped
    when half of them are there, and they are to be ended by the one that the user talks to. They
    inherit that the signal is blocked, from their very first moment.
    """
    from multiprocessing import resource_tracker
    from threading import current_thread, main_thread

    if current_thread() is not main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    came: list[int] = []

    def keep(number: int, where: "FrameType | None") -> None:
        came.append(number)

    # The one that Python starts for itself with the first unblocks the signal when it is there.
    resource_tracker.ensure_running()
    # Blocking alone is not enough: another thread of this process may be given the signal.
    before = signal.getsignal(signal.SIGINT)
    if callable(before):
        signal.signal(signal.SIGINT, keep)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        if callable(before):
            # Unblocking delivers what waited; it is to go to the same handler as the rest.
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            signal.signal(signal.SIGINT, before)
            if came:
                signal.raise_signal(signal.SIGINT)
        else:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
