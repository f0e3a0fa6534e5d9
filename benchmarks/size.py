"""Measure the size of the project: ``python -m benchmarks.size [CHECKOUT]`` prints a table.

Code lines are those without blanks, comments and docstrings. Result types are dataclasses and named tuples.
The files of a day's log are the modules of rivid/ in which a function runs between the start of a run of one
day of sample_data and its tables, in one process and without figures.
"""

import ast
import io
import subprocess
import sys
import tokenize
from collections import defaultdict
from pathlib import Path

SILENT = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
}  # fmt: skip
SMALL = 60
"""Code lines below which a file counts as small."""
ONE_DAY = """
import datetime as dt, sys, tempfile
from pathlib import Path
import rivid
from rivid.config import load_config
from rivid.run.run import Options, run
root, seen = str(Path(rivid.__file__).parent), set()
config, day = load_config(Path("configs/basse_isere.toml")), dt.date(2008, 3, 12)
options = Options(workers=1, first=day, last=day, figures=False)
sys.setprofile(lambda frame, event, _: seen.add(frame.f_code.co_filename))
with tempfile.TemporaryDirectory() as folder:
    run(Path("sample_data/basse_isere_csv"), Path(folder), config, options)
sys.setprofile(None)
print(sum(name.startswith(root) for name in seen))
"""


def code_lines(text: str) -> int:
    """Return the number of lines of a module that contain code."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            if isinstance(node.value.value, str):
                docstrings.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - docstrings)


def result_types(text: str) -> int:
    """Return the number of dataclasses and named tuples of a module."""
    return sum(
        any("dataclass" in ast.unparse(d) for d in node.decorator_list)
        or any("NamedTuple" in ast.unparse(b) for b in node.bases)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ClassDef)
    )


def main(root: Path) -> None:
    """Print the table."""
    texts = {
        p.relative_to(root): p.read_text(encoding="utf-8") for p in sorted((root / "rivid").rglob("*.py"))
    }
    lines = {path: len(text.splitlines()) for path, text in texts.items()}
    code = {path: code_lines(text) for path, text in texts.items()}
    tests = sum(len(p.read_text(encoding="utf-8").splitlines()) for p in (root / "tests").rglob("*.py"))
    day = subprocess.run([sys.executable, "-c", ONE_DAY], cwd=root, capture_output=True, text=True)
    print(f"lines in rivid/ (code lines)       {sum(lines.values()):,} ({sum(code.values()):,})")
    print(f"package files, under {SMALL} code lines {len(texts)}, {sum(n < SMALL for n in code.values())}")
    print(f"result types                       {sum(map(result_types, texts.values()))}")
    print(f"files that a day's log passes      {day.stdout.strip() or 'not measured'}")
    print(f"lines in tests/                    {tests:,}")
    folders: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
    for path in texts:
        name = path.parts[1]
        folders[name] = [a + b for a, b in zip(folders[name], (1, lines[path], code[path]), strict=True)]
    for name, (files, total, bare) in sorted(folders.items(), key=lambda item: -item[1][1]):
        print(f"  {name:22} {files:4} files {total:7,} lines {bare:7,} of code")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else Path(__file__).resolve().parents[1])
