"""Opening and reading of a complete bake; `BakeWriter` writes one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rsibr.errors import BakeError
from rsibr.late import late
from rsibr.light.radiance import Light
from rsibr.store.atomic import checksum, read_bytes, unreadable
from rsibr.store.consistency import BAKE_ANEW, check_manifest
from rsibr.store.described_maps import DescribedMaps
from rsibr.store.directory import BAKE_AGAIN
from rsibr.store.integrity import altered, check_file, check_map
from rsibr.store.light_file import decode_light, is_negative
from rsibr.store.manifest import LIGHT_NAME, MANIFEST_NAME, Manifest, read_manifest
from rsibr.store.map_file import MapFile, decode_map
from rsibr.store.map_header import MapHeader, check_header
from rsibr.store.notes import peculiarities, suspicions
from rsibr.store.sidecar import sidecar_file
from rsibr.store.stamp import file_state, is_stamped, stamp
from rsibr.store.writer import BakeWriter

__all__ = ["Bake", "BakeWriter", "open_bake"]

_NAME_A_BAKE = "name a directory that `rsibr bake` made"


@dataclass(frozen=True, eq=False, repr=False)
class Bake(DescribedMaps):
    """A whole bake on the disk, as `open_bake` found it: maps are read when they are asked for.

    Attributes
    ----------
    path : Path
        Directory of the bake.
    manifest : Manifest
        Its manifest: config, identity, state of the views.
    """

    @property
    def complete(self) -> bool:
        """Whether all views are done; true for every bake that `open_bake` returns."""
        return not self.manifest.pending

    @property
    def config(self) -> dict[str, Any]:
        """The config as it was asked for, as JSON holds it: whatever takes a config takes this one."""
        return self.manifest.config

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know: of the material, the environment, the plan, and of suspicious texels."""
        return peculiarities(self.manifest) + suspicions(self.manifest, self.path)

    def map(self, index: int) -> MapFile:
        """Read the map of one view.

        Its `view` and `frame` have the float32 precision of the header; `directions[index]` is exact.

        Raises
        ------
        IndexError
            If the index is out of range.
        BakeError
            If the file was altered since the bake was opened, or is not the map of this view.
        """
        if not 0 <= index < self.view_count:
            raise IndexError(f"view {index} of {self.view_count}")
        state = self.manifest.views[index]
        file = self.path / state.file
        found = decode_map(_content(file, state.sha256), where=str(file))
        check_header(MapHeader.of(found), self.manifest, index, where=str(file))
        return found

    @cached_property
    def light(self) -> Light:
        """Environment of the bake, from which radiance is predicted.

        Raises
        ------
        BakeError
            If the bake is older than this file, or the file was altered since the bake was opened, or its content is no
            environment.
        """
        if self.manifest.light is None:
            where = str(self.path / LIGHT_NAME)
            raise BakeError("is missing: the bake was made before lights were kept", where=where, fix=BAKE_AGAIN)
        file = self.path / self.manifest.light.file
        found = decode_light(_content(file, self.manifest.light.sha256), where=str(file))
        if self.rendering == "rgb" and is_negative(found):  # spectra may leave Rec.709
            raise BakeError("holds negative radiance", where=str(file), fix=BAKE_ANEW)
        return found

    view = late(
        "rsibr.publishing.page.page:view", "Interactive page of the bake, in a notebook or as a file; see `rsibr.view`."
    )
    show = late("rsibr.publishing.notebooks.plots:show_bake", "Figure of the stored maps, at one exposure.")
    _repr_html_ = late("rsibr.publishing.notebooks.cards:bake_card", "Card for a notebook.")


def open_bake(path: Path, *, rehash: bool = False) -> Bake:
    """Open a bake and check its schema, its manifest, size and checksum of every file, and the header of every map.

    A bake may come from a stranger, whose checksums fit: whatever the manifest says twice must agree, and each map must
    be the one that the manifest describes. See `rsibr.store.consistency` and `rsibr.store.map_header`.

    Parameters
    ----------
    path : Path
        Directory of the bake, `NAME.rsibr`.
    rehash : bool
        Whether to read every byte even if the bake was checked before and no file has changed since; see
        `rsibr.store.stamp`.

    Raises
    ------
    BakeError
        If there is no bake, it is incomplete, its manifest contradicts itself, or a file is missing, truncated,
        altered, not a regular file inside the directory, or the map of another view.
    """
    path = Path(path)
    _check_kind(path)
    manifest = read_manifest(path / MANIFEST_NAME)
    if manifest.pending:
        raise unfinished(path, manifest)
    check_manifest(manifest, path / MANIFEST_NAME)
    state = file_state(path, manifest)
    if rehash or not is_stamped(path, state):
        for index in range(len(manifest.views)):
            check_map(path, manifest, index)
        if manifest.light is not None:
            check_file(path, manifest.light)
        stamp(path, manifest, state)
    return Bake(path, manifest)


def unfinished(path: Path, manifest: Manifest) -> BakeError:
    """Return the error for an unfinished bake; views with a sidecar count as held."""
    total, pending = len(manifest.views), [manifest.views[index] for index in manifest.pending]
    done = total - sum(not sidecar_file(path, state).exists() for state in pending)
    return BakeError(f"is not finished: it holds {done} of {total} views", where=str(path), fix=BAKE_AGAIN)


def _content(file: Path, sha256: str | None) -> bytes:
    data = read_bytes(file)
    if checksum(data) != sha256:
        raise altered(file)
    return data


def _check_kind(path: Path) -> None:
    try:
        if not path.exists():
            raise BakeError("does not exist", where=str(path), fix="make it with `rsibr bake`")
        if not path.is_dir():
            raise BakeError("is a file; a bake is a directory", where=str(path), fix=_NAME_A_BAKE)
        if not (path / MANIFEST_NAME).exists():
            raise BakeError("is a directory without a manifest, so no bake", where=str(path), fix=_NAME_A_BAKE)
        if (path / MANIFEST_NAME).is_symlink():
            what = "is a link; the files of a bake lie in its directory"
            raise BakeError(what, where=str(path / MANIFEST_NAME), fix=_NAME_A_BAKE)
    except OSError as error:
        raise unreadable(path, error) from error
