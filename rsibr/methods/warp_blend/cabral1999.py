"""Method of Cabral, Olano, Nemec (1999) as published: one warp per material, area weights, fade at the singularity.

It is the baseline of comparisons and must not change.
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
    summary="Cabral et al. (1999): one reflection-space warp, area weights",
    needs=Needs(views=True),
    role="baseline",
    rank=30,
)
def cabral1999(inputs: MethodInputs, *, weights: str = "area", mesh: DiskMesh | None = None) -> WarpBlend:
    """Make the method: warp and blend the three stored views around the new one.

    Parameters
    ----------
    inputs : MethodInputs
        Maps and views of a bake.
    weights : str
        Barycentric weights, one of `WEIGHTS`; the paper uses ratios of spherical areas (section 3.4).
    mesh : DiskMesh, optional
        Evaluate the warp only at the vertices of this mesh (section 3.3); by default at every texel.
    """
    warp, mix = WARPS[inputs.bake.manifest.material.warp], triangle_mix(WEIGHTS[weights])
    common = ("cabral1999", inputs.viewpoints, inputs.sources, mix, warp)
    return WarpBlend(*common) if mesh is None else MeshWarpBlend(*common, mesh=mesh)


register_alias(
    "cabral1999-mesh",
    of="cabral1999",
    summary="cabral1999 with the warp interpolated on a tessellated disk",
    rank=40,
    mesh=DiskMesh(),
)
