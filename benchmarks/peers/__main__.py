"""Compare `posterior` with common alternatives, and with days joined over a season; write docs/peers.md.

Usage: python -m benchmarks.peers [--days N --seeds N --first-seed N --season-days N --quick]
"""

import argparse
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.measure import machine, table
from benchmarks.peers.running import CANDIDATES, OURS, PEERS, POSTERIOR, Run, check, installed, run
from benchmarks.peers.seasons import section
from benchmarks.posterior.score import wilson
from rivid.errors import RividError

PAGE = Path(__file__).parents[2] / "docs" / "peers.md"
HEAD = Path(__file__).parent / "head.md"
SEASONS = Path(__file__).parent / "seasons_head.md"


def share(hits: np.ndarray) -> str:
    """Format a share with its 95 % interval."""
    k, n = int(np.sum(hits)), len(hits)
    low, high = wilson(k, n)
    return f"{k / max(n, 1):.3f} ({low:.3f}-{high:.3f})"


def page(found: Run, easy: dict[str, float], words: str, limits: str) -> str:
    """Return the page in Markdown."""
    parts = [HEAD.read_text(encoding="utf-8").format(words=words, d_max=CANDIDATES[-1])]
    for linear, title in ((True, "Linear worlds"), (False, "Hydraulic worlds")):
        rows = []
        for name, tally in found.tallies.items():
            error = tally.of(linear)
            ms = [m for m, w in zip(tally.ms, tally.world, strict=True) if w.startswith("linear") == linear]
            rows.append([name, share(error == 0), share(error <= 1), f"{np.median(ms):.2f}"])
        whole = found.tallies[POSTERIOR]
        names = np.concatenate([[w] * len(e) for w, e in zip(whole.world, whole.error, strict=True)])
        mine = np.char.startswith(names.astype(str), "linear") == linear
        kept = whole.of(linear)[found.answered[mine]]
        rows.insert(
            1,
            [
                f"of these, the {kept.size / mine.sum():.0%} that it answers",
                share(kept == 0),
                share(kept <= 1),
                "",
            ],
        )
        rows.append(["one delay for all days, the best", f"{found.constant[linear]:.3f}", "", ""])
        parts.append(
            f"## {title}: {int(mine.sum())} days\n\n"
            + table(["method", "exact", "within one", "ms a day"], rows)
        )
    rows = [[name, f"{value:.3f}"] for name, value in easy.items()]
    parts.append(
        "## Easy days\n\nShare of exact delays in open loop, where any method should be right.\n\n"
        + table(["method", "exact"], rows)
    )
    parts.append(SEASONS.read_text(encoding="utf-8") + "\n" + limits)
    return "\n".join(parts)


def main() -> None:
    """Check the peers on easy days, run all methods, and print and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--days", type=int, default=60, help="days of each world and seed")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=700)
    parser.add_argument("--season-days", type=int, default=60)
    parser.add_argument("--quick", action="store_true", help="installed peers only, few days, no page")
    options = parser.parse_args()
    threadpool_limits(1)
    peers = installed()
    if len(peers) < len(PEERS) and not options.quick:
        raise RividError(f"not installed: {', '.join(set(PEERS) - set(peers))}: install the extra `bench`")
    easy = check(peers)
    days, seeds = (12, 1) if options.quick else (options.days, options.seeds)
    seasons = 16 if options.quick else options.season_days
    chosen = range(options.first_seed, options.first_seed + seeds)
    found = run({POSTERIOR: OURS[POSTERIOR]} | peers | OURS, "proof", chosen, days)
    words = f"{machine()}, numpy {np.__version__}, one thread; seeds {chosen[0]} to {chosen[-1]}, {days} days of each"
    text = page(found, easy, words, section("proof", chosen, seasons))
    print(text)
    if not options.quick:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
