"""Schema of `object.json`, the errors of pictures of an object."""

from __future__ import annotations

import json
from typing import Literal

from pydantic import Field

from rsibr.planning.plan import Effect
from rsibr.validation.estimate import Estimate
from rsibr.validation.objects import zones as definitions
from rsibr.validation.objects.causes import Cause
from rsibr.validation.objects.object_error import ObjectError, ZoneError
from rsibr.validation.objects.results import MethodPicture, ObjectValidation
from rsibr.validation.report.document import BakeModel, FlipModel
from rsibr.validation.report.estimate_document import EstimateModel, Interval, Positive, Share, StrictModel

Vector = tuple[float, float, float]


class MeasuredModel(StrictModel):
    """A number with its 95 % confidence interval, due to the noise of the truth."""

    value: float
    ci95: Interval

    @classmethod
    def of(cls, estimate: Estimate) -> MeasuredModel:
        """Make the model of an estimate."""
        return cls(value=estimate.value, ci95=estimate.ci95)


class ZoneErrorModel(StrictModel):
    """Errors over the pixels of a zone with coverage ≥ ½."""

    share: Share = Field(description="share of the zone in the judged pixels")
    rel_mse: EstimateModel
    smape: MeasuredModel = Field(description="mean of |a−b|/(|a|+|b|); part of the truth's noise remains in it")
    flip: MeasuredModel = Field(description="mean HDR-FLIP at the exposures given; part of the noise remains in it")
    energy_ratio: MeasuredModel | None = Field(description="Σa/Σb; null if a channel is black in the truth only")

    @classmethod
    def of(cls, error: ZoneError) -> ZoneErrorModel:
        """Make the model of the errors of a zone."""
        return cls(
            share=error.share,
            rel_mse=EstimateModel.of(error.rel_mse),
            smape=MeasuredModel.of(error.smape),
            flip=MeasuredModel.of(error.flip),
            energy_ratio=None if error.energy_ratio is None else MeasuredModel.of(error.energy_ratio),
        )


class ObjectErrorModel(StrictModel):
    """Errors of a picture against one truth."""

    whole: ZoneErrorModel
    zones: dict[str, ZoneErrorModel]
    noise_floor: Positive = Field(description="relMSE due to the noise of the truth; subtracted in rel_mse")

    @classmethod
    def of(cls, error: ObjectError) -> ObjectErrorModel:
        """Make the model of the errors against a truth."""
        zones = {zone: ZoneErrorModel.of(one) for zone, one in error.zones.items()}
        return cls(whole=ZoneErrorModel.of(error.whole), zones=zones, noise_floor=error.noise_floor)


class MethodPictureModel(StrictModel):
    """Picture by one method."""

    open: ObjectErrorModel = Field(description="against open shading: the error of reconstruction")
    full: ObjectErrorModel = Field(description="against path tracing: the whole error")
    unoccluded: ObjectErrorModel = Field(description="against path tracing, without occlusion in the picture")
    seconds: Positive = Field(description="time of the picture")
    hit_seconds: Positive = Field(description="time of a ray that meets a surface")
    prepare_seconds: Positive = Field(description="preparation: maps, tables")
    compile_seconds: Positive = Field(description="extra time of the first picture: tracing and compilation")
    path_tracing_seconds: Positive = Field(description="time of path-traced open shading of equal relMSE")
    times_path_tracing: Positive = Field(description="that time over the time of the picture without occlusion")

    @classmethod
    def of(cls, made: MethodPicture) -> MethodPictureModel:
        """Make the model of a picture."""
        return cls(
            open=ObjectErrorModel.of(made.open),
            full=ObjectErrorModel.of(made.full),
            unoccluded=ObjectErrorModel.of(made.unoccluded),
            seconds=made.picture.seconds,
            hit_seconds=made.seconds_of_hit,
            prepare_seconds=made.picture.prepare_seconds,
            compile_seconds=made.compile_seconds,
            path_tracing_seconds=made.path_tracing_seconds,
            times_path_tracing=made.times_path_tracing,
        )


class CauseModel(StrictModel):
    """A cause of error and the relMSE that it alone makes, between two truths; the noise of both is subtracted."""

    name: str
    rel_mse: EstimateModel
    of: str = Field(description="what was compared")

    @classmethod
    def of_cause(cls, cause: Cause) -> CauseModel:
        """Make the model of a cause."""
        return cls(name=cause.name, rel_mse=EstimateModel.of(cause.rel_mse), of=cause.of)


class CameraModel(StrictModel):
    """Camera of the picture."""

    position: Vector
    forward: Vector
    fov_deg: Positive = Field(description="horizontal field of view [°]")
    width: int
    height: int
    rays: int = Field(description="rays a pixel, at the same places in pictures and truths")


class ZoneModel(StrictModel):
    """Thresholds between the zones."""

    curved: Positive = Field(definitions.CURVED, description="turn of the normal to a neighbour [rad]")
    normal_jump: Positive = Field(definitions.NORMAL_JUMP, description="that of an edge [rad]")
    depth_jump: Positive = Field(definitions.DEPTH_JUMP, description="second difference of depth [widths of a pixel]")


class NormalsModel(StrictModel):
    """Rays that met a surface, and how many of their shading normals were made safe."""

    hits: int
    replaced: int = Field(description="without direction")
    flipped: int = Field(description="against the geometric normal")
    bent: int = Field(description="facing away from the viewer: Mitsuba keeps these")
    back: int = Field(description="hits on the inner side")


class TruthModel(StrictModel):
    """The truths: (a) open, (b) shadowed, (c) full, and two variants of (a)."""

    samples: int = Field(description="samples a pixel of each, total of all buffers")
    buffers: int
    sampler: str
    seconds: dict[str, Positive] = Field(description="of each, without compilation")
    flip_exposures: FlipModel


class ObjectDocument(StrictModel):
    """`object.json`: errors of pictures of an object, by zone and by cause. Times in seconds."""

    schema_version: Literal[1] = Field(alias="schema")
    scene: str
    surfaces: dict[str, BakeModel] = Field(description="bake of each shape id; * stands for all other shapes")
    camera: CameraModel
    lookup: str
    occlusion: str
    truth: TruthModel
    zones: ZoneModel
    normals: NormalsModel
    causes: list[CauseModel]
    effects: list[Effect] | None = Field(description="effects of the picture; null: not planned")
    methods: dict[str, MethodPictureModel]
    notes: list[str]

    def to_json(self) -> str:
        """Return strict JSON, indented."""
        return json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def object_document(validation: ObjectValidation) -> ObjectDocument:
    """Convert the validation of an object to the schema of `object.json`."""
    truths, camera = validation.truths, validation.camera
    return ObjectDocument(
        schema=1,
        scene=validation.scene,
        surfaces={name: BakeModel(**vars(bake)) for name, bake in validation.surfaces.items()},
        camera=CameraModel(
            position=tuple(camera.position.tolist()),
            forward=tuple(camera.forward.tolist()),
            fov_deg=camera.fov_deg,
            width=camera.width,
            height=camera.height,
            rays=validation.rays,
        ),
        lookup=validation.lookup,
        occlusion=validation.occlusion,
        truth=TruthModel(
            samples=truths.open.samples,
            buffers=len(truths.open.buffers),
            sampler=truths.open.sampler,
            seconds={name: reference.seconds for name, reference in truths.named.items()},
            flip_exposures=FlipModel(**vars(validation.exposures)),
        ),
        zones=ZoneModel(),
        normals=NormalsModel(**vars(validation.methods[validation.best].picture.counts)),
        causes=[CauseModel.of_cause(cause) for cause in validation.causes],
        effects=None if validation.plan is None else list(validation.plan.effects),
        methods={name: MethodPictureModel.of(made) for name, made in validation.methods.items()},
        notes=list(validation.notes),
    )


def object_schema() -> str:
    """JSON Schema of `object.json`, as `docs/object.schema.json` holds it."""
    schema = ObjectDocument.model_json_schema(by_alias=True, mode="serialization")
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
