"""Report on the health of a bake: `health.html`, `health.json`, and images."""

from __future__ import annotations

from pathlib import Path

from rsibr.store.atomic import unwritable, write_atomic
from rsibr.store.directory import make_own_folder
from rsibr.validation.health.health import Health
from rsibr.validation.health.health_document import HealthModel
from rsibr.validation.report import pictures
from rsibr.validation.report.page import render

PAGE_NAME = "health.html"
JSON_NAME = "health.json"
PICTURES_NAME = "pictures"


def write_health(health: Health, directory: Path) -> Path:
    """Write the health report as HTML, as JSON, and as images.

    Parameters
    ----------
    health : Health
        Result of a check.
    directory : Path
        Created if it does not exist. Files of an earlier check are replaced atomically, the page last.

    Returns
    -------
    Path
        Path of the page, `directory / "health.html"`.

    Raises
    ------
    BakeError, MachineError
        If the directory cannot be written.
    """
    write_health_pictures(health, directory)
    write_atomic(directory / JSON_NAME, HealthModel.of(health).to_json().encode())
    write_atomic(directory / PAGE_NAME, render("check.html.j2", health=health).encode())
    return directory / PAGE_NAME


def write_health_pictures(health: Health, directory: Path) -> None:
    """Write `pictures/health_view_0000.png` … in full size; files of an earlier check are removed."""
    folder = directory / PICTURES_NAME
    files = {f"health_view_{view:04d}.png": picture for view, picture in health.pictures.items()}
    try:
        make_own_folder(folder)
        for stale in folder.glob("health_view_[0-9]*.png"):
            if stale.name not in files:
                stale.unlink()
    except OSError as error:
        raise unwritable(folder, error) from error
    for name, picture in files.items():
        write_atomic(folder / name, pictures.png(picture))
