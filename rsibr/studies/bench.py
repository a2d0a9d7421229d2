"""Measures one scene: references, path tracing for comparison, bakes, and the variants on each bake."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from rsibr import clock
from rsibr.baking.baker import bake
from rsibr.baking.scene import Scene
from rsibr.errors import BakeError
from rsibr.methods.registry import method_digest
from rsibr.store.atomic import checksum
from rsibr.store.bake import Bake
from rsibr.store.directory import remove_folder
from rsibr.store.manifest import canonical
from rsibr.studies.agenda import BakeSize, Variant
from rsibr.studies.baked import BakedMaps, bake_record
from rsibr.studies.journal import Journal
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.path_tracing import path_tracing_points
from rsibr.studies.results import (
    BakeRecord,
    PathTracingRecord,
    PointRecord,
)
from rsibr.studies.scene import StudyScene

_FORMAT = 4
"""Version of the records in the journal; those of another version are measured anew."""


@dataclass(eq=False)
class Bench:
    """Measurements of one scene, with their storage.

    Attributes
    ----------
    judged : JudgedScene
        Scene with its references.
    journal : Journal
        Finished results.
    bakes : Path
        Folder of the bakes.
    compiled : dict of str to float
        Longest compilation time of the bakes and of each variant so far [s]. A process compiles a kernel once; every
        bake and point is charged with the time, whichever came first. All scenes of a study share it.
    """

    judged: JudgedScene
    journal: Journal
    bakes: Path
    compiled: dict[str, float] = field(default_factory=dict)
    _opened: BakedMaps | None = None

    @property
    def scene(self) -> StudyScene:
        """The scene."""
        return self.judged.scene

    def key(self, kind: str, **settings: Any) -> dict[str, Any]:
        """Key of a result: everything that it depends on."""
        judge = self.judged.judge
        judged = {"judged": [frame.tolist() for frame in self.judged.frames], "reference_samples": judge.samples}
        how = {"repeats": judge.repeats, "errors_only": judge.errors_only}
        return {"kind": kind, "format": _FORMAT, **self.scene.identity, **judged, **how, **settings}

    @property
    def options(self) -> dict[str, Any]:
        """Options that the config sets for methods, as a part of the keys of their results."""
        return {"methods": self.scene.config.methods} if self.scene.config.methods else {}

    def known_path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> list[PathTracingRecord] | None:
        """Return stored measurements of path tracing, None without any."""
        known = self.journal.find(self.key("path-tracing", samples=list(samples), pass_samples=pass_samples))
        return None if known is None else [PathTracingRecord.model_validate_json(canonical(one)) for one in known]

    def path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> None:
        """Measure path tracing at these total samples and samples a pass; store it in the journal."""
        found = path_tracing_points(
            self.scene.tracer,
            self.judged.frames,
            self.judged.references,
            self.judged.exposures,
            samples,
            pass_samples=pass_samples,
            seed=self.scene.seed,
            runs=self.judged.judge.repeats,
        )
        key = self.key("path-tracing", samples=list(samples), pass_samples=pass_samples)
        self.journal.store(key, [record.model_dump(mode="json") for record in found])

    def known_point(self, size: BakeSize, variant: Variant) -> PointRecord | None:
        """Return a stored point, None without one."""
        known = self.journal.find(self._point_key(size, variant))
        return None if known is None else PointRecord.model_validate_json(canonical(known))

    def measure(self, size: BakeSize, variant: Variant) -> PointRecord:
        """Measure error and cost of a variant over all judged views; store it in the journal."""
        if self._opened is None or self._opened.size != size:
            self.bake(size)
        point = cast(BakedMaps, self._opened).measure(variant)
        as_float32 = str(replace(variant, precision="float32"))  # kernels read float32 in any case
        point = point.model_copy(update={"compile_seconds": self._longest(as_float32, point.compile_seconds)})
        self.journal.store(self._point_key(size, variant), point.model_dump(mode="json"))
        return point

    def bake(self, size: BakeSize) -> None:
        """Bake at a size, or continue an interrupted bake, and open it; the bake opened before is released."""
        self.release()
        path = self._bake_path(size)
        begun, scene = path.exists(), self.scene.prepared.resized(size.config(self.scene.config))
        baked = _baked(scene, path)
        record = self.known_bake(size) if begun else None
        if record is None:
            record = bake_record(baked, size)
            record = record.compiling(self._longest("bake", record.compile_seconds))
            self.journal.store(self._record_key(size), record.model_dump(mode="json"))
        self._opened = BakedMaps(self.judged, baked, record, size)

    def _bake_path(self, size: BakeSize) -> Path:
        name = re.sub(r"\W+", "-", f"{self.scene.material_name} {self.scene.environment_name}")
        return self.bakes / f"{name}-{checksum(canonical(self._bake_key(size)))[:12]}.rsibr"

    def known_bake(self, size: BakeSize) -> BakeRecord | None:
        """Return the stored cost of a bake, None without one."""
        known = self.journal.find(self._record_key(size))
        return None if known is None else BakeRecord.model_validate_json(canonical(known))

    @property
    def opened(self) -> BakedMaps | None:
        """The opened bake."""
        return self._opened

    def _point_key(self, size: BakeSize, variant: Variant) -> dict[str, Any]:
        """Key of a point: the method counts with its code, because a version number stays through many changes."""
        code = method_digest(variant.method)
        return self.key("point", size=vars(size), variant=vars(variant), method_code=code, **self.options)

    def _bake_key(self, size: BakeSize) -> dict[str, Any]:
        return {"kind": "bake", **self.scene.content, "size": vars(size)}

    def _record_key(self, size: BakeSize) -> dict[str, Any]:
        return {**self._bake_key(size), "format": _FORMAT}

    def _longest(self, name: str, seconds: float) -> float:
        self.compiled[name] = max(seconds, self.compiled.get(name, 0.0))
        return self.compiled[name]

    def release(self) -> None:
        """Release the opened bake and its maps on the device, and its files unless they are kept."""
        opened, self._opened = self._opened, None
        if opened is not None and not self.judged.judge.keep_bakes:
            remove_folder(opened.bake.path)

    def close(self) -> None:
        """Release the memory of this scene; files stay, those of bakes if they are kept."""
        self.release()
        self.judged.forget()
        self.scene.release()


def _baked(scene: Scene, path: Path) -> Bake:
    """Bake a scene; the manifest also counts the time of the shared parts that were made before.

    A bake by itself would have to make them.
    """
    with clock.counting(time.perf_counter() - scene.parts.seconds):
        try:
            return bake(scene, out=path, allow_large=True)  # the whole study has been admitted
        except BakeError:  # made by an older version, or damaged; its name holds a hash of its config
            return bake(scene, out=path, fresh=True, allow_large=True)
