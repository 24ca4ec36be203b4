"""Waiting for a state, however slow the machine is."""

import time

# After this time [s] what has not come will not come.
PATIENCE = 300.0


def until(is_so):
    """Wait until something is so, and give what it gave."""
    end = time.monotonic() + PATIENCE
    while (answer := is_so()) is None or answer is False:
        assert time.monotonic() < end, "it never came to be so"
        time.sleep(0.01)
    return answer
