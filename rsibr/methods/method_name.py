"""Name of a method or a lookup with values of its options, as a user writes it: `NAME[,OPTION=VALUE]…`."""

from __future__ import annotations

import re
from typing import Any

from rsibr.errors import InputError
from rsibr.scene.overrides import apply_overrides

_NEXT_OPTION = re.compile(r",(?=\s*[A-Za-z_]\w*\s*=)")
"""Comma before an option; commas of a list in its value are not."""


def parse_name(text: str, kind: str = "method") -> tuple[str, dict[str, Any]]:
    """Parse a name and its options.

    Parameters
    ----------
    text : str
        `NAME`, or `NAME,OPTION=VALUE` with any number of options. Values are TOML; a bare word is a string.
    kind : str
        What it is the name of, for errors.

    Returns
    -------
    name : str
    options : dict
        Values by name of the option; empty if there are none.

    Raises
    ------
    InputError
        If a value is an unclosed string, list or table, or an option is given twice.

    Examples
    --------
    >>> parse_name("miller1984,exponent=100,lookup=nearest")
    ('miller1984', {'exponent': 100, 'lookup': 'nearest'})
    """
    name, *options = _NEXT_OPTION.split(text)
    keys = [option.partition("=")[0].strip() for option in options]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InputError(f"option {twice[0]} is given twice", where=f"{kind} {text}", fix="give it once")
    return name.strip(), apply_overrides({}, options)


def file_stem(name: str) -> str:
    """Form of a method's name for file names: an address or an option has characters that a file system may refuse.

    Examples
    --------
    >>> file_stem("my_package.grey:Grey,value=0.5")
    'my_package.grey_Grey_value_0.5'
    """
    return re.sub(r"[^\w.-]+", "_", name).strip("_")
