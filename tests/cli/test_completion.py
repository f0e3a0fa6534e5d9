"""Test completion with Tab, its imports, and the scripts for the shells."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rivid.cli import COMMANDS
from rivid.effects import effect_classes
from rivid.estimators import ESTIMATORS

HEAVY = {"numpy", "pandas", "matplotlib", "scipy", "pyarrow", "pydantic"}


def complete(*words, cwd=None):
    """Return the completions of the last word, and the loaded modules."""
    given = {"COMP_WORDS": " ".join(("rivid", *words)), "COMP_CWORD": str(len(words))}
    env = os.environ | given | {"_RIVID_COMPLETE": "bash_complete"}
    call = [sys.executable, "-X", "importtime", "-c", "from rivid.cli import main; main()"]
    done = subprocess.run(call, env=env, capture_output=True, text=True, cwd=cwd)
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert done.returncode == 0 and all(line.startswith("import time:") for line in done.stderr.splitlines())
    return [line.partition(",")[2] for line in done.stdout.splitlines()], loaded


def test_commands_options_estimators_and_effects_complete_without_heavy_imports():
    from rivid.cli.effects import _names

    for words, expected in (
        (("s",), [name for name in COMMANDS if name.startswith("s")]),
        (("run", "--es"), ["--estimator"]),
        (("run", "--estimator", "jmap"), [name for name in ESTIMATORS if name.startswith("jmap")]),
        (("effects", "leak"), ["leakage"]),
    ):
        offered, loaded = complete(*words)
        assert offered == expected and not loaded & HEAVY
    assert sorted(_names(None, None, "")) == sorted(effect_classes(None))


def test_reaches_of_a_fleet_complete(tmp_path):
    for name in ("upper", "lower", "unlike"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").touch()
    assert complete("season", str(tmp_path), "--reach", "u")[0] == ["unlike", "upper"]


@pytest.mark.parametrize(
    ("shell", "location"),
    [("bash", "~/.bashrc"), ("zsh", "in a directory of $fpath"), ("fish", "~/.config/fish/completions/")],
)
def test_the_script_of_a_shell_names_its_location(rivid, shell, location):
    script = rivid("completion", shell).output
    comments = [line for line in script.splitlines() if line.startswith("# ")]
    assert location in " ".join(comments) and max(map(len, comments)) <= 80
    assert f"{shell}_complete" in script
    assert (script.splitlines()[0] == "#compdef rivid") == (shell == "zsh")


def test_another_shell_is_refused_with_a_list(rivid):
    done = rivid("completion", "tcsh")
    assert done.code == 2 and "'bash', 'zsh', 'fish'" in str(done.exception)


def test_bash_completes_with_the_script(tmp_path):
    bash = shutil.which("bash")
    assert bash, "bash is needed to try its script"
    (tmp_path / "rivid").write_text(
        f"#!/bin/sh\nexec {sys.executable} -c 'from rivid.cli import main; main()' \"$@\"\n"
    )
    (tmp_path / "rivid").chmod(0o755)
    script = (
        'eval "$(rivid completion bash)"\n'
        "COMP_WORDS=(rivid run --estimator cus) COMP_CWORD=3\n"
        '_rivid_completion rivid\necho "${COMPREPLY[@]}"\ncomplete -p rivid'
    )
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    cwd = Path(__file__).parents[2]
    done = subprocess.run([bash, "-c", script], env=env, capture_output=True, text=True, cwd=cwd)
    assert done.stderr == ""
    assert done.stdout.splitlines()[0] == "cusum-ml cusum-map"
    assert "_rivid_completion rivid" in done.stdout.splitlines()[1]
