"""Test that wheel and sdist are complete, and that rivid installed from them works in a clean environment."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path
from shutil import copytree, ignore_patterns

import pytest

import rivid

ROOT = Path(__file__).parents[1]
FILES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WHEEL, SDIST = f"rivid-{rivid.__version__}-py3-none-any.whl", f"rivid-{rivid.__version__}.tar.gz"


ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def run(*argv, cwd=None):
    words = [str(one) for one in argv]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, cwd=cwd, env=ENVIRONMENT)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(source, kind, out):
    """Call the build backend without a network."""
    run(
        sys.executable,
        "-c",
        f"from setuptools import build_meta; build_meta.build_{kind}({str(out)!r})",
        cwd=source,
    )


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return wheel and sdist of a copy of the sources, with the files that a build leaves."""
    place = tmp_path_factory.mktemp("packaging")
    source, out = place / "source", place / "dist"
    out.mkdir()
    copytree(ROOT / "rivid", source / "rivid", ignore=ignore_patterns("__pycache__"))
    for name in FILES:
        (source / name).write_bytes((ROOT / name).read_bytes())
    for kind in ("wheel", "sdist"):
        build(source, kind, out)
    return out


def contents(wheel):
    """Return the files in a wheel by name, with their bytes."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_wheel_and_sdist_hold_exactly_the_package_with_its_metadata(built):
    paths = [path for path in (ROOT / "rivid").rglob("*") if path.is_file()]
    expected = {path.relative_to(ROOT).as_posix() for path in paths if "__pycache__" not in path.parts}
    assert {"rivid/py.typed", "rivid/templates/report.html.j2", "rivid/api/day.py"} <= expected
    held = contents(built / WHEEL)
    assert {name for name in held if ".dist-info/" not in name} == expected
    assert any(name.endswith("licenses/LICENSE") for name in held)
    with tarfile.open(built / SDIST) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    assert expected | {"pyproject.toml", "README.md", "LICENSE"} <= sources
    (metadata,) = (data.decode("utf-8") for name, data in held.items() if name.endswith("METADATA"))
    for line in (
        f"Version: {rivid.__version__}", "Requires-Python: >=3.11", "License-Expression: MIT",
        *(f"Classifier: Programming Language :: Python :: 3.{minor}" for minor in range(11, 15)),
    ):  # fmt: skip
        assert line in metadata.splitlines(), line


def test_the_version_is_the_same_everywhere():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert PROJECT["version"] == rivid.__version__
    assert f"version: {rivid.__version__}" in citation and "license: MIT" in citation


def test_the_sdist_builds_the_same_wheel(built, tmp_path):
    with tarfile.open(built / SDIST) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)  # not in Python 3.11.3 and before
        archive.extractall(tmp_path)
    build(tmp_path / SDIST.removesuffix(".tar.gz"), "wheel", tmp_path)
    assert contents(built / WHEEL) == contents(tmp_path / WHEEL)


@pytest.mark.long
def test_the_wheel_works_in_a_clean_environment(built, tmp_path):
    environment = tmp_path / "clean"
    venv.EnvBuilder(symlinks=True).create(environment)
    python = environment / "bin" / "python"
    options = ["--no-deps", "--no-index", "--disable-pip-version-check", "--quiet"]
    run(sys.executable, "-m", "pip", "--python", python, "install", *options, built / WHEEL)
    (site,) = (environment / "lib").glob("python*/site-packages")
    # dependencies come from this environment: there may be no network; .pth files there, such as that of
    # an editable rivid, are not read
    (site / "lent.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    where = run(python, "-c", "import rivid; print(rivid.__file__)", cwd=tmp_path).strip()
    assert Path(where).is_relative_to(environment)
    assert rivid.__version__ in run(environment / "bin" / "rivid", "--version", cwd=tmp_path)
    week, config = ROOT / "sample_data/basse_isere_csv", ROOT / "configs/basse_isere.toml"
    words = ("run", week, "--config", config, "--out", "out", "--quiet")
    run(environment / "bin" / "rivid", *words, cwd=tmp_path)
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
    code = "import rivid; print(rivid.simulate(days=2, seed=1)); print(rivid.diagnose)"
    assert "SimulatedSeason(reach, 2 days" in run(python, "-c", code, cwd=tmp_path)
