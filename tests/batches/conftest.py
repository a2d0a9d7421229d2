"""A folder with skies and materials."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.batches.files import write_folder


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two skies and two materials; not to be changed."""
    return write_folder(tmp_path_factory.mktemp("batch"))
