"""Figures without pixels, for tests that do not inspect them."""

import pytest
from PIL import Image

import rivid.fleet.run
import rivid.run.run
from rivid.atomic import replacing
from rivid.plots import style

PLACES = {"cli", "faults", "fleet", "results", "run", "test_readme.py"}
"""Folders and files of tests that do not inspect figures."""

SAVE, CORES = style.save, rivid.run.workers.cores
USERS = (rivid.run.workers, rivid.run.run, rivid.fleet.run)


def blank(figure, path):
    """Write a picture of one pixel: rendering takes most of the time of a short run."""
    with replacing(path) as scratch:
        Image.new("P", (1, 1)).save(scratch, "PNG")


@pytest.fixture(scope="module", autouse=True)
def unrendered(request):
    """In some folders, draw figures in this process without rendering; see `rendered`."""
    with pytest.MonkeyPatch.context() as patch:
        if PLACES & {request.path.parent.name, request.path.name}:
            patch.setattr(style, "save", blank)
            for module in USERS:
                patch.setattr(module, "cores", lambda: 1)
        yield


@pytest.fixture
def rendered(monkeypatch):
    """Draw real figures, by processes as in use."""
    monkeypatch.setattr(style, "save", SAVE)
    for module in USERS:
        monkeypatch.setattr(module, "cores", CORES)
