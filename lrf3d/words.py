"""Words: numbers as people read them."""


def counted(number: int, noun: str) -> str:
    """A number of things, with its noun in the singular or the plural: ``1,238 walls``."""
    return f"{number:,} {noun}" + ("" if number == 1 else "s")


def rounded(value: float, digits: int) -> str:
    """A number with a fixed number of decimals, and never −0."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"
