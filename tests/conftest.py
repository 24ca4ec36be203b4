"""What all tests share: signals are as in a program that a user has started by hand."""

import signal

import pytest

# A shell without job control ignores Ctrl-C for what it starts in the background, and so do all
# programs that these start in turn.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM)


@pytest.fixture(autouse=True)
def handlers():
    """The program's own handlers of signals end with the test that called its main()."""
    before = {number: signal.getsignal(number) for number in ENDS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
