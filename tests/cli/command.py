"""Runs the command line in this process, as a user's shell would start it."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from rsibr.cli.app import main

CONFIG = """
[environment]
emitter = {type = "constant", radiance = 0.5}
[material]
preset = "matte-lambert"
[map]
resolution = 8
[sampling]
samples = 16
[effects]
view_dependence = "on"
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code, and what it wrote."""

    code: int
    stdout: str
    stderr: str

    @property
    def json(self) -> dict[str, Any]:
        """The one object on stdout."""
        found: dict[str, Any] = json.loads(self.stdout)
        return found


class Shell:
    """Runs `rsibr` with arguments, and catches what it writes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch, self._capsys = monkeypatch, capsys

    def __call__(self, *arguments: object) -> Ended:
        self._monkeypatch.setattr(sys, "argv", ["rsibr", *map(str, arguments)])
        self._capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        return Ended(int(ended.value.code or 0), *self._capsys.readouterr())

    def refuses(self, *arguments: object, code: int = 2, says: str = "") -> Ended:
        """Run a command that must fail: one clear line on stderr, and with `--json` one object on stdout."""
        ended = self(*arguments)
        assert ended.code == code, ended
        lines = [line for line in ended.stderr.splitlines() if line.startswith("error: ")]
        assert len(lines) == 1, ended.stderr
        assert ended.stderr.strip().splitlines()[-1] == lines[0]
        assert "Traceback" not in ended.stderr
        assert says in lines[0]
        if "--json" in arguments:
            assert set(ended.json) == {"error"}
            assert ended.json["error"]["exit_code"] == code
        else:
            assert ended.stdout == ""
        return ended


def write_config(folder: Path, text: str = CONFIG) -> Path:
    """Write a config, by default a small whole one."""
    path = folder / "config.toml"
    path.write_text(text)
    return path
