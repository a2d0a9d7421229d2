"""Fresh import of a user's module in a namespace of its own, with one-line errors."""

from __future__ import annotations

import hashlib
import importlib
import sys
import traceback
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from rsibr.errors import InputError


def imported_afresh(name: str, where: str) -> list[ModuleType]:
    """Run a module and its submodules again, even if they have been imported before.

    Parameters
    ----------
    name : str
        Name of a module that `import` finds, or a path that ends in `.py`.
    where : str
        Config key or option that an error names.

    Returns
    -------
    list of module
        The module and its submodules. Modules of these names that were imported before stay in `sys.modules`.

    Raises
    ------
    InputError
        If there is no such module, or it raises an error, which is named with its line.
    """
    is_file = name.endswith(".py")
    if is_file and not Path(name).is_file():
        raise InputError(f"there is no file {name}", where=where, fix="check the path")
    key = f"_rsibr_plugins_{hashlib.sha256(name.encode()).hexdigest()[:12]}" if is_file else name
    before = _taken_out(key)
    try:
        _run_file(key, Path(name)) if is_file else importlib.import_module(key)
        return [sys.modules[entry] for entry in sorted(_family(key), key=len)]  # the module itself first
    except (Exception, SystemExit) as error:  # whatever the user's module raises
        raise _import_error(error, name, where) from None
    finally:
        if before:
            _taken_out(key)
            _put_back(before)


def _run_file(key: str, path: Path) -> None:
    """Run a file as the module `key`; it can import from its own folder, like a script."""
    spec = spec_from_file_location(key, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    sys.modules[key] = module = module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[key]
        raise
    finally:
        sys.path.remove(str(path.parent))


def _family(name: str) -> list[str]:
    return [entry for entry in sys.modules if entry == name or entry.startswith(f"{name}.")]


def _taken_out(name: str) -> dict[str, ModuleType]:
    return {entry: sys.modules.pop(entry) for entry in _family(name)}


def _put_back(modules: dict[str, ModuleType]) -> None:
    for entry, module in modules.items():
        sys.modules[entry] = module
        parent, _, leaf = entry.rpartition(".")
        if parent in sys.modules:
            setattr(sys.modules[parent], leaf, module)


def _import_error(error: BaseException, name: str, where: str) -> InputError:
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    if missing is not None and (name == missing or name.startswith(f"{missing}.")):
        return InputError(
            f"there is no module '{name}' on Python's path",
            where=where,
            fix=f'name its file, as in "{name.rpartition(".")[2]}.py", or put its folder on PYTHONPATH',
        )
    place = _place(error, name)
    return InputError(
        f"'{name}' cannot be imported{place}: {type(error).__name__}: {error}", where=where, fix="correct the module"
    )


def _place(error: BaseException, name: str) -> str:
    """Line of the user's code that raised the error: the innermost that is no part of Python's import system."""
    if isinstance(error, SyntaxError):
        return f" ({Path(error.filename or name).name}, line {error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith("<frozen") and frame.filename != __file__]
    stays = [frame for frame in own if not frame.filename.startswith(importlib.__path__[0])]
    return f" ({Path(stays[-1].filename).name}, line {stays[-1].lineno})" if stays else ""
