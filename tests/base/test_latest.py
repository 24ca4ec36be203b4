"""The newest values, and when they are made again."""

import pytest

from lrf3d.base.latest import Latest


def test_a_value_is_made_again_only_for_another_key():
    latest = Latest()
    values = [latest.of((1, "map"), list), latest.of((1, "map"), list), latest.of(2, list)]
    assert values[0] is values[1] is not values[2]
    assert latest.of((1, "map"), list) is not values[0]


def test_the_values_asked_for_last_are_kept():
    # Objects without an equality of their own are keys by identity.
    latest = Latest(size=2)
    keys = [object() for _ in range(3)]
    first, second = (latest.of(key, object) for key in keys[:2])
    assert latest.of(keys[0], object) is first
    latest.of(keys[2], object)
    assert latest.of(keys[0], object) is first
    assert latest.of(keys[1], object) is not second


def test_a_value_of_none_is_kept_and_an_error_is_not():
    latest = Latest()
    assert latest.of("nothing", lambda: None) is None
    assert latest.of("nothing", list) is None
    with pytest.raises(ZeroDivisionError):
        latest.of("error", lambda: 1 / 0)
    assert latest.of("error", list) == []
