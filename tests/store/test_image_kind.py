"""Kinds of image files, by name."""

import os

import pytest

from rsibr.errors import InputError
from rsibr.store.image_kind import image_kind


@pytest.mark.parametrize(("name", "kind"), [("a.exr", "exr"), ("a.PNG", "png"), ("a.b.png", "png")])
def test_the_ending_says_the_kind(name, kind):
    assert image_kind(name) == kind


@pytest.mark.parametrize("name", ["a", "a.jpg", ".exr", "a.exr~", "a.mp4"])
def test_what_is_no_kind_is_refused(name):
    with pytest.raises(InputError, match="ending") as refused:
        image_kind(name)
    assert refused.value.where == "out"


def test_further_kinds_of_a_caller():
    assert image_kind("a.mp4", ("mp4",)) == "mp4"


def test_a_pipe_takes_an_exr(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert image_kind(tmp_path / "pipe") == image_kind("/dev/null") == "exr"
