"""Methods of one bake, made at first use, with shared inputs made once."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

from rsibr import backend
from rsibr.errors import BakeError
from rsibr.methods.device_size import device_bytes
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Cost, Method
from rsibr.methods.registry import Registration, available, registration
from rsibr.store.stored_maps import StoredMaps


class MethodSet(Mapping[str, Method]):
    """Methods of one bake by name; they share its maps and its environment on the device.

    Iteration yields the names of the methods whose requirements the bake meets.

    Parameters
    ----------
    bake : StoredMaps
        A finished bake. Nothing is read before a method is made.

    Attributes
    ----------
    inputs : MethodInputs
        Shared inputs of the methods.

    Examples
    --------
    >>> methods = rsibr.MethodSet(rsibr.open_bake("paint.rsibr"))     # doctest: +SKIP
    >>> list(methods)                                                  # doctest: +SKIP
    ['nearest', 'blend', 'cabral1999', 'cabral1999-mesh', 'rsibr', 'rsibr-fine']
    """

    def __init__(self, bake: StoredMaps) -> None:
        self.inputs = MethodInputs(bake)
        self._made: dict[str, Method] = {}

    def __getitem__(self, name: str) -> Method:
        """Make the method `name`, or return it if it exists already.

        Raises
        ------
        InputError
            If no method has this name.
        BakeError
            If the bake lacks something that the method requires.
        """
        with backend.session():  # one thread at a time makes a method
            if name not in self._made:
                self._made[name] = self.variant(name)
            return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(available(self.inputs.bake))

    def __len__(self) -> int:
        return len(available(self.inputs.bake))

    def __contains__(self, name: object) -> bool:
        return name in available(self.inputs.bake)

    def __repr__(self) -> str:
        return f"MethodSet({self.inputs.bake.path.name!r}: {', '.join(self)})"

    def variant(self, name: str, **options: Any) -> Method:
        """Make a method with non-default options, for example for a single lobe; it is not cached.

        Parameters
        ----------
        name : str
            Name of the method.
        **options
            Keyword parameters of the method's factory; `Registration.options` lists them.

        Raises
        ------
        InputError, BakeError
            As `__getitem__`.
        """
        found = registration(name)
        _check_served(found, self.inputs.bake)
        with backend.session(), self.inputs.watched() as shared:
            start = time.perf_counter()
            made = found.make(self.inputs, **options)
            backend.synchronize()
            own = time.perf_counter() - start - shared.seconds_here
        if not options:
            made.name = name
        bake, prepared = self.inputs.bake, own + shared.seconds_ever
        made.cost = Cost(bake.seconds, bake.bytes, prepared, device_bytes(made))
        return made


def _check_served(method: Registration, bake: StoredMaps) -> None:
    """Raise a BakeError if the bake lacks something that the method requires."""
    where = str(bake.path)
    if method.needs.lobes and not bake.manifest.lobes:
        fix = f'bake with effects.lobes = "auto" for {method.name}'
        raise BakeError("its lobes are not stored separately", where=where, fix=fix)
    if method.needs.views and not bake.has_views:
        raise BakeError(
            f"it holds one map, because all lobes are predicted from the environment; '{method.name}' needs more views",
            where=where,
            fix='bake with effects.view_dependence = "on", or use another method',
        )
