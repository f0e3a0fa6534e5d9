"""Split the record of the Colorado River below Glen Canyon Dam into one CSV a day.

    python sample_data/glen_canyon/make.py RECORD.csv

RECORD.csv has the columns of the README, a row every 15 minutes. Cells are copied as they are, but for a
final ".0"; the same record gives the same bytes.
"""

import sys
from itertools import groupby
from pathlib import Path

HERE = Path(__file__).parent
HEADER = "time,power_release_cfs,bypass_release_cfs,total_release_cfs,lees_ferry_cfs,rm30_cfs,rm61_cfs"


def main(record: Path) -> int:
    """Write the days beside this script; their number."""
    header, *rows = record.read_text(encoding="utf-8").splitlines()
    if header != HEADER:
        raise SystemExit(f"{record} has the columns {header}: expected {HEADER}")
    days = 0
    for date, of_day in groupby(rows, key=lambda row: row[:10]):
        lines = [header, *(row.replace(".0,", ",").removesuffix(".0") for row in of_day)]
        (HERE / f"{date}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        days += 1
    return days


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    print(f"{main(Path(sys.argv[1]))} days")
