"""Modules that register plugins in Python are imported in every variant, and found by other processes."""

from __future__ import annotations

import sys
import warnings

import mitsuba as mi
import pytest

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene import python_plugins, trial
from rsibr.scene.config import MaterialConfig, load_config, parse_config
from rsibr.scene.material import load_material
from rsibr.scene.python_plugins import load_plugins, registered_by_hand, sources_of
from tests.scene.python_plugin import write_plugin

SCENE = {"environment": {"emitter": {"type": "constant"}}, "material": {"preset": "matte-lambert"}}


@pytest.fixture(autouse=True)
def _modules(monkeypatch):
    """Forget the modules of a test at its end."""
    monkeypatch.setattr(python_plugins, "_modules", {})
    monkeypatch.setattr(backend, "_registrations", list(backend._registrations))
    monkeypatch.setattr(backend, "_registered", dict(backend._registered))


def test_a_module_is_imported_in_every_variant_that_is_set(tmp_path):
    path = write_plugin(tmp_path, "chalk", "chalk-every")
    load_plugins([str(path)])
    table = {"type": "chalk-every", "value": 0.25}
    coatings = [load_material(MaterialConfig(bsdf=table)).bsdf()]
    with backend.rendering("spectral"):
        coatings.append(mi.load_dict(table))
    coatings.append(mi.load_dict(table))
    assert [str(coating) for coating in coatings] == ["Chalk[0.25]"] * 3
    assert type(coatings[0]) is type(coatings[2]) is not type(coatings[1])
    assert sources_of(["chalk-every", "diffuse"]) == [path]
    assert sources_of(["diffuse"]) == []


def test_a_module_by_name_stays_the_users_own(tmp_path, monkeypatch):
    """A package is run afresh with its submodules; who imported it before keeps what they have."""
    package = tmp_path / "chalks_pkg"
    package.mkdir()
    (package / "__init__.py").write_text("from . import white\n")
    write_plugin(package, "white", "chalk-named")
    monkeypatch.syspath_prepend(tmp_path)
    import chalks_pkg

    own = chalks_pkg.white
    load_plugins(["chalks_pkg"])
    with backend.rendering("spectral"):
        assert str(mi.load_dict({"type": "chalk-named"})) == "Chalk[0.5]"
    assert sys.modules["chalks_pkg"] is chalks_pkg
    assert sys.modules["chalks_pkg.white"] is chalks_pkg.white is own
    assert {path.name for path in sources_of(["chalk-named"])} == {"__init__.py", "white.py"}


def test_a_module_is_imported_again_where_its_file_has_changed(tmp_path):
    path = write_plugin(tmp_path, "chalk", "chalk-edited")
    config = MaterialConfig(bsdf={"type": "chalk-edited"})
    load_plugins([str(path)])
    before = load_material(config)
    load_plugins([str(path)])
    assert load_material(config).digest == before.digest
    path.write_text(path.read_text().replace("Chalk[", "Slate["))
    load_plugins([str(path)])
    after = load_material(config)
    assert str(after.bsdf()) == "Slate[0.5]"
    assert after.digest != before.digest  # validation refuses a bake whose plugin has changed since
    with backend.rendering("spectral"):
        assert str(mi.load_dict({"type": "chalk-edited"})) == "Slate[0.5]"


def test_a_plugin_in_python_can_be_nested(tmp_path):
    load_plugins([str(write_plugin(tmp_path, "chalk", "chalk-nested"))])
    twosided = {"type": "twosided", "inner": {"type": "chalk-nested"}}
    assert "Chalk[0.5]" in str(load_material(MaterialConfig(bsdf=twosided)).bsdf())
    xml = tmp_path / "twosided.xml"
    xml.write_text('<bsdf version="3.0.0" type="twosided"><bsdf type="chalk-nested"/></bsdf>')
    assert "Chalk[0.5]" in str(load_material(MaterialConfig(file=xml)).bsdf())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "import mitsuba\n\n1 / 0\n",
            r"cannot be imported \(bad.py, line 3\): ZeroDivisionError: .*Correct the module",
        ),
        ("import no_such_thing\n", r"cannot be imported \(bad.py, line 1\): ModuleNotFoundError: .*no_such_thing"),
        ("def f(:\n", r"cannot be imported \(bad.py, line 1\): SyntaxError"),
        ("raise SystemExit(3)\n", r"cannot be imported .*SystemExit: 3"),
        ("x = 1\n", r"registers no plugin .*Have it call mi.register_bsdf"),
    ],
)
def test_a_module_that_is_no_use_is_one_clear_line(text, says, tmp_path):
    path = tmp_path / "bad.py"
    path.write_text(text)
    users, place = mi.register_bsdf, list(sys.path)
    with pytest.raises(InputError, match=says) as caught:
        load_plugins([str(path)])
    assert caught.value.where == "plugins.modules"
    assert len(str(caught.value).splitlines()) == 1
    assert mi.register_bsdf is users
    assert sys.path == place
    backend.use()  # what could not be loaded is not tried again


def test_a_module_that_is_not_there_says_how_to_name_it(tmp_path):
    with pytest.raises(
        InputError, match=r"no module 'no_such.plugins' .*\"plugins.py\", or put its folder on PYTHONPATH"
    ):
        load_plugins(["no_such.plugins"])
    with pytest.raises(InputError, match=r"--import: there is no file .*absent.py"):
        load_plugins([str(tmp_path / "absent.py")], where="--import")


def test_the_config_names_modules_and_keeps_them(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        '[environment]\nemitter = {type = "constant"}\n[material]\npreset = "matte-lambert"\n'
        '[plugins]\nmodules = ["my_plugins.coats", "chalk.py"]\n'
    )
    config = load_config(path)
    assert config.plugin_modules == ("my_plugins.coats", str(tmp_path / "chalk.py"))
    assert parse_config(config.to_dict(), tmp_path / "elsewhere") == config
    more = config.with_plugins(["other", "my_plugins.coats"])
    assert more.plugin_modules == (*config.plugin_modules, "other")
    plain = parse_config(SCENE, tmp_path)
    assert "plugins" not in plain.to_dict()  # as in every manifest so far
    assert plain.with_plugins(()) is plain
    for wrong in ("my plugins", "a/b", "", 3):
        with pytest.raises(InputError, match=r"plugins.modules.* should be the name of a module"):
            parse_config({**SCENE, "plugins": {"modules": [wrong]}}, tmp_path)


def test_a_plugin_registered_by_hand_is_loaded_with_a_warning(monkeypatch, tmp_path):
    monkeypatch.delenv(trial.IN_TRIAL)
    monkeypatch.setattr(trial, "_run_child", lambda *_: pytest.fail("it cannot see the plugin"))
    config = MaterialConfig(bsdf={"type": "twosided", "inner": {"type": "chalk-by-hand"}})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=r'"chalk-by-hand" not found.*plugins.modules, or with --import'):
            load_material(config)
    exec(compile(write_plugin(tmp_path, "chalk", "chalk-by-hand").read_text(), "cell", "exec"), {})
    with pytest.warns(UserWarning, match=r"without a trial.*'chalk-by-hand': registered in this process only") as seen:
        load_material(config)
    assert len(seen) == 1
    assert registered_by_hand(["diffuse", "rgb", "rsibr_car_paint"]) == []


def test_the_trial_finds_the_plugins_of_modules(monkeypatch, tmp_path):
    """And a crash in one of them ends the trial, not this process."""
    monkeypatch.delenv(trial.IN_TRIAL)
    monkeypatch.setattr(trial, "_survived", set())
    crash = "import os\nChalk.eval = lambda *_: os.abort()\n"
    write_plugin(tmp_path, "chalks_trial", "chalk-sound")
    monkeypatch.syspath_prepend(tmp_path)  # where the child looks too
    load_plugins(["chalks_trial", str(write_plugin(tmp_path, "crash", "chalk-crash", crash))])
    codes, real = [], trial._run_child
    monkeypatch.setattr(trial, "_run_child", lambda *given: codes.append(real(*given)) or codes[-1])
    load_material(MaterialConfig(bsdf={"type": "chalk-sound"}))
    with pytest.raises(InputError, match=r"crashed \(SIGABRT\)"):
        load_material(MaterialConfig(bsdf={"type": "chalk-crash"}))
    assert codes == [0, -6]
