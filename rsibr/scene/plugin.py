"""Mitsuba plugins as plain data: errors, named files and digests, for environments and materials."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rsibr.errors import InputError
from rsibr.regular_file import is_file

_REWRITES = (
    (  # an included file, which may be any file of the machine: named, not quoted
        r"while processing <include>:.*Error while loading (XML file )?"
        r"\"?(?P<file>[^\s\"]+)\"?(?P<line> \(line[^)]*\))?:.*",
        r"includes \g<file>, which Mitsuba does not read\g<line>",
    ),
    (r"\[\w+\.(cpp|h):\d+\]\s*", ""),  # location in Mitsuba's sources
    (
        r"^(At|(Error )?[Ww]hile loading) (dictionary node \"[^\"]*\"|.*?(?= \(line ))(?P<line> \(line[^)]*\))?:\s*",
        r"\g<line> ",
    ),
    (r"^(Parsing of|Error while loading) XML file \"[^\"]*\"( failed)?:\s*", ""),
    (r"^\"[^\"]*\":\s*", ""),  # the file, which `where` names
    (r"failed to instantiate \w+ plugin of type (\"[^\"]*\"):", r"\1:"),
    (r"\[[A-Z]\w+\]\s*", ""),  # the class that raised it
    (r"Traceback \(most recent call last\):.*?(?=\b\w*Error: )\w*Error: ", ""),  # of a plugin of rsibr
    (r"rsibr_blendbsdf", "blendbsdf"),  # rsibr's own in its place
    (r"^std::bad_alloc$", "it does not fit into the memory"),
)
_VECTOR_FOR_COLOUR = "got vector"
_OWN_PLUGIN = '"rsibr_'  # its errors include the fix
_UNKNOWN_PLUGIN = re.compile(r'Plugin ".*" not found')


@contextmanager
def mitsuba_errors(where: str, fix: str) -> Iterator[None]:
    """Convert errors that Mitsuba raises inside the block to an `InputError` of one line.

    Parameters
    ----------
    where, fix : str
        As in `InputError`.
    """
    try:
        yield
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        sentence = essential_sentence(str(error) or type(error).__name__)
        if _OWN_PLUGIN in sentence:
            fix = ""
        if _UNKNOWN_PLUGIN.search(sentence):
            fix = f"{fix}; a plugin in Python: name the module that registers it in plugins.modules, or with --import"
        if _VECTOR_FOR_COLOUR in sentence:
            fix = "write a colour as {type = 'rgb', value = [r, g, b]}"
        raise InputError(sentence, where=where, fix=fix) from None


def essential_sentence(message: str) -> str:
    """Extract the informative sentence of a Mitsuba error message.

    Examples
    --------
    >>> essential_sentence('[a.cpp:1] At dictionary node "e": failed to instantiate bsdf plugin of type "x": [Mix] No')
    '"x": No'
    """
    text = " ".join(message.split())
    for pattern, replacement in _REWRITES:
        text = re.sub(pattern, replacement, text).strip()
    sentence: str = re.split(r"(?<!e\.g)\. ", text)[0]
    return sentence.rstrip(" .!")


def named_files(plugin: Mapping[str, Any]) -> list[Path]:
    """Return the files named under the key `filename` in a plugin and its nested plugins."""
    files: list[Path] = []
    for key, value in plugin.items():
        if isinstance(value, Mapping):
            files += named_files(value)
        elif key == "filename":
            files.append(Path(value))
    return files


def named_types(plugin: Mapping[str, Any]) -> set[str]:
    """Return the types of a plugin and its nested plugins."""
    nested = [named_types(value) for value in plugin.values() if isinstance(value, Mapping)]
    return {str(plugin["type"])}.union(*nested) if "type" in plugin else set().union(*nested)


def require_files(plugin: Mapping[str, Any], where: str) -> None:
    """Raise an `InputError` that names the first missing file of a plugin."""
    for file in named_files(plugin):
        if not is_file(file):
            raise InputError(f"there is no file {file}", where=where, fix="check the path under filename")


def content_digest(text: str, files: Iterable[Path] = (), data: bytes = b"") -> str:
    """SHA-256 of a description, the contents of files, and raw data, in hexadecimal.

    It is independent of file names: a scene that was moved keeps its digest.
    """
    digest = hashlib.sha256(text.encode())
    for file in files:
        with file.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    digest.update(data)
    return digest.hexdigest()


def canonical_json(plugin: Mapping[str, Any]) -> str:
    """JSON text of a plugin without the names of its files.

    The order of the keys is kept, because Mitsuba identifies nested plugins by position.
    """

    def without_names(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: "" if key == "filename" else without_names(item) for key, item in value.items()}
        return value

    return json.dumps(without_names(plugin), allow_nan=False)
