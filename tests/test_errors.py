"""One failure, one line."""

from __future__ import annotations

import pickle

import pytest

from rsibr.errors import BakeError, CheckFailed, InputError, MachineError, RsibrError


def test_the_line_says_where_then_what_then_what_to_do():
    error = InputError("texel (3, 7) is NaN in channel G", where="city.exr", fix="repair the map")
    assert str(error) == "city.exr: texel (3, 7) is NaN in channel G. Repair the map"


def test_place_and_remedy_may_be_absent():
    assert str(RsibrError("no such preset")) == "no such preset"
    assert str(RsibrError("no such preset", fix="see the list")) == "no such preset. See the list"
    assert str(RsibrError("no such preset", where="material.preset")) == "material.preset: no such preset"


def test_line_breaks_and_runs_of_blanks_become_single_blanks():
    error = MachineError("the driver says:\n\n   no device\t found", fix="\n install one")
    assert "\n" not in str(error)
    assert str(error) == "the driver says: no device found. install one"


def test_the_remedy_keeps_its_own_capitals():
    assert str(RsibrError("x", fix="set RSIBR_DEVICE to llvm")).endswith("Set RSIBR_DEVICE to llvm")


@pytest.mark.parametrize(("kind", "code"), [(InputError, 2), (BakeError, 2), (CheckFailed, 1), (MachineError, 3)])
def test_each_kind_has_the_exit_code_that_the_command_line_promises(kind, code):
    with pytest.raises(RsibrError) as caught:
        raise kind("what", where="where", fix="fix")
    assert caught.value.exit_code == code
    assert (caught.value.what, caught.value.where, caught.value.fix) == ("what", "where", "fix")


def test_an_error_survives_its_way_to_another_process():
    """Process pools pickle what a worker raises."""
    error = BakeError("is missing", where="a.exr", fix="bake again")
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is BakeError
    assert str(found) == str(error)
