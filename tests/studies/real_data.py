# ruff: noqa: E501
"""Identify and diagnose the measured robots and balls, by the command, and print the figures of docs/results.md.

    python3 tests/studies/real_data.py build/release/apps/diffnea [--only identify|diagnose|ball] [ROBOT …]

The recordings are not part of the project: DIFFNEA_DATA names their folder, else ../shared/data beside the project.
Needs Python alone. Every command is printed.
"""

import argparse
import tempfile
from pathlib import Path

import real_ball
import real_diagnose
import real_identify
from real_robots import Bench, robots_asked_for

STUDIES = {"identify": real_identify, "diagnose": real_diagnose, "ball": real_ball}
ROBOTS = ("emps", "panda", "ur10e", "payload", "double_pendulum", "pendulum", "table_tennis")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=STUDIES, help="do not do the other")
    args, robots = robots_asked_for(parser, ROBOTS)
    for robot in robots:
        for name, studies in STUDIES.items():
            study = getattr(studies, robot, None)  # no torque of the pendulum to identify from
            if study and args.only in (None, name):
                with tempfile.TemporaryDirectory() as folder:
                    study(Bench(args.program.resolve(), Path(folder)))


if __name__ == "__main__":
    main()
