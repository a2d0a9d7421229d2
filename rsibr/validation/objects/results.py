"""Results of an object's validation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.object_plan import ObjectPlan
from rsibr.shading.pictures.picture import Picture
from rsibr.validation.estimate import Estimate
from rsibr.validation.flip import Exposures
from rsibr.validation.objects.causes import Cause, Truths
from rsibr.validation.objects.object_error import ObjectError
from rsibr.validation.results import BakeSummary

_CAUSE_OF = {
    "perspective": "perspective",
    "self_occlusion": "visibility",
    "interreflection": "bounces",
    "silhouettes": "antialiasing",
}
"""Cause whose relMSE is that of leaving an effect out."""


@dataclass(frozen=True, eq=False, repr=False)
class MethodPicture:
    """Picture by one method, with its errors.

    Attributes
    ----------
    picture : Picture
        The picture as asked for; its `seconds` are of a second run, without compilation.
    bare : Picture
        The picture without shadows of its own; the same if none were asked for.
    open : ObjectError
        Errors of `bare` against open shading (a).
    full, unoccluded : ObjectError
        Errors of `picture` and of `bare` against path tracing (c).
    compile_seconds : float
        Extra time of the first picture [s].
    path_tracing_seconds : float
        Time of path-traced open shading to the same relMSE [s].
    """

    picture: Picture
    bare: Picture
    open: ObjectError
    full: ObjectError
    unoccluded: ObjectError
    compile_seconds: float
    path_tracing_seconds: float

    @property
    def times_path_tracing(self) -> float:
        """Time of path-traced open shading of the same error, over that of the picture without shadows of its own."""
        return self.path_tracing_seconds / self.bare.seconds

    @property
    def seconds_of_hit(self) -> float:
        """Time of a ray that meets a surface [s]."""
        return self.picture.seconds / max(1, self.picture.counts.hits)

    def __repr__(self) -> str:
        return f"MethodPicture(relMSE open {self.open.whole.rel_mse}, path-traced {self.full.whole.rel_mse})"


@dataclass(frozen=True, eq=False, repr=False)
class ObjectValidation:
    """Comparison of pictures of an object with their truths.

    Attributes
    ----------
    scene : str
        Name of the scene.
    camera : Camera
        Camera of all pictures.
    rays : int
        Rays a pixel.
    lookup, occlusion : str
        How surfaces take their radiance, and whether the object's own shadows were estimated.
    surfaces : dict of str to BakeSummary
        Bake of each surface type.
    zones : dict of str to ndarray of bool, shape (H, W)
        See `rsibr.validation.objects.zones`.
    truths : Truths
        Truths, as independent buffers.
    causes : list of Cause
        Error that each cause alone makes.
    methods : dict of str to MethodPicture
        Picture by name of the method, in display order.
    exposures : Exposures
        Of FLIP, the same for all.
    plan : ObjectPlan or None
        Effects of the picture by the first method; None if they were not planned.
    notes : tuple of str
        What was left out or ignored, in a sentence each.
    """

    scene: str
    camera: Camera
    rays: int
    lookup: str
    occlusion: str
    surfaces: dict[str, BakeSummary]
    zones: dict[str, NDArray[np.bool_]]
    truths: Truths
    causes: list[Cause]
    methods: dict[str, MethodPicture]
    exposures: Exposures
    plan: ObjectPlan | None = None
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        errors = ", ".join(f"{name} {one.open.whole.rel_mse.value:.3g}" for name, one in self.methods.items())
        return f"ObjectValidation({self.scene!r}; relMSE against open shading: {errors})"

    @property
    def best(self) -> str:
        """Name of the method with the least relMSE against open shading."""
        return min(self.methods, key=lambda name: self.methods[name].open.whole.rel_mse.value)

    @property
    def measured(self) -> dict[str, Estimate]:
        """Measured relMSE of leaving an effect out, by its name in the plan."""
        causes = {cause.name: cause.rel_mse for cause in self.causes}
        return {effect: causes[cause] for effect, cause in _CAUSE_OF.items()}

    @property
    def zone_shares(self) -> dict[str, float]:
        """Share of each zone in the judged pixels; of zones that have any."""
        return {zone: error.share for zone, error in self.methods[self.best].open.zones.items()}
