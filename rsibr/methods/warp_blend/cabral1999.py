"""Cabral, Olano, Nemec (1999) as printed: one warp for the material, area weights, fade near the singularity.

It stays as it is: the baseline that other methods are compared with.
"""

from __future__ import annotations

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register, register_alias
from rsibr.methods.warp_blend.blend import WEIGHTS, triangle_mix
from rsibr.methods.warp_blend.disk_mesh import DiskMesh
from rsibr.methods.warp_blend.warp import WARPS
from rsibr.methods.warp_blend.warp_blend import MeshWarpBlend, WarpBlend


@register(
    "cabral1999",
    summary="the paper: one reflection-space warp, area weights",
    needs=Needs(views=True),
    role="baseline",
    rank=30,
)
def cabral1999(inputs: MethodInputs, *, weights: str = "area", mesh: DiskMesh | None = None) -> WarpBlend:
    """Warp and blend the three stored views around the new one.

    Parameters
    ----------
    inputs : MethodInputs
        Maps and views of a bake.
    weights : str
        Barycentric weights, one of `WEIGHTS`; the paper's are ratios of spherical areas (section 3.4).
    mesh : DiskMesh, optional
        Compute the warp at the vertices of this mesh alone (section 3.3); by default at every texel.
    """
    warp, mix = WARPS[inputs.bake.manifest.material.warp], triangle_mix(WEIGHTS[weights])
    common = ("cabral1999", inputs.viewpoints, inputs.sources, mix, warp)
    return WarpBlend(*common) if mesh is None else MeshWarpBlend(*common, mesh=mesh)


register_alias(
    "cabral1999-mesh", of="cabral1999", summary="the paper through its tessellated disk", rank=40, mesh=DiskMesh()
)
