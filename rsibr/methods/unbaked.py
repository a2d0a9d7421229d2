"""A scene that was not baked, as methods read it: light and lobes, and no map.

Methods that filter the light beforehand need no more, so that a config alone serves them.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from rsibr import backend
from rsibr.baking.planned_manifest import plan_manifest
from rsibr.baking.scene import Scene
from rsibr.geometry.viewpoints import witness
from rsibr.regular_file import is_file
from rsibr.scene.config import Config, ConfigLike, parse_config
from rsibr.store.described_maps import MapsInMemory
from rsibr.store.manifest import MANIFEST_NAME, LightRecord, SamplingRecord, read_manifest

_NO_FILE = "0" * 64  # checksum of a file that was not written


@backend.in_session
def unbaked(config: ConfigLike, overrides: Sequence[str] = (), *, name: str = "config") -> MapsInMemory:
    """Load a scene and fit its lobes, without a map.

    Parameters
    ----------
    config, overrides
        See `rsibr.scene.config.config_of`.
    name : str
        Name of the config in messages.

    Returns
    -------
    MapsInMemory
        For `rsibr.MethodSet`.

    Raises
    ------
    InputError
        If the config, the environment or the material is invalid.

    Examples
    --------
    >>> list(rsibr.MethodSet(unbaked("configs/demo.toml")))                                # doctest: +SKIP
    ['miller1984', 'kautz2003', 'split-sum']
    """
    start = time.perf_counter()
    scene = Scene.prepare(config, overrides)
    with backend.rendering(scene.rendering):
        planned = witness(scene.all_around)  # a manifest names one view at least
        manifest, light = plan_manifest(scene, planned, SamplingRecord(block=4, even=4)), scene.light
    record = LightRecord(sha256=_NO_FILE, bytes=0, delta_lights=len(light.delta))
    seconds = time.perf_counter() - start
    manifest = manifest.model_copy(update={"light": record, "wall_seconds": seconds})
    return MapsInMemory(Path(name), manifest, (), light)


def unfinished_config(path: Path) -> Config | None:
    """Config of a bake that was begun and not finished; None if there is none, or it is finished.

    Raises
    ------
    BakeError
        If its manifest cannot be read.
    """
    if not is_file(path / MANIFEST_NAME):
        return None
    manifest = read_manifest(path / MANIFEST_NAME)
    if not manifest.pending:
        return None
    return parse_config(manifest.config, path, where=str(path / MANIFEST_NAME))
