"""Classes of the commands: options that all commands share, and help texts that are never cut off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.core import TyperCommand, TyperGroup

from rsibr.cli.options import METHODS
from rsibr.cli.verbosity import verbosity_options

HELP_WIDTH = 110
"""Maximum width of a help text on a wide terminal, in characters."""

_WHOLE = 10_000  # characters, more than any summary has


class Command(TyperCommand):
    """A command with `--quiet` and `--verbose`; `METHODS` in a help text becomes the names of the methods."""

    def __init__(self, name: str | None, **given: Any) -> None:
        super().__init__(name, **given)
        self.params += verbosity_options()
        self.context_settings.setdefault("max_content_width", HELP_WIDTH)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options; names of methods are read only here, so that commands start without them."""
        for one in self._options_with_methods():
            from rsibr.cli.method_names import listed_methods

            one.help = one.help.replace(METHODS, ", ".join(listed_methods()))
        super().format_options(ctx, formatter)

    def _options_with_methods(self) -> Iterator[Any]:
        return (one for one in self.params if METHODS in (getattr(one, "help", None) or ""))


class Commands(TyperGroup):
    """The group of all commands: each with its whole summary, whatever the width."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.params += verbosity_options()
        self.context_settings.setdefault("max_content_width", HELP_WIDTH)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a line for each command, broken where it is too long, never cut off."""
        named = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [(name, one.get_short_help_str(_WHOLE)) for name, one in named if one is not None and not one.hidden]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)
