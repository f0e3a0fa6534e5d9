"""Compare the season of the sample year with its true delays; print the last paragraph of docs/season.md.

Usage: python -m benchmarks.season_year
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import rivid

ROOT = Path(__file__).parent.parent


def main() -> None:
    """Run, combine, and compare."""
    truth = json.loads((ROOT / "sample_data" / "basse_isere_truth.json").read_text(encoding="utf-8"))["days"]
    days = pd.DataFrame(truth).set_index("date")
    with tempfile.TemporaryDirectory() as out:
        run = [
            "run",
            "sample_data/basse_isere",
            "-c",
            "configs/posterior.toml",
            "-o",
            out,
            "-q",
            "--no-figures",
        ]
        for words in (run, ["season", out]):
            subprocess.run([sys.executable, "-m", "rivid", *words], cwd=ROOT, check=True, capture_output=True)
        delays = rivid.load_delays(out).query("estimator == 'posterior'")
        alone = delays.set_index(delays["date"].astype(str).str[:10])
        combined = pd.read_csv(Path(out) / "season.csv", index_col="date")["delay_samples"]
        law = json.loads((Path(out) / "delay_law.json").read_text(encoding="utf-8"))
    both = (
        pd.DataFrame({"alone": alone["delay_samples"], "combined": combined}).dropna().join(days, how="inner")
    )
    right = {
        name: int(((both[name] == both["delay_samples"]) | (both[name] == both["delay_other"])).sum())
        for name in ("alone", "combined")
    }
    flow = alone["mean_inflow_m3s"].to_numpy() / law["Q0"]
    b, T0 = np.polyfit(np.log(flow), np.log(days.loc[alone.index, "travel_time_s"]), 1)
    print(
        f"On the sample year, a simulated season that was not used to choose anything here, {len(both)} days have a delay "
        f"both alone and combined: {right['alone']} of them are correct alone, {right['combined']} combined forward. The law "
        f"is T = {law['T0']:.0f} s (Q / {law['Q0']:.0f})^-{law['b']:.3f} ({law['b_low']:.3f} to {law['b_high']:.3f}); a line "
        f"through the true travel times gives {np.exp(T0):.0f} s and {-b:.3f}."
    )


if __name__ == "__main__":
    main()
