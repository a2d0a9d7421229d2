"""Tables of `miller1984`: diffuse and specular map in polar coordinates, and their weights by angle."""

from __future__ import annotations

from typing import Any

from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import encoded_images
from rsibr.publishing.bundle.tables.device_tables import sheets_of, table_of


@contributes("miller1984", to=("miller1984",))
def miller1984(request: Request) -> Part:
    """Maps with their borders, as the method reads them."""
    method: Any = request.methods["miller1984"]
    shading = method.shading
    part = Part({"points": method.points}, {"wD": table_of(shading.w_d), "wS": table_of(shading.w_s)})
    for name, table in (("diffuse", shading.diffuse), ("specular", shading.specular)):
        if table is not None:
            part.arrays[name] = encoded_images(sheets_of(table.texels)[0], request.precision)
            part.meta["isNearest"] = table.is_nearest
    return part
