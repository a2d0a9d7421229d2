"""The Python interface: five lines that read well, whatever was imported before."""

import inspect
import pickle
import pkgutil
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


FUNCTIONS = ("bake", "check", "load_config", "open_bake", "plan", "publish", "reconstruct", "study", "validate")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_shows_its_own_signature_and_can_be_pickled(name):
    """Completion, `help` and process pools go by both."""
    function = getattr(rsibr, name)
    assert inspect.isfunction(function)
    assert "args" not in inspect.signature(function).parameters
    assert pickle.loads(pickle.dumps(function)) is function


def test_no_package_has_the_name_of_a_public_function():
    """Packages are nouns: importing one would bind its module over the function."""
    packages = {module.name for module in pkgutil.iter_modules(rsibr.__path__)}
    assert packages & set(rsibr.__all__) == set()


def test_importing_rsibr_is_quick():
    """Neither Mitsuba nor matplotlib nor the command line is loaded until something asks for them."""
    heavy = {"mitsuba", "drjit", "matplotlib", "scipy", "typer", "pydantic"}
    assert run(f"import sys, rsibr\nprint(sorted({heavy!r} & set(sys.modules)))") == "[]"
