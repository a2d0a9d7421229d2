"""A crash or a hang inside Mitsuba ends as an error, in this process and not with it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rsibr.errors import InputError
from rsibr.scene import interpreter, trial, trial_child
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

PYTHON = sys.executable

# Runs in the child before anything else: without the check that Mitsuba does not survive the lack of.
UNGUARDED = "import rsibr.scene.mitsuba_bsdf as module\nmodule.NESTED = {}\n"


@pytest.fixture(autouse=True)
def _with_trials(monkeypatch):
    monkeypatch.delenv(trial.IN_TRIAL)
    monkeypatch.setattr(trial, "_survived", set())


def test_a_plugin_that_segfaults_is_the_users_mistake(tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(UNGUARDED)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for config in (MaterialConfig(bsdf={"type": "blendbsdf"}), MaterialConfig(file=_blend_xml(tmp_path))):
        with pytest.raises(InputError, match=r"crashed \(SIG[A-Z]+\) while loading it"):
            load_material(config)


def test_many_materials_are_tried_in_one_process_and_a_crash_costs_one_more(tmp_path, monkeypatch):
    """What survives is not tried again; what crashes is, and is told as ever."""
    (tmp_path / "sitecustomize.py").write_text(UNGUARDED)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    good = [MaterialConfig(bsdf={"type": "diffuse", "reflectance": value}) for value in (0.1, 0.2, 0.3, 0.4)]
    crash, refused = MaterialConfig(bsdf={"type": "blendbsdf"}), MaterialConfig(bsdf={"type": "diffuse", "nonsense": 1})
    children, real = [], subprocess.run
    monkeypatch.setattr(
        trial.subprocess, "run", lambda *given, **options: children.append(0) or real(*given, **options)
    )
    tried = []
    trial.try_together([good[0], refused, good[1], crash, *good[2:]], tried.append)
    assert (len(children), tried) == (2, [4, 6])
    assert [trial.require_survival(one, "here") for one in (*good, refused)] == [""] * 5
    assert len(children) == 2
    with pytest.raises(InputError, match="crashed"):
        trial.require_survival(crash, "here")


def _blend_xml(folder):
    path = folder / "blend.xml"
    path.write_text('<bsdf version="3.0.0" type="blendbsdf"/>')
    return path


def _child(monkeypatch, code):
    real, begin = subprocess.run, f"print({trial.BEGUN!r}, flush=True)\n"
    monkeypatch.setattr(
        trial.subprocess, "run", lambda _, **options: real([sys.executable, "-c", begin + code], **options)
    )


def test_an_emitter_that_kills_its_process_is_named(monkeypatch):
    _child(monkeypatch, "import os; os.abort()")
    with pytest.raises(InputError, match=r"^environment.emitter: Mitsuba crashed \(SIGABRT\)"):
        load_environment(EnvironmentConfig(emitter={"type": "constant"}))


def test_a_plugin_that_hangs_is_given_up(monkeypatch):
    _child(monkeypatch, "import time; time.sleep(60)")
    with pytest.raises(InputError, match="did not load it within"):
        trial.require_survival(MaterialConfig(bsdf={"type": "diffuse"}), "material.bsdf", timeout=0.2)


def _program(path, text):
    path.write_text(text)
    path.chmod(0o755)
    return str(path)


@pytest.fixture
def _nowhere_else(monkeypatch):
    """Let no interpreter be found but those that a test names."""
    for name in ("executable", "_base_executable"):
        monkeypatch.setattr(sys, name, "")
    for name in ("exec_prefix", "base_exec_prefix"):
        monkeypatch.setattr(sys, name, "/nonexistent")
    monkeypatch.setattr(interpreter, "get_executable", lambda: None)
    monkeypatch.delenv(interpreter.OVERRIDE, raising=False)


@pytest.mark.parametrize("name", ["blender", "python", "python3.99"])
def test_a_sys_executable_that_is_no_python_is_passed_over(name, tmp_path, monkeypatch):
    """A program of another name is not even started: a frozen application would start itself once more."""
    started = tmp_path / "started"
    fake = _program(tmp_path / name, f"#!/bin/sh\ntouch {started}\nexit 3\n")
    monkeypatch.setattr(sys, "executable", fake)
    monkeypatch.setattr(interpreter, "get_executable", fake.encode)
    code = trial._run_child('{"material": {"bsdf": {"type": "diffuse"}}}', "here")
    assert code == 0
    assert started.exists() == (name != "blender")


@pytest.mark.usefixtures("_nowhere_else")
def test_without_an_interpreter_there_is_no_trial_and_a_warning(tmp_path, monkeypatch):
    assert list(interpreter.interpreters()) == []
    with pytest.warns(UserWarning, match=r"without a trial.*no Python interpreter was found .*RSIBR_PYTHON"):
        load_material(MaterialConfig(bsdf={"type": "diffuse"}))
    monkeypatch.setattr(sys, "executable", _program(tmp_path / "python3", "no program at all"))
    with pytest.warns(UserWarning, match="without a trial"):
        load_material(MaterialConfig(bsdf={"type": "diffuse"}))


@pytest.mark.usefixtures("_nowhere_else")
def test_the_interpreter_can_be_named(tmp_path, monkeypatch):
    monkeypatch.setenv(interpreter.OVERRIDE, PYTHON)
    assert list(interpreter.interpreters()) == [PYTHON]
    monkeypatch.setenv(interpreter.OVERRIDE, str(tmp_path / "absent"))
    with pytest.raises(InputError, match=r"^RSIBR_PYTHON: there is no file"):
        load_material(MaterialConfig(bsdf={"type": "diffuse"}))
    monkeypatch.setenv(interpreter.OVERRIDE, _program(tmp_path / "other", "#!/bin/sh\nexit 0\n"))
    with pytest.raises(InputError, match=r"^RSIBR_PYTHON: .* cannot run rsibr"):
        load_material(MaterialConfig(bsdf={"type": "diffuse"}))


def test_what_survived_is_not_tried_again(monkeypatch):
    tried = []

    def count(document, *_):
        tried.append(document)
        return 0

    monkeypatch.setattr(trial, "_run_child", count)
    for reflectance in (0.5, 0.5, 0.6):
        load_material(MaterialConfig(bsdf={"type": "diffuse", "reflectance": reflectance}))
    load_material(MaterialConfig(preset="matte-lambert"))
    assert len(tried) == 2


def test_a_trial_loads_samples_and_leaves_complaints_to_mitsuba():
    load_material(MaterialConfig(bsdf={"type": "roughconductor", "alpha": 0.2}))
    with pytest.raises(InputError, match="not found"):
        load_material(MaterialConfig(bsdf={"type": "no-such-plugin"}))


def test_the_loader_that_is_tried_is_the_one_in_use():
    trial_child.try_section({"material": {"bsdf": {"type": "diffuse"}}})
    with pytest.raises(InputError, match="no emitter at infinity"):
        trial_child.try_section({"environment": {"emitter": {"type": "point"}}})
