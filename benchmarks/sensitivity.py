"""Measure the sensitivity to settings and world: share of days within one sample; write docs/sensitivity.md.

One thing is changed at a time, on simulated years with known delays. The estimator of Table VI is compared
with the same without its prior on d (uniform, alpha estimated), with alpha fixed, and with Table VI on
shuffled days, which contain no delay. The gain over those is the result of the estimator.

Usage: python -m benchmarks.sensitivity [--seeds N]
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import residual
from benchmarks.accuracy import settings_of
from benchmarks.measure import table
from benchmarks.paper_measures import SCENARIOS, World, changed, of_season, shuffled, within
from rivid.core.fir import jmap
from rivid.core.settings import DEFAULT_ALPHA, JmapSettings
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

ROOT = Path(__file__).parent.parent
Floats = NDArray[np.float64]
DEFAULT = JmapSettings()

LINES = {
    "Table VI": {},
    "no prior on d, alpha estimated": {"prior": "uniform"},
    "no prior on d, alpha fixed": {"prior": "uniform", "alpha": DEFAULT_ALPHA},
}
"""Estimators, by the difference of their settings."""
NOTHING = "Table VI, shuffled days"
ALPHAS = (None, 1e3, 1e4, 1e5, 1e6, 1e7)
OTHERS = {
    "short": "linear, 3 km", "basse_isere": "linear, 8.2 km", "long": "linear, 13.6 km",
    "hydraulic_short": "full equations, 4.5 km", "hydraulic": "full equations, 8.2 km",
    "hydraulic_long": "full equations, 12 km",
}  # fmt: skip


@dataclass(frozen=True)
class Study:
    """A setting or property that is changed.

    Attributes
    ----------
    name, unit : str
        Texts of the panel and the table.
    values : tuple
        Values to be set.
    usual : object
        The value of the sample year or the default.
    where : str
        "settings.KEY", or the scenario's table and key, as "level.noise".
    lines : tuple of str
        The estimators that it affects.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    usual: Any
    where: str
    lines: tuple[str, ...] = tuple(LINES)


STUDIES = (
    Study("order M of the response", "samples", (18, 20, 24, 30, 40, 50, 70), 30, "settings.order"),
    Study("alpha, where it is fixed", "(m³/s)²", (1e2, 1e3, 1e4, 3e4, 1e5, 1e6, 1e7, 1e8), 1e4, "settings.alpha",
          ("no prior on d, alpha fixed",)),
    Study("sigma_d", "T_s", (2, 3, 4, 5, 6, 6.5, 7, 8, 10, 13), 6.5, "settings.delay_scale", ("Table VI",)),
    Study("d_max, M = 2 d_max", "T_s", (8, 10, 12, 15, 20, 25, 30), 15, "settings.d_max"),
    Study("gauge noise", "mm", (0, 1, 2, 3, 5, 8, 12), 3, "level.noise"),
    Study("gauge step", "mm", (0, 2, 5, 10, 20, 30), 10, "level.quantum"),
    Study("feedback K_h", "m²/s", (-120, -270, -605, -1000, -2000), -605, "operators.level_gain"),
    Study("unlogged inflow", "m³/s", (0, 1, 2, 4, 8), 2, "weather.inflow"),
)  # fmt: skip


def worlds(study: Study, value: Any, seeds: range) -> list[World]:
    """Simulate the years with a value."""
    base = load_scenario(SCENARIOS / "basse_isere.toml")
    room, key = study.where.split(".")
    if room != "settings":
        base = changed(base, {room: {key: value / 1000 if study.unit == "mm" else float(value)}})
    return [of_season(simulate(base, seed)) for seed in seeds]


def settings(study: Study, value: Any, line: str) -> JmapSettings:
    """Return the settings of an estimator with a value."""
    chosen: dict[str, Any] = dict(LINES[line])
    room, key = study.where.split(".")
    if room == "settings" and not (key == "alpha" and "alpha" not in chosen):
        chosen[key] = value
    if key == "d_max":
        chosen["order"] = max(2 * value, value + 3)
    return JmapSettings(**chosen)


def run(study: Study, seeds: range, base: list[World]) -> dict[str, Floats]:
    """Return the shares of days within one sample, by estimator; arrays of shape (values, seeds)."""
    lines = [*study.lines, *([NOTHING] if "Table VI" in study.lines else [])]
    found = {line: np.empty((len(study.values), len(seeds))) for line in lines}
    for i, value in enumerate(study.values):
        years = base if study.where.startswith("settings") else worlds(study, value, seeds)
        for j, w in enumerate(years):
            for line in lines:
                u, y = shuffled(w) if line == NOTHING else (w.u, w.y)
                how = settings(study, value, "Table VI" if line == NOTHING else line)
                found[line][i, j] = within(jmap(u, y, how).delay, w)
    return found


def draw(answers: dict[str, dict[str, Floats]], path: Path) -> None:
    """Draw a panel for each study."""
    from rivid.plots import style

    looks = {
        "Table VI": {"color": style.INK, "lw": 1.8, "marker": "o", "ms": 3.5},
        "no prior on d, alpha estimated": {"color": style.ACCENT, "lw": 1.5, "marker": "o", "ms": 3.5},
        "no prior on d, alpha fixed": {"color": style.WATER, "lw": 1.2, "marker": "o", "ms": 3},
        NOTHING: {"color": style.LIGHT, "lw": 1.5, "ls": (0, (4, 2))},
    }
    with style.styled():
        note = "Days within one sample of the true delay [%]; bands: range over the years; upright lines: the defaults"
        figure, panels = style.sheet(
            "Sensitivity of the estimate to its settings", note, [1.55] * 4, [1.0] * 2, gap=(0.6, 0.62), left=0.62,
            right=0.25, top=0.95, bottom=0.62,
        )  # fmt: skip
        for axes, study in zip(panels, STUDIES, strict=False):
            at = np.arange(len(study.values))
            for line, shares in answers[study.name].items():
                mean = 100 * shares.mean(axis=1)
                axes.plot(at, mean, label=line, zorder=3, **looks[line])
                axes.fill_between(
                    at,
                    100 * shares.min(axis=1),
                    100 * shares.max(axis=1),
                    color=looks[line]["color"],
                    alpha=0.13,
                    lw=0,
                )
            axes.axvline(study.values.index(study.usual), color=style.GREY, lw=0.8, ls=(0, (4, 3)), zorder=1)
            axes.set_xticks(
                at,
                [
                    f"{v:.0e}".replace("e+0", "e") if v >= 1e3 else f"{v:g}".replace("-", "−")
                    for v in study.values
                ],
            )
            axes.set_ylim(0, 104)
            axes.set_yticks([0, 25, 50, 75, 100])
            axes.grid(True, axis="y")
            axes.set_xlabel(f"{study.name} [{study.unit}]")
        for axes in panels[len(STUDIES) :]:
            axes.remove()
        style.figure_key(panels[:1], down=0.6, left=0.62)
        style.save(figure, path)


def spread(shares: Floats) -> str:
    """Format the mean over years, lowest to highest, in per cent."""
    return f"{100 * shares.mean():.0f} ({100 * shares.min():.0f}-{100 * shares.max():.0f})"


def section(study: Study, found: dict[str, Floats]) -> str:
    """Return the table of one study, with the defaults in bold."""
    rows = []
    for i, value in enumerate(study.values):
        name = f"**{value:g}**" if value == study.usual else f"{value:g}"
        rows.append([name, *(spread(shares[i]) for shares in found.values())])
    symbol = "_" in study.name.split()[0]
    title = study.name if symbol else study.name[0].upper() + study.name[1:]
    return f"\n## {title}\n\n" + table([f"[{study.unit}]", *found], rows)


def other_reaches(seeds: range) -> tuple[str, dict[str, Floats]]:
    """Compare alpha fixed and estimated without a prior on d, on reaches of both truths."""
    found: dict[str, Floats] = {}
    for name in OTHERS:
        shares = np.empty((len(ALPHAS), 2, len(seeds)))
        for j, seed in enumerate(seeds):
            season = simulate(load_scenario(SCENARIOS / f"{name}.toml"), seed)
            w, own = of_season(season), settings_of(season, True)["jmap"]
            mixed = shuffled(w)
            for i, alpha in enumerate(ALPHAS):
                how = JmapSettings(order=own.order, d_max=own.d_max, prior="uniform", alpha=alpha)
                shares[i, :, j] = within(jmap(w.u, w.y, how).delay, w), within(jmap(*mixed, how).delay, w)
        found[name] = shares
    head = [
        "reach",
        *("estimated" if alpha is None else f"{alpha:.0e}".replace("e+0", "e") for alpha in ALPHAS),
    ]
    rows = [
        [OTHERS[name], *(f"{100 * real.mean():.0f} ({100 * nothing.mean():.0f})" for real, nothing in shares)]
        for name, shares in found.items()
    ]
    text = (
        "\n## Alpha on other reaches\n\nUniform prior, order and d_max from the bounds of each reach; in brackets on shuffled days.\n\n"
        + table(head, rows)
    )
    return text, found


def findings(answers: dict[str, dict[str, Floats]], others: dict[str, Floats]) -> str:
    """Return the conclusions for the defaults with their numbers."""
    by_name = {study.name: study for study in STUDIES}
    free, fixed = "no prior on d, alpha estimated", "no prior on d, alpha fixed"

    def share(name: str, line: str, value: Any = None) -> str:
        study = by_name[name]
        i = study.values.index(study.usual if value is None else value)
        return f"{100 * answers[name][line][i].mean():.0f} %"

    def best(name: str, line: str) -> str:
        means = answers[name][line].mean(axis=1)
        i = int(np.argmax(means))
        return f"{by_name[name].values[i]:g} ({100 * means[i]:.0f} %)"

    def ends(name: str, line: str) -> str:
        values = by_name[name].values
        return f"{share(name, line, values[0])} at {values[0]:g}, {share(name, line, values[-1])} at {values[-1]:g} {by_name[name].unit}"

    def at_alpha(name: str, alpha: float | None) -> str:
        return f"{100 * others[name][ALPHAS.index(alpha), 0].mean():.0f} %"

    M, A, S, D = (study.name for study in STUDIES[:4])
    noise, step, feedback, inflow = (study.name for study in STUDIES[4:])
    return (
        "\n## Conclusions for the defaults\n\n"
        f"- **sigma_d** has the largest influence. Table VI is within one sample on {share(S, 'Table VI')} of days at 6.5, {share(S, 'Table VI', 3)} at 3, {share(S, 'Table VI', 10)} at 10, best {best(S, 'Table VI')}; on shuffled "
        f'days {share(S, NOTHING)} at 6.5, best {best(S, NOTHING)}. So sigma_d must come from the reach, `sigma_d = "bounds"`; 6.5 is the value of the bounds for Table I.\n'
        f"- **M** = 30. Without the prior {share(M, free, 20)} at 20, {share(M, free, 24)} at 24, {share(M, free)} at 30, best {best(M, free)}: the last lags contain the tail that M cuts off, and must lie well beyond d_max. "
        "More than twice d_max gains little, and the time grows with the square of M.\n"
        f"- **alpha** = 1e4, where it is fixed, is the paper's value, {share(A, fixed)} here; the best is {best(A, fixed)}, estimated it gives {share(M, free)}. With the full equations the smaller alpha is better: "
        f"8.2 km {at_alpha('hydraulic', 1e4)} at 1e4, {at_alpha('hydraulic', 1e6)} at 1e6; 4.5 km {at_alpha('hydraulic_short', 1e4)} and {at_alpha('hydraulic_short', 1e6)}. A stiff response finds a sharp front better and a spread one "
        "worse; real fronts are spread, so the default stays.\n"
        f"- **d_max** = 15: without the prior {share(D, free)}, at 8 {share(D, free, 8)}, at 30 {share(D, free, 30)}; a range twice the longest hydraulic delay costs some days, and an estimate at d_max is marked in `at_bound`.\n"
        f"- **The gauge** hides the delay (below): without the prior {ends(noise, free)} of noise, {ends(step, free)} of step. Table VI is less sensitive to it ({ends(noise, 'Table VI')}; on shuffled days {ends(noise, NOTHING)}).\n"
        f"- **The feedback**: {ends(feedback, free)}. **The unlogged inflow**: {ends(inflow, free)}.\n"
    )


def main() -> None:
    """Run all studies, and write table and picture."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=6)
    seeds = range(101, 101 + parser.parse_args().seeds)
    base = [of_season(simulate(load_scenario(SCENARIOS / "basse_isere.toml"), seed)) for seed in seeds]
    answers = {}
    for study in STUDIES:
        answers[study.name] = run(study, seeds, base)
    table_of_others, others = other_reaches(seeds)
    draw(answers, ROOT / "docs" / "pictures" / "sensitivity.png")
    text = (
        "# Sensitivity of the estimate\n\n"
        "Written by `make sensitivity`: one thing changed at a time, from the paper's settings and a year like the sample year. Numbers are per cent of days within one sample of the true delay "
        f"(6 to 8), the mean over {len(seeds)} simulated years of 332 days with the lowest and highest; the value in bold is the default, or the sample year's. Shuffled days take the inflow of one day and the level of "
        "another: the score of Table VI on them is due to its prior.\n\n![shares of days within one sample](pictures/sensitivity.png)\n"
        + findings(answers, others)
        + residual.section()
        + "".join(section(study, answers[study.name]) for study in STUDIES)
        + table_of_others
    )
    (ROOT / "docs" / "sensitivity.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
