"""Measures one scene of a comparison: its references, its bakes, and every system on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.methods.device_size import device_bytes
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import method_digest
from rsibr.source_code import source_digest
from rsibr.store.bake import Bake
from rsibr.store.manifest import canonical
from rsibr.studies.agenda import BakeSize
from rsibr.studies.bench import Bench
from rsibr.studies.compare.external import ExternalMap, image_at
from rsibr.studies.compare.records import CostRecord, SystemRecord
from rsibr.studies.compare.systems import System, reads_maps
from rsibr.studies.results import BakeRecord, ErrorRecord, Timing, mean_model
from rsibr.studies.truth import Arrays
from rsibr.validation.eval_error import judge_eval
from rsibr.validation.metrics import MapError, compare
from rsibr.validation.validation import timed

SHOWN = 0
"""Number of the judged view whose maps are shown: at a triangle centroid, farthest from the stored views."""

_CODE = ("rsibr.validation", "rsibr.studies.compare.measure", "rsibr.studies.compare.records")


@dataclass(frozen=True, eq=False)
class Measured:
    """A system on a scene.

    Attributes
    ----------
    record : SystemRecord or None
        Error and cost; None if the bake cannot serve the method.
    refusal : str
        Why it cannot.
    image : ndarray, shape (N, N, 3), or None
        Map of the shown view.
    relative_error : ndarray, shape (N, N), or None
        Its relative error, as in `MapError`.
    """

    record: SystemRecord | None
    refusal: str = ""
    image: NDArray[np.float32] | None = None
    relative_error: NDArray[np.float32] | None = None


@dataclass(eq=False)
class SceneBench:
    """Measurements of one scene, each stored when it is made.

    Attributes
    ----------
    bench : Bench
        Scene, references, bakes and their journal.
    systems : dict of BakeSize to list of System
        Settings to measure on each bake.
    external : dict of str to list of ExternalMap
        Maps of each external system.
    """

    bench: Bench
    systems: Mapping[BakeSize, Sequence[System]]
    external: Mapping[str, Sequence[ExternalMap]] = field(default_factory=dict)
    _methods: MethodSet | None = None

    @property
    def steps(self) -> int:
        """Number of measurements."""
        return len(self.external) + sum(len(found) for found in self.systems.values())

    def is_known(self, size: BakeSize, system: System) -> bool:
        """Whether the measurement is stored already."""
        return self.bench.judged.store.has(self._key(size, system))

    def measure(self, size: BakeSize, system: System) -> Measured:
        """Error and cost of a setting, from the disk if it was measured before."""
        return _measured(*self.bench.judged.store.get(self._key(size, system), lambda: self._made(size, system)))

    def judge(self, name: str) -> Measured:
        """Error of external maps."""
        maps = self.external[name]
        key = self.bench.key("external", name=name, files=[one.digest for one in maps], code=source_digest(*_CODE))
        return _measured(*self.bench.judged.store.get(key, lambda: self._judged(name, maps)))

    def close(self) -> None:
        """Release what is in memory; bakes are removed unless they are kept."""
        self._methods = None
        self.bench.close()

    def _key(self, size: BakeSize, system: System) -> dict[str, Any]:
        code = {"code": source_digest(*_CODE), "method_code": method_digest(system.method)}
        return self.bench.key("system", size=vars(size), system=system.key, **code)

    def _made(self, size: BakeSize, system: System) -> tuple[Arrays, dict[str, Any]]:
        methods = self._opened(size)
        judged, opened = self.bench.judged, self.bench.opened
        if opened is None:
            raise ValueError("no bake is open")
        try:
            method = methods.variant(system.method, **dict(system.options))
        except BakeError as error:
            return {}, {"refusal": f"{error.what}"}
        errors, points, seconds, first, shown = [], [], [], [], None
        for number, (frame, truth) in enumerate(zip(judged.frames, judged.references, strict=True)):
            made, before = timed(method, frame, judged.scene.resolution)
            errors.append(compare(made.image, truth, judged.exposures, name=f"{system.label} at view {number}"))
            points.append(judge_eval(method, frame, truth, judged.scene.seed))
            seconds.append(made.seconds)
            first.append(before - made.seconds)
            shown = made.image if number == SHOWN else shown
        cost = CostRecord(
            bake_seconds=_bake_seconds(opened.record, system.method),
            prepare_seconds=method.cost.prepare_seconds,
            compile_seconds=max(0.0, first[0]),
            frame_seconds=Timing.of(seconds),
            eval_seconds=Timing.of([point.seconds for point in points]),
            disk_bytes=_disk_bytes(opened.bake, system.method),
            bytes=max(method.cost.device_bytes, device_bytes(method)),
        )
        record = SystemRecord(
            label=system.label,
            system=system.method,
            options=dict(system.options),
            views=system.views,
            error=ErrorRecord.of(errors),
            eval_rel_mse=mean_model([point.rel_mse for point in points]),
            cost=cost,
        )
        return _stored(record, shown, errors)

    def _judged(self, name: str, maps: Sequence[ExternalMap]) -> tuple[Arrays, dict[str, Any]]:
        judged = self.bench.judged
        images = [image_at(maps, frame) for frame in judged.frames]
        errors = [
            compare(image, truth, judged.exposures, name=name)
            for image, truth in zip(images, judged.references, strict=True)
        ]
        error = ErrorRecord.of(errors)
        record = SystemRecord(
            label=name, system=name, options={}, views=None, error=error, eval_rel_mse=None, cost=None
        )
        return _stored(record, images[SHOWN], errors)

    def _opened(self, size: BakeSize) -> MethodSet:
        """Methods of the bake of a size, which is made or finished if need be."""
        opened = self.bench.opened
        if self._methods is None or opened is None or opened.size != size:
            self._methods = None
            self.bench.bake(size)
            self._methods = MethodSet(self.bench.opened.bake)  # type: ignore[union-attr]  # `bake` has opened it
        return self._methods


def _bake_seconds(bake: BakeRecord, method: str) -> float:
    """Time of the bake, or of its set-up without compilation of the renderer for a method without stored maps."""
    if reads_maps(method):
        return bake.seconds.median
    return max(0.0, bake.setup_seconds - bake.compile_seconds)


def _disk_bytes(bake: Bake, method: str) -> int:
    if reads_maps(method):
        return bake.bytes
    return 0 if bake.manifest.light is None else bake.manifest.light.bytes


def _stored(
    record: SystemRecord, image: NDArray[np.float32] | None, errors: Sequence[MapError]
) -> tuple[Arrays, dict[str, Any]]:
    arrays = {"image": np.asarray(image, np.float32), "relative_error": errors[SHOWN].relative_error}
    return arrays, {"record": record.model_dump(mode="json")}


def _measured(arrays: Arrays, facts: dict[str, Any]) -> Measured:
    if "refusal" in facts:
        return Measured(None, facts["refusal"])
    record = SystemRecord.model_validate_json(canonical(facts["record"]))
    return Measured(record, "", arrays["image"], arrays["relative_error"])
