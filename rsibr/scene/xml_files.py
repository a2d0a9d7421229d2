"""Files that a Mitsuba XML file names, found and checked before Mitsuba reads any of them.

One rule: a relative name starts at a folder named by `<path>`, the last one first, or at the folder of the XML file
that the config names; included files name theirs by the same folders. The working folder plays no part. A file that is
not what it should be is named with its line, never quoted: it may be any file of the machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from rsibr.errors import InputError
from rsibr.scene.spectrum_file import read_spectrum

if TYPE_CHECKING:
    import mitsuba as mi

_DEEPEST = 15
"""Depth of includes, as in Mitsuba."""

_FIX = "name it relative to the XML file"


@dataclass
class XmlFiles:
    """An XML file with the files that it names.

    Attributes
    ----------
    folders : list of Path
        Folders at which relative names start, the first one first.
    documents : list of (Path, Element)
        The file itself and all that it includes, in the order in which Mitsuba reads them.
    within : tuple of str
        Elements whose files count: those of other elements, and those of emitters, are not looked for.
    spectra, data : list of Path
        Spectra, and other files named inside these elements; each exists.
    """

    folders: list[Path]
    within: tuple[str, ...] = ("bsdf",)
    documents: list[tuple[Path, ElementTree.Element]] = field(default_factory=list)
    spectra: list[Path] = field(default_factory=list)
    data: list[Path] = field(default_factory=list)
    _defaults: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, xml: Path, where: str, within: tuple[str, ...] = ("bsdf",)) -> XmlFiles:
        """Parse a file and its includes, and find the files that they name.

        Raises
        ------
        InputError
            If a file does not exist, is no regular file, is not well-formed XML, or is no spectrum where one is named.
        """
        files = cls([xml.resolve().parent], within)
        try:
            files._read(xml, where, 0)
        except OSError as error:  # a name that the system cannot hold
            raise InputError(f"names a file that cannot be looked for: {error.strerror}", where=where) from None
        for spectrum in files.spectra:
            read_spectrum(spectrum, where)
        return files

    @property
    def types(self) -> set[str]:
        """Types of all plugins."""
        return {name for _, root in self.documents for element in root.iter() if (name := element.get("type"))}

    def resolver(self) -> mi.FileResolver:
        """Resolver by which Mitsuba finds the same files, and those that it brings along."""
        import mitsuba as mi  # noqa: PLC0415  # files are checked without it, a thousand materials in a moment

        resolver = mi.FileResolver()
        resolver.clear()
        for folder in (*self.folders, mitsuba_folder()):
            resolver.append(str(folder))
        return resolver

    def _read(self, xml: Path, where: str, depth: int) -> None:
        if depth > _DEEPEST:
            raise InputError(f"includes files more than {_DEEPEST} deep", where=where, fix="does one include itself?")
        root = _parsed(xml, where)
        self.documents.append((xml, root))
        for element, is_inside in _walk(root, root.tag in self.within, self.within):
            match element.tag:
                case "default":
                    self._defaults.setdefault(element.get("name", ""), element.get("value", ""))
                case "path":
                    self._add_folder(self._filled(element.get("value", "")), where)
                case "include" if name := element.get("filename"):
                    self._read(self._found(name, where), where, depth + 1)
                case "spectrum" if name := element.get("filename"):
                    self.spectra.append(self._found(name, where))
                case "string" if element.get("name") == "filename" and is_inside:
                    self.data.append(self._found(element.get("value", ""), where))

    def _add_folder(self, name: str, where: str) -> None:
        folder = next((path for path in self._candidates(name) if path.is_dir()), None)
        if folder is None:
            raise InputError(f"<path>: there is no folder '{name}'", where=where, fix=_FIX)
        self.folders.insert(0, folder)

    def _found(self, name: str, where: str) -> Path:
        name = self._filled(name)
        found = next((path for path in self._candidates(name) if path.exists()), None)
        if found is None:
            raise InputError(f"there is no file '{name}'", where=where, fix=_FIX)
        if not found.is_file():
            raise InputError(f"'{name}' is no regular file", where=where, fix="name a file")
        return found

    def _candidates(self, name: str) -> Iterator[Path]:
        return (folder / name for folder in (*self.folders, mitsuba_folder()))

    def _filled(self, name: str) -> str:
        """Put the values of `<default>` in place of `$name`, longest names first, as Mitsuba does."""
        for key in sorted(self._defaults, key=len, reverse=True):
            name = name.replace(f"${key}", self._defaults[key])
        return name


@cache
def mitsuba_folder() -> Path:
    """Folder of the files that Mitsuba brings along; it is not imported to tell."""
    found = find_spec("mitsuba")
    return Path(found.origin if found and found.origin else ".").parent


def _walk(
    element: ElementTree.Element, is_inside: bool, within: tuple[str, ...]
) -> Iterator[tuple[ElementTree.Element, bool]]:
    """All elements below one in document order, each with whether its files count."""
    for child in element:
        inside = (is_inside or child.tag in within) and child.tag != "emitter"
        yield child, inside
        yield from _walk(child, inside, within)


def _parsed(xml: Path, where: str) -> ElementTree.Element:
    name = "is" if str(xml) == where else f"names {xml}, which is"
    try:
        return ElementTree.parse(xml).getroot()
    except ElementTree.ParseError as error:  # whose message may quote the file
        line, column = error.position
        raise InputError(f"{name} not well-formed XML (line {line}, col {column + 1})", where=where) from None
    except (ValueError, LookupError, RecursionError):
        raise InputError(f"{name} not well-formed XML: unknown encoding, or nested too deeply", where=where) from None
    except OSError as error:
        raise InputError(f"{name} not readable: {error.strerror}", where=where) from None
