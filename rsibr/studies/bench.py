"""Measures one scene: its truth, path tracing as a rival, its bakes, and through them every picture."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rsibr.baking.baker import bake
from rsibr.errors import BakeError
from rsibr.store.atomic import checksum
from rsibr.store.manifest import canonical
from rsibr.studies.baked import BakedMaps, bake_record
from rsibr.studies.config import JudgeConfig
from rsibr.studies.journal import Journal
from rsibr.studies.lobes import lobe_truth
from rsibr.studies.path_tracing import path_tracing_points
from rsibr.studies.plan import BakeSize, Variant
from rsibr.studies.results import (
    BakeRecord,
    PathTracingRecord,
    PointRecord,
    ReferenceRecord,
)
from rsibr.studies.scene import Scene
from rsibr.studies.truth import Arrays, TruthStore, reference_of
from rsibr.validation.flip import Exposures, exposures_for
from rsibr.validation.metrics import noise_floor
from rsibr.validation.reference import Reference


@dataclass(eq=False)
class Bench:
    """What is measured in one scene, and where it is kept.

    Attributes
    ----------
    scene : Scene
    frames : sequence of ndarray, shape (3, 3)
        Judged views.
    judge : JudgeConfig
    journal : Journal
        Finished results.
    store : TruthStore
        References.
    bakes : Path
        Folder of the bakes.
    """

    scene: Scene
    frames: Sequence[NDArray[np.float64]]
    judge: JudgeConfig
    journal: Journal
    store: TruthStore
    bakes: Path
    _opened: BakedMaps | None = None

    def key(self, kind: str, **settings: Any) -> dict[str, Any]:
        """What a result depends on, beside its own settings."""
        judged = {"judged": [frame.tolist() for frame in self.frames], "reference_samples": self.judge.samples}
        return {"kind": kind, **self.scene.identity, **judged, "repeats": self.judge.repeats, **settings}

    @cached_property
    def references(self) -> list[Reference]:
        """Truth of each judged view."""
        return [self.reference(frame) for frame in self.frames]

    def reference(self, frame: NDArray[np.float64]) -> Reference:
        """Truth of one view."""
        return reference_of(self.scene, frame, self.judge.samples, self.store)

    def lobe_truth(self, frame: NDArray[np.float64]) -> Arrays:
        """Truth of each lobe in one view."""
        return lobe_truth(self.scene, frame, self.judge.samples, self.store)

    @cached_property
    def exposures(self) -> Exposures:
        """Exposures at which FLIP looks, from the mean radiance of all references."""
        covered = [reference.mean[reference.coverage > 0] for reference in self.references]
        return exposures_for(float(np.concatenate(covered).mean()))

    def reference_record(self) -> ReferenceRecord:
        """Sum the references up, one in memory at a time."""
        seconds, floors = [], []
        for frame in self.frames:
            reference = self.reference(frame)
            seconds.append(reference.seconds)
            floors.append(noise_floor(reference))
        return ReferenceRecord(
            samples=reference.samples,
            buffers=len(reference.buffers),
            sampler=reference.sampler,
            seconds=sum(seconds),
            noise_floor=float(np.mean(floors)),
        )

    def known_path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> list[PathTracingRecord] | None:
        """Return what was measured of path tracing before."""
        known = self.journal.find(self.key("path-tracing", samples=list(samples), pass_samples=pass_samples))
        return None if known is None else [PathTracingRecord.model_validate_json(canonical(one)) for one in known]

    def path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> None:
        """Measure path tracing with so many samples, in all and of a pass, and keep it in the journal."""
        found = path_tracing_points(
            self.scene.tracer,
            self.frames,
            self.references,
            self.exposures,
            samples,
            pass_samples=pass_samples,
            seed=self.scene.seed,
            runs=self.judge.repeats,
        )
        key = self.key("path-tracing", samples=list(samples), pass_samples=pass_samples)
        self.journal.store(key, [record.model_dump(mode="json") for record in found])

    def known_point(self, size: BakeSize, variant: Variant) -> PointRecord | None:
        """Return a point that was measured before."""
        known = self.journal.find(self.key("point", size=vars(size), variant=vars(variant)))
        return None if known is None else PointRecord.model_validate_json(canonical(known))

    def measure(self, size: BakeSize, variant: Variant) -> PointRecord:
        """Error and cost of a variant's pictures of all judged views, kept in the journal."""
        if self._opened is None or self._opened.size != size:
            self.bake(size)
        point = cast(BakedMaps, self._opened).measure(variant)
        self.journal.store(self.key("point", size=vars(size), variant=vars(variant)), point.model_dump(mode="json"))
        return point

    def bake(self, size: BakeSize) -> None:
        """Bake at a size, or go on with a bake that was killed, and open it; the one opened before is let go."""
        self.release()
        key = {"kind": "bake", **self.scene.content, "size": vars(size)}
        scene = re.sub(r"\W+", "-", f"{self.scene.material_name} {self.scene.environment_name}")
        path = self.bakes / f"{scene}-{checksum(canonical(key))[:12]}.rsibr"
        begun, config, start = path.exists(), size.config(self.scene.config), time.perf_counter()
        try:
            baked = bake(config, out=path)
        except BakeError:  # of an older version, or damaged: the name holds the hash of what it must be
            baked = bake(config, out=path, fresh=True)
        wall = time.perf_counter() - start
        known = self.journal.find(key)
        if known is None or not begun:
            known = bake_record(baked, size, None if begun else wall).model_dump(mode="json")
            self.journal.store(key, known)
        self._opened = BakedMaps(self, baked, BakeRecord.model_validate_json(canonical(known)), size)

    def release(self) -> None:
        """Let the opened bake go, with its maps on the device."""
        self._opened = None

    def close(self) -> None:
        """Let go of all that memory holds of this scene; what is on disk stays."""
        self.release()
        self.__dict__.pop("references", None)
