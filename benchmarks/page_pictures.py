"""Check the report page of a run in a browser: wide, narrow, dark, enlarged and printed.

Usage: python -m benchmarks.page_pictures OUT [--keep PICTURE.png] [--into FOLDER]

OUT is the folder of `rivid run`. The check fails if the page requests another file, logs to the console, is
wider than a narrow screen, has text of low contrast, does not enlarge its figures, or prints a figure across
two pages.
"""

import io
import re
import sys
from argparse import ArgumentParser
from collections import Counter
from pathlib import Path

from benchmarks.browser import NAMES, Tab, browser, installed

WIDE, NARROW = 1100, 420
"""Widths of the two screens [CSS pixels]."""

TOP = 1400
"""Height of the page in the picture of the readme, from the top [CSS pixels]."""

MOST_BYTES = 400_000
"""Largest size of the picture of the readme [bytes]."""

READABLE = 4.5
"""Smallest contrast of text, by the Web Content Accessibility Guidelines 2.2, AA."""

SHOWN = """Promise.all([...document.images].map(i => i.decode().then(() => '', () => i.src.slice(0, 60))))
  .then(all => all.filter(Boolean))"""

OVERFLOW = """[...document.querySelectorAll('body *')].filter(e => {
  for (let up = e; up; up = up.parentElement)
    if (getComputedStyle(up).overflowX != 'visible') return false;
  return e.getBoundingClientRect().x + e.scrollWidth > innerWidth + 1;
}).map(e => e.outerHTML.slice(0, 60)).pop()"""

CONTRAST = """(() => {
  const rgb = s => s.match(/[\\d.]+/g).map(Number);
  const light = c => { const [r, g, b] = c.slice(0, 3).map(v => (v /= 255) <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
    return .2126 * r + .7152 * g + .0722 * b };
  const behind = e => { for (; e; e = e.parentElement) { const c = rgb(getComputedStyle(e).backgroundColor);
    if (c.length < 4 || c[3] > 0) return c } return [255, 255, 255] };
  const poor = [];
  for (const e of document.querySelectorAll('h1,h2,h3,p,li,dt,dd,td,th,a,strong,summary,figcaption,footer,span')) {
    if (!e.textContent.trim()) continue;
    const [a, b] = [light(rgb(getComputedStyle(e).color)), light(behind(e))];
    const ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    if (ratio < LIMIT) poor.push(`${e.tagName} ${ratio.toFixed(1)}: ${e.textContent.trim().slice(0, 40)}`);
  }
  return poor.slice(0, 3);
})()""".replace("LIMIT", str(READABLE))

MIDDLE = """(() => { const e = document.querySelectorAll('.zoom')[WHICH];
  e.scrollIntoView({behavior: 'instant', block: 'center'});
  const box = e.closest('.card').getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2, scrollY] })()"""

OPEN = """(() => { const e = document.querySelector('.card:popover-open'); if (!e) return null;
  const box = e.getBoundingClientRect(), img = e.querySelector('img').getBoundingClientRect();
  return [box.x, box.y, box.width - innerWidth, box.height - innerHeight, img.width] })()"""


def faults(tab: Tab, page: Path, into: Path) -> list[str]:
    """Render a page in several ways, write pictures of it, and return its faults.

    Parameters
    ----------
    tab : Tab
    page : Path
        A report.html.
    into : Path
        Folder of the pictures: wide.png, dark.png, narrow.png, enlarged.png and print.pdf.
    """
    into.mkdir(parents=True, exist_ok=True)
    found = []
    tab.size(WIDE, TOP)
    tab.look()
    tab.open(page)
    found += [f"cannot be shown: {address}" for address in tab.value(SHOWN)]
    for name, dark in (("wide", False), ("dark", True)):
        tab.look(dark=dark)
        found += [f"{name}: hard to read, {text}" for text in tab.value(CONTRAST)]
        tab.picture(into / f"{name}.png")
    tab.look()
    found += _enlarged(tab, into)
    for width in (WIDE, NARROW):
        tab.size(width, 900)
        if (wider := tab.value("document.documentElement.scrollWidth")) > width:
            found.append(f"at {width} pixels the page is {wider} wide: {tab.value(OVERFLOW)}")
    tab.value("scrollTo(0, 0)")
    tab.picture(into / "narrow.png")
    figures = tab.value("document.images.length")
    tab.paper(into / "print.pdf")
    found += cut((into / "print.pdf").read_bytes(), figures)
    others = [address for address in tab.requests if address != page.resolve().as_uri()]
    found += [f"asks for {address}" for address in others]
    found += [f"console message: {text}" for text in tab.complaints]
    return found


def _enlarged(tab: Tab, into: Path) -> list[str]:
    """Check that a click on each figure enlarges it to the whole window, and that Esc closes it in place."""
    found = []
    tab.size(1600, 900)
    for which in range(tab.value("document.querySelectorAll('.zoom').length")):
        x, y, scroll = tab.value(MIDDLE.replace("WHICH", str(which)))
        before = tab.value("document.documentElement.scrollHeight")
        tab.click(x, y)
        box = tab.value(OPEN)
        if box is None or any(box[:4]):
            found.append(f"figure {which}: a click does not enlarge it to the window ({box})")
            continue
        if which == 0:
            tab.picture(into / "enlarged.png")
        during = tab.value("document.documentElement.scrollHeight")
        tab.key("Escape", 27)
        if tab.value(OPEN) is not None:
            found.append(f"figure {which}: Esc does not close it")
        after = (tab.value("document.documentElement.scrollHeight"), tab.value("scrollY"))
        if during != before or after != (before, scroll):
            found.append(f"figure {which}: the page behind it moves")
    return found


def cut(pdf: bytes, figures: int) -> list[str]:
    """Count the figures of a printed page that are divided between two sheets, and the missing ones.

    Parameters
    ----------
    pdf : bytes
        Output of Chromium: an image is one object, however often it is shown.
    figures : int
        Number of images of the page.
    """
    images = {
        int(found[1])
        for found in re.finditer(rb"(?m)^(\d+) 0 obj\n(.*?)endobj", pdf, re.S)
        if b"/Subtype /Image" in found[2][:400]
    }
    sheets: Counter[int] = Counter()
    for found in re.finditer(rb"(?m)^\d+ 0 obj\n<</Type /Page\n(.*?)endobj", pdf, re.S):
        listed = re.search(rb"/XObject <<(.*?)>>", found[1], re.S)
        named = re.findall(rb"/X\d+ (\d+) 0 R", listed[1]) if listed else []
        sheets.update(number for text in named if (number := int(text)) in images)
    twice = sum(1 for times in sheets.values() if times > 1)
    faults = [f"printed: {twice} figures are cut in two"] if twice else []
    if len(sheets) != figures:
        faults.append(f"printed: {len(sheets)} of {figures} figures are there")
    return faults


def keep(tab: Tab, page: Path, path: Path) -> int:
    """Write the top of the page as a picture of 256 colours; return its size [bytes]."""
    from PIL import Image

    tab.size(WIDE, TOP)
    tab.look()
    tab.open(page)
    tab.value(SHOWN)
    tab.picture(path)
    image = Image.open(io.BytesIO(path.read_bytes())).convert("RGB")
    image.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, "PNG", optimize=True)
    return path.stat().st_size


def main() -> int:
    """Check the page of OUT, and write the pictures."""
    parser = ArgumentParser(prog="python -m benchmarks.page_pictures", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="OUT of a run")
    parser.add_argument("--keep", type=Path, help="file of the top of the page, for the readme")
    parser.add_argument(
        "--into", type=Path, default=Path("out/page_pictures"), help="folder of the other pictures"
    )
    given = parser.parse_args()
    page, program = given.out / "report.html", installed()
    if not page.is_file():
        raise SystemExit(f"{page} does not exist: run `rivid run DATA_DIR --out {given.out}` first")
    if program is None:
        raise SystemExit(f"no browser on PATH: install one of {', '.join(NAMES)}")
    with browser(program) as tab:
        found = faults(tab, page, given.into)
        if given.keep:
            size = keep(tab, page, given.keep)
            print(f"{given.keep}: {size / 1000:.0f} kB")
            if size > MOST_BYTES:
                found.append(f"{given.keep} is larger than {MOST_BYTES // 1000} kB")
    for text in found:
        print(text)
    print(
        f"{page}: {page.stat().st_size / 1e6:.2f} MB, {len(found) or 'no'} faults; pictures in {given.into}"
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
