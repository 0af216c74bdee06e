"""Run the jobs, print the table, write benchmarks/results.json."""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path

from .measure import document, table

JOBS = {
    "j1": "operating_grid",
    "j2": "one_simulation",
    "j3": "closed_loop_campaign",
    "j4": "design_of_a_schedule",
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("jobs", nargs="*", choices=[[], *JOBS], help="which jobs (default: all)")
    parser.add_argument(
        "--smallest",
        action="store_true",
        help="the smallest size, once: shows that everything still runs",
    )
    given = parser.parse_args()
    rows = []
    for job in given.jobs or JOBS:
        rows += importlib.import_module(f".{JOBS[job]}", __package__).rows(smallest=given.smallest)
    print(table(rows))
    if not given.smallest:
        (Path(__file__).parent / "results.json").write_text(
            json.dumps(document(rows), indent=1) + "\n"
        )


if __name__ == "__main__":
    main()
