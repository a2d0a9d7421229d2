"""Small inputs that earlier versions got wrong: `cases/NAME/case.toml`, a config to bake, with its files beside it."""

from pathlib import Path

CASES = Path(__file__).resolve().parent / "cases"


def case(name: str, file: str = "case.toml") -> Path:
    """Path of a file of a case; by default that of its config."""
    path = CASES / name / file
    assert path.is_file(), path
    return path
