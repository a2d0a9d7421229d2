"""The Python interface: five lines that read well, whatever was imported before."""

import subprocess
import sys

import pytest

import rsibr


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", rsibr.__all__)
def test_every_public_name_is_there(name):
    assert getattr(rsibr, name) is not None
    assert name in dir(rsibr)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="bakes"):
        _ = rsibr.bakes


@pytest.mark.parametrize(
    "before",
    ["pass", "from rsibr.store.bake import open_bake", "import rsibr.validation.metrics", "import rsibr; rsibr.check"],
)
def test_functions_can_be_called_whatever_was_imported_before(before):
    names = "rsibr.bake, rsibr.reconstruct, rsibr.validate, rsibr.check"
    assert run(f"{before}\nimport rsibr\nprint(all(map(callable, ({names}))))") == "True"


def test_a_room_called_is_its_function():
    code = "import rsibr.store.bake as s, rsibr\nfrom rsibr.errors import InputError\n"
    code += "try: rsibr.bake('nowhere.toml', out='x')\n"
    code += "except InputError as e: print('nowhere.toml' in str(e), s.open_bake is rsibr.open_bake)"
    assert run(code) == "True True"


def test_importing_rsibr_is_quick():
    """Neither Mitsuba nor matplotlib nor the command line is loaded until something asks for them."""
    heavy = {"mitsuba", "drjit", "matplotlib", "scipy", "typer", "pydantic"}
    assert run(f"import sys, rsibr\nprint(sorted({heavy!r} & set(sys.modules)))") == "[]"
