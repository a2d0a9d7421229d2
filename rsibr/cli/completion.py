"""Completion in the shell: names of methods, keys and values of `--set`, and the scripts that ask for them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from itertools import pairwise
from typing import get_args

from rsibr.cli.method_names import listed_methods

_ASKED = "_RSIBR_COMPLETE"
_NO_GUESSES = "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION"
_CUT_OFF = "_RSIBR_COMPLETE_CUT_OFF"


def by_name_of_the_shell() -> None:
    """Let `--install-completion` and `--show-completion` take the name of a shell instead of guessing it.

    Typer guesses by the names of the parent processes, which a container or a script that installs rsibr may not have.
    """
    os.environ.setdefault(_NO_GUESSES, "1")


def cut_words_of_bash() -> None:
    """Cut `KEY=` off the word that Bash asks to complete: it passes `KEY`, `=` and `VALUE`, and replaces the last."""
    if os.environ.get(_ASKED) != "complete_bash" or "COMP_WORDS" not in os.environ:
        return
    words, current = os.environ["COMP_WORDS"].split("\n"), int(os.environ.get("COMP_CWORD", "0"))
    joined = words[:1]
    for before, word in pairwise(words[: current + 1]):
        if "=" in (before, word):
            joined[-1] += word
        else:
            joined.append(word)
    if current in range(len(joined), len(words)):
        key, equals, joined[-1] = joined[-1].partition("=")
        os.environ[_CUT_OFF] = key + equals
        os.environ["COMP_WORDS"], os.environ["COMP_CWORD"] = "\n".join(joined), str(len(joined) - 1)


def complete_method(incomplete: str) -> list[str]:
    """Names of methods that begin as typed."""
    return [name for name in listed_methods() if name.startswith(incomplete)]


def complete_override(incomplete: str) -> list[str]:
    """Keys of the config that begin as typed, each with its `=`; after the `=` the values, where they are names."""
    cut_off = os.environ.get(_CUT_OFF, "")
    key, equals, _ = (typed := cut_off + incomplete).partition("=")
    known = [f"{key}={value}" for value in _values(key)] if equals else [f"{name}=" for name in _keys()]
    return [word.removeprefix(cut_off) for word in known if word.startswith(typed)]


def _keys() -> Iterator[str]:
    """Dotted keys of a config."""
    from rsibr.scene.config import Config

    for section, field in Config.model_fields.items():
        for model in (field.annotation, *get_args(field.annotation)):
            for name in getattr(model, "model_fields", ()):
                yield f"{section}.{name}"


def _values(key: str) -> tuple[str, ...]:
    """Values of a key, where they are names: presets, switches of effects, choices."""
    from rsibr.scene.config import Config

    if key == "material.preset":
        from rsibr.resources import scenes

        return tuple(sorted(path.stem for path in (scenes() / "materials").glob("*.xml")))
    section, _, name = key.partition(".")
    field = Config.model_fields.get(section)
    models = () if field is None else (field.annotation, *get_args(field.annotation))
    for model in models:
        found = getattr(model, "model_fields", {}).get(name)
        if found is not None:
            return tuple(re.findall(r"'([a-z_]+)'", str(found.annotation)))
    return ()
