"""Completion in the shell: scripts by name, and what they are answered."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rsibr.cli.completion import complete_override
from rsibr.cli.method_names import listed_methods
from rsibr.methods.registry import method_names
from rsibr.scene.config import EffectsConfig
from rsibr.scene.presets import PRESETS

ROOT = Path(__file__).parents[2]
RSIBR = [sys.executable, "-c", "from rsibr.cli.app import main; main()"]


def test_names_read_from_the_source_are_those_of_the_registry():
    assert listed_methods() == method_names()


def test_presets_and_effects_are_complete():
    assert complete_override("material.preset=") == [f"material.preset={name}" for name in PRESETS]
    assert complete_override("effects.") == [f"effects.{name}=" for name in EffectsConfig.model_fields]
    for name in EffectsConfig.model_fields:
        assert {"auto", "off"} <= {one.partition("=")[2] for one in complete_override(f"effects.{name}=")}
    assert complete_override("effects.mirror=o") == ["effects.mirror=on", "effects.mirror=off"]
    assert complete_override("map.resolution=") == ["map.resolution=auto"]
    assert complete_override("nowhere.x=") == complete_override("nowhere") == []


@pytest.mark.parametrize("shell_name", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell_without_guessing(shell, shell_name):
    ended = shell("--show-completion", shell_name)
    assert ended.code == 0
    assert "_RSIBR_COMPLETE" in ended.stdout
    shell.refuses("--show-completion", says="--show-completion")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["recon"], ["reconstruct"]),
        (["reconstruct", "x", "--method", "cabral"], ["cabral1999", "cabral1999-mesh"]),
        (["bake", "c.toml", "--set", "material.pre"], ["material.preset="]),
        (["bake", "c.toml", "--set", "material.preset", "=", "cand"], ["candy-red"]),
        (["bake", "c.toml", "--set", "effects.mirror", "="], ["auto", "on", "off"]),
        (["bake", "c.toml", "--ver"], ["--verbose"]),
    ],
)
def test_bash_completes(tmp_path, words, expected):
    """As Bash does it: it takes `=` for a word of its own, and replaces what follows."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash")
    command = tmp_path / "rsibr"
    command.write_text(f"#!/bin/sh\nexec {sys.executable} -c 'from rsibr.cli.app import main; main()' \"$@\"\n")
    command.chmod(0o755)
    last = len(words) if words[-1] != "=" else len(words) + 1
    listed = " ".join(f"'{word}'" for word in ["rsibr", *words, *([""] if words[-1] == "=" else [])])
    script = (
        f'eval "$({command} --show-completion bash)"; COMP_WORDS=({listed}); COMP_CWORD={last}; '
        f'_rsibr_completion {command}; printf "%s\\n" "${{COMPREPLY[@]}}"'
    )
    settings = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([bash, "--norc", "-c", script], capture_output=True, text=True, env=settings, check=True)
    assert done.stdout.splitlines() == expected, done.stderr
