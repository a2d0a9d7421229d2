"""Digests of code: every change in a package is seen, wherever it lies and however it is stored."""

import compileall
import sys
import zipfile

import pytest

from rsibr.source_code import definition_digest, source_digest


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return the folder of an importable package with a package in it."""
    folder = tmp_path / "shelf" / "digested"
    (folder / "inner").mkdir(parents=True)
    for file in ("__init__.py", "inner/__init__.py", "inner/part.py", "method.py"):
        (folder / file).write_text("x = 1\n")
    monkeypatch.syspath_prepend(str(folder.parent))
    source_digest.cache_clear()
    yield folder
    source_digest.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "digested"]:
        del sys.modules[name]


def digest():
    source_digest.cache_clear()
    return source_digest("digested")


def test_every_file_of_a_package_counts_and_nothing_is_imported(package):
    seen = {digest()}
    for file in ("__init__.py", "inner/__init__.py", "inner/part.py", "method.py"):
        (package / file).write_text("raise RuntimeError('never imported')\n")
        seen.add(digest())
    (package / "inner" / "more.py").write_text("")
    seen.add(digest())
    assert len(seen) == 6
    assert digest() in seen


def test_a_module_alone_counts_alone(package):
    source_digest.cache_clear()
    before = source_digest("digested.method")
    (package / "inner" / "part.py").write_text("x = 2\n")
    source_digest.cache_clear()
    assert source_digest("digested.method") == before


def test_a_zip_archive_has_the_digest_of_its_files(package, tmp_path, monkeypatch):
    expected, archive = digest(), tmp_path / "packed.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        for file in sorted(package.rglob("*.py")):
            packed.write(file, file.relative_to(package.parent))
    package.rename(package.with_name("gone"))
    monkeypatch.syspath_prepend(str(archive))
    assert digest() == expected


def test_byte_code_without_source_is_told_apart(package):
    """As in an installation without `.py` files."""
    seen = set()
    for text in ("x = 1\n", "x = 2\n"):
        (package / "method.py").write_text(text)
        compileall.compile_dir(package, quiet=2, legacy=True, force=True)
        sources = {file: file.read_text() for file in package.rglob("*.py")}
        for file in sources:
            file.unlink()
        seen.add(digest())
        for file, kept in sources.items():
            file.write_text(kept)
    assert len(seen) == 2


def test_what_no_module_defines_is_told_apart_by_its_own_code():
    """As in a notebook, where there may be no text."""

    def made(text):
        names = {"__name__": "__main__"}
        exec(compile(text, "<nowhere>", "exec"), names)
        return definition_digest(names["Method"])

    plain = "class Method:\n    def eval(self, n): return {}\n"
    assert made(plain.format(1)) == made("\n\n" + plain.format(1))
    assert made(plain.format(1)) != made(plain.format(2))


def test_a_function_has_the_digest_of_its_package():
    assert definition_digest(source_digest) == source_digest("rsibr")
