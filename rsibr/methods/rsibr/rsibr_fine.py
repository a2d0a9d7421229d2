"""`rsibr-fine`: `rsibr` with a finer half-vector pyramid and more footprints; slower, more accurate."""

from __future__ import annotations

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.rsibr.fidelity import FINE
from rsibr.methods.rsibr.rsibr import Rsibr, model_with_residuals


@register(
    "rsibr-fine",
    summary="rsibr with a finer pyramid and every narrow lobe by itself: more accurate, slower",
    needs=Needs(light=True, lobes=True, maps=True),
    sees_delta_lights=True,
    rank=60,
)
def rsibr_fine(
    inputs: MethodInputs, *, weights: str = "gnomonic", uses_maps: bool | None = None, lobe: str | None = None
) -> Rsibr:
    """Make the method `rsibr-fine`.

    Parameters
    ----------
    inputs : MethodInputs
        Maps, environment and lobes of a bake.
    weights : str
        Barycentric weights of the residuals, one of `WEIGHTS`.
    uses_maps, lobe
        See `ResidualOptions`.
    """
    return model_with_residuals("rsibr-fine", inputs, FINE, weights, uses_maps, lobe)
