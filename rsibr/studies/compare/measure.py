"""Measures one scene of a comparison: its references, its bakes, and every system on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, cast

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.methods.device_size import device_bytes
from rsibr.methods.method_name import parse_name
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Method
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import method_digest
from rsibr.source_code import source_digest
from rsibr.store.bake import Bake
from rsibr.store.manifest import canonical
from rsibr.studies.agenda import BakeSize
from rsibr.studies.baked import BakedMaps
from rsibr.studies.bench import Bench
from rsibr.studies.compare.external import ExternalMap, map_at
from rsibr.studies.compare.records import CostRecord, SystemRecord
from rsibr.studies.compare.systems import label_of, system_of
from rsibr.studies.results import BakeRecord, ErrorRecord, Timing, mean_model
from rsibr.studies.truth import Arrays
from rsibr.validation.eval_error import EvalError, judge_eval
from rsibr.validation.metrics import compare
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
    sizes : sequence of BakeSize
        Bakes. A method that reads no stored maps is measured on the first.
    settings : sequence of str
        Names of methods, with options.
    external : dict of str to list of ExternalMap
        Maps of each external system.
    """

    bench: Bench
    sizes: Sequence[BakeSize]
    settings: Sequence[str]
    external: Mapping[str, Sequence[ExternalMap]] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Largest number of measurements."""
        return len(self.external) + len(self.sizes) * len(self.settings)

    def is_missing(self, size: BakeSize) -> bool:
        """Whether anything is left to measure on a bake."""
        return any(self._facts(size, name) is None and self.is_asked(size, name) for name in self.settings)

    def is_asked(self, size: BakeSize, name: str) -> bool:
        """Whether a method is measured on a bake: on the first, and on others unless it is known to read no maps."""
        first = None if size == self.sizes[0] else self._facts(self.sizes[0], name)
        return first is None or first.get("record", {}).get("views") is not None

    def measure(self, size: BakeSize, name: str) -> Measured:
        """Error and cost of a method, from the disk if it was measured before."""
        return _measured(*self.bench.judged.store.get(self._key(size, name), lambda: self._made(size, name)))

    def judge(self, name: str) -> Measured:
        """Error of external maps."""
        judged = self.bench.judged
        maps = [map_at(self.external[name], frame) for frame in judged.frames]
        key = self.bench.key("external", name=name, files=[one.digest for one in maps], code=source_digest(*_CODE))
        return _measured(*judged.store.get(key, lambda: self._judged(name, [one.image for one in maps])))

    def close(self) -> None:
        """Release what is in memory; bakes are removed unless they are kept."""
        self.bench.close()

    def _key(self, size: BakeSize, name: str) -> dict[str, Any]:
        code = {"code": source_digest(*_CODE), "method_code": method_digest(name)}
        return self.bench.key("system", size=vars(size), method=name, **code, **self.bench.options)

    def _facts(self, size: BakeSize, name: str) -> dict[str, Any] | None:
        """Stored facts of a measurement, None without one."""
        key = self._key(size, name)
        return self.bench.journal.find(key)["facts"] if self.bench.judged.store.has(key) else None

    def _made(self, size: BakeSize, name: str) -> tuple[Arrays, dict[str, Any]]:
        judged, opened = self.bench.judged, self._opened(size)
        try:
            started = _started(opened.bake, name, judged.frames[SHOWN], judged.scene.resolution)
        except BakeError as error:
            return {}, {"refusal": error.what}
        method, resolution = started.method, judged.scene.resolution
        made = [timed(method, frame, resolution)[0] for frame in judged.frames]
        of_maps = started.map_costs(made[SHOWN].seconds)  # before `eval`, which may prepare further
        points = [
            judge_eval(method, frame, truth, judged.scene.seed)
            for frame, truth in zip(judged.frames, judged.references, strict=True)
        ]
        cost = _cost(opened.record, method, of_maps, [one.seconds for one in made], [one.seconds for one in points])
        return self._told(name, [one.image for one in made], cost, points)

    def _judged(self, name: str, images: Sequence[NDArray[np.float32]]) -> tuple[Arrays, dict[str, Any]]:
        return self._told(name, images, None, [])

    def _told(
        self, name: str, images: Sequence[NDArray[np.float32]], cost: CostRecord | None, points: Sequence[EvalError]
    ) -> tuple[Arrays, dict[str, Any]]:
        """Compare the maps of all views, and return what is kept on the disk."""
        judged, opened = self.bench.judged, self.bench.opened
        errors = [
            compare(image, truth, judged.exposures, name=f"{name} at view {number}")
            for number, (image, truth) in enumerate(zip(images, judged.references, strict=True))
        ]
        views = opened.record.views if opened is not None and cost is not None and cost.reads_maps else None
        record = SystemRecord(
            label=label_of(name, views),
            system=system_of(name),
            options=parse_name(name)[1],
            views=views,
            error=ErrorRecord.of(errors),
            eval_rel_mse=mean_model([point.rel_mse for point in points]) if points else None,
            cost=cost,
        )
        arrays = {"image": images[SHOWN], "relative_error": errors[SHOWN].relative_error}
        return arrays, {"record": record.model_dump(mode="json")}

    def _opened(self, size: BakeSize) -> BakedMaps:
        """Bake of a size, which is made or finished if need be."""
        if self.bench.opened is None or self.bench.opened.size != size:
            self.bench.bake(size)
        return cast(BakedMaps, self.bench.opened)


@dataclass(frozen=True)
class _MapCosts:
    """Costs of a method once it has made maps, and before its first point."""

    whole_prepare_seconds: float
    prepare_seconds: float
    compile_seconds: float
    bytes: int


@dataclass(frozen=True, eq=False)
class _Started:
    """A method that has made its first map.

    Attributes
    ----------
    method : Method
        Made by itself: nothing is shared with other methods.
    first : float
        Time of the first map [s].
    compiled_before, compiled_in_map : float
        Compilation by LLVM or the driver in its preparation and in the first map [s].
    """

    method: Method
    first: float
    compiled_before: float
    compiled_in_map: float

    def map_costs(self, seconds: float) -> _MapCosts:
        """Tell preparation and compilation apart; `seconds` is the time of a map, nothing compiled.

        Who compiles a kernel depends on the order of the methods. A method may prepare for a size of map at its first,
        which counts as preparation; what the first map takes beyond is compilation and tracing.
        """
        beyond = max(0.0, self.first - seconds)
        whole = self.method.cost.prepare_seconds
        compiled = self.compiled_before + max(0.0, self.compiled_in_map - beyond)
        on_device = max(self.method.cost.device_bytes, device_bytes(self.method))
        return _MapCosts(whole, max(0.0, whole - compiled), compiled + beyond, on_device)


def _started(bake: Bake, name: str, frame: NDArray[np.float64], resolution: int) -> _Started:
    """Make a method and its first map."""
    with _compilation() as before:
        method = MethodSet(bake)[name]
    with _compilation() as in_map:
        first = run(method, frame, resolution).seconds
    return _Started(method, first, sum(before), sum(in_map))


@contextmanager
def _compilation() -> Iterator[list[float]]:
    """Record the times of compilation in the block [s]."""
    found: list[float] = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        yield found
        found += [1e-3 * kernel["backend_time"] for kernel in dr.kernel_history([dr.KernelType.JIT])]


def _cost(
    bake: BakeRecord, method: Method, of_maps: _MapCosts, seconds: Sequence[float], eval_seconds: Sequence[float]
) -> CostRecord:
    """Costs of a method; without the rendering of stored maps for one that reads none."""
    reads_maps = method.cost.reads_maps
    whole = bake.seconds.median if reads_maps else bake.setup_seconds
    return CostRecord(
        reads_maps=reads_maps,
        bake_seconds=max(0.0, whole - bake.compile_seconds),
        prepare_seconds=of_maps.prepare_seconds,
        compile_seconds=of_maps.compile_seconds + (bake.compile_seconds if reads_maps else 0.0),
        frame_seconds=Timing.of(seconds),
        eval_prepare_seconds=max(0.0, method.cost.prepare_seconds - of_maps.whole_prepare_seconds),
        eval_seconds=Timing.of(eval_seconds),
        disk_bytes=method.cost.bytes,
        bytes=of_maps.bytes,
        eval_bytes=max(method.cost.device_bytes, device_bytes(method)),
    )


def _measured(arrays: Arrays, facts: dict[str, Any]) -> Measured:
    if "refusal" in facts:
        return Measured(None, facts["refusal"])
    record = SystemRecord.model_validate_json(canonical(facts["record"]))
    return Measured(record, "", arrays["image"], arrays["relative_error"])
