"""Damaged world files end in one clear error that names the file and what is wrong in it."""

import re

import damaged_worlds
import pytest

from lrf3d import WorldError, load_world

DAMAGED = dict(damaged_worlds.damaged())


def write(folder, files):
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder / next(iter(files))


def refusal(path):
    with pytest.raises(WorldError) as caught:
        load_world(path)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(str(path)) and len(message) < 500
    return message


@pytest.mark.parametrize("kind", damaged_worlds.valid())
def test_what_is_damaged_here_is_a_world_when_whole(kind, tmp_path):
    assert len(load_world(write(tmp_path, damaged_worlds.valid()[kind])).segments) > 2


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_read_or_refused_in_one_line(name, tmp_path):
    path = write(tmp_path, DAMAGED[name])
    try:
        assert len(load_world(path).segments) > 0
    except WorldError:
        refusal(path)


@pytest.mark.parametrize("name", damaged_worlds.REFUSED)
def test_an_invalid_file_is_refused_with_the_reason(name, tmp_path):
    data, said = damaged_worlds.REFUSED[name]
    path = write(tmp_path, {name: data if isinstance(data, bytes) else data.encode()})
    assert re.search(said, refusal(path))


@pytest.mark.parametrize("line", damaged_worlds.MAPS)
def test_an_invalid_description_of_a_map_is_refused_with_the_reason(line, tmp_path):
    key = line.partition(":")[0]
    kept = [row for row in damaged_worlds.YAML.splitlines() if not row.startswith(f"{key}:")]
    files = {"a.yaml": "\n".join([*kept, line]).encode(), "map.png": damaged_worlds.picture("PNG")}
    assert damaged_worlds.MAPS[line] in refusal(write(tmp_path, files))


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        (b"P5\n99999999 99999999\n255\n", "cells, more than|not a PGM"),
        (b"P5\nwide high\n255\n", "not a PGM"),
        (b"GIF89a\1\0\1\0\0\0\0;", "not a PGM"),
        (b"P5\n2 2\n255\n\xff\xff\xff\xff", "no wall"),
    ],
)
def test_a_picture_that_is_no_map_is_refused(picture, said, tmp_path):
    files = {"a.yaml": damaged_worlds.YAML.encode(), "map.png": picture}
    assert re.search(said, refusal(write(tmp_path, files)))
