"""Turn a recording of another format into CSV.

python -m diffnea.convert log.mcap -o log.csv
python -m diffnea.convert log.mcap --list
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ._core import Error, FileError
from ._files import read_recordings, write_recording
from ._readers import Selection, read_table, ros

_TEXT = """
reads:
  .mcap, .db3, a folder with metadata.yaml   ROS 2 bags   needs rosbags
  .bag                                       ROS 1 bags   needs rosbags
  .mat                                       MATLAB       needs h5py and SciPy
  .parquet                                   Parquet      needs pandas and pyarrow
  a folder with meta/info.json               LeRobot      needs pandas and pyarrow
  .json with entries                         BAM
  .npz, .csv

`diffnea` reads all of them itself, through this module. Write CSV where a log is read often, or
where no Python is at hand.

Of a bag the messages of one topic of type sensor_msgs/JointState are read: position becomes
q_JOINT, velocity qd_JOINT, effort tau_JOINT; time starts at 0. Commands of another topic
(--command-topic, JointState or JointTrajectory) become qcmd_JOINT, qdcmd_JOINT and taucmd_JOINT,
each held until the next. MATLAB
and NPZ files hold arrays time (N,), q and tau (N, n), joint_names; or the columns by their
names. What cannot be true is left out, as with CSV files, and said.

What columns cannot hold (is torque measured at the motor or the link? which joints are passive?)
goes into a JSON file beside the output, from the options below and from the file LOG.json beside
the input, if there is one.

examples:
  python -m diffnea.convert log.mcap --list
  python -m diffnea.convert log.mcap --topic /arm/joint_states --torque-side link -o log.csv
  python -m diffnea.convert episodes/ --map "action.gripper.pos=" -o log.csv
  diffnea identify arm.urdf log.csv -o run
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m diffnea.convert",
        description="Turn a recording of another format into CSV.",
        epilog=_TEXT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", type=Path, help="the recording: a file, or the folder of a bag")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("-o", "--output", type=Path, help="file to write: .csv or .parquet")
    what.add_argument("--columns-into", type=Path, help=argparse.SUPPRESS)  # of the command
    what.add_argument("--list", action="store_true", help="list the topics of a bag, and stop")
    parser.add_argument("--topic", help="of a bag, where several have joint states")
    parser.add_argument("--command-topic", help="of a bag: the topic of commands")
    parser.add_argument(
        "--map",
        default="",
        metavar="COLUMN=NAME",
        help='columns by other names, "gripper.pos=q_gripper [deg],extra=", or a JSON file',
    )
    parser.add_argument(
        "--clock",
        choices=ros.CLOCKS,
        default="header",
        help="of a bag: the stamps of the messages (default), or when they were recorded",
    )
    parser.add_argument(
        "--joints", nargs="+", default=[], metavar="JOINT", help="of a bag: only these"
    )
    parser.add_argument("--torque-side", choices=("motor", "link"), help="where it was measured")
    parser.add_argument("--torque-sampling", choices=("hold", "instant"), help="how it acts")
    parser.add_argument(
        "--passive", nargs="+", default=[], metavar="JOINT", help="torque known to be zero"
    )
    parser.add_argument("--period", type=float, help="of a periodic motion [s]")
    parser.add_argument("--force", action="store_true", help="overwrite what is there")
    parser.add_argument("--quiet", action="store_true", help="print no notes")
    return parser


def _list_topics(log: Path) -> None:
    if not log.exists():
        raise FileError(f"{log}: there is no such file")
    for topic, count in ros.topics(log).items():
        print(f"{topic}  {count} messages")


def _write_columns(options: argparse.Namespace) -> None:
    """Write the columns as the reader has them, and its notes; the command checks them itself."""
    selection = Selection(options.topic, options.clock, options.joints, options.command_topic)
    table = read_table(options.log, selection)
    options.columns_into.mkdir()
    table.write(options.columns_into / "columns.csv")
    notes = "".join(f"{' '.join(note.split())}\n" for note in table.notes)
    (options.columns_into / "notes.txt").write_text(notes, encoding="utf-8")


def _convert(options: argparse.Namespace) -> None:
    output: Path = options.output
    beside = output.with_suffix(".json")
    given = (options.torque_side, options.torque_sampling, options.passive, options.period)
    # The file that describes the input may be that of the output, and stays if it says it all.
    is_described = beside == options.log.with_suffix(".json") and beside.exists()
    keep = is_described and not any(given) and not options.force
    if not options.force:
        for path in (output, *([] if keep else [beside])):
            if path.exists():
                raise FileError(f"{path}: is there already; --force overwrites it")
    if output.resolve() == options.log.resolve():
        raise FileError(f"{output}: is the input; choose another name with -o")
    runs = read_recordings(
        options.log,
        torque_side=options.torque_side,
        torque_sampling=options.torque_sampling,
        passive=options.passive,
        period=options.period,
        topic=options.topic,
        clock=options.clock,
        joints=options.joints,
        command_topic=options.command_topic,
        columns=options.map,
    )
    if not output.parent.is_dir():
        raise FileError(f"{output.parent}: there is no such folder")
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".diffnea-") as folder:
        staged = Path(folder) / output.name
        write_recording(runs, staged)
        staged.replace(output)
        if not keep:
            staged.with_suffix(".json").replace(beside)
    if not options.quiet:
        for note in runs.report.notes:
            print(note, file=sys.stderr)
        joints = ", ".join(runs[0].joint_names)
        rows = sum(map(len, runs))
        print(f"{output}: {rows} rows, {len(runs)} run(s); joints {joints}", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status: 0 done, 1 bad input, 2 wrong usage."""
    options = _parser().parse_args(arguments)
    try:
        if options.list:
            _list_topics(options.log)
        elif options.columns_into:
            _write_columns(options)
        else:
            _convert(options)
    except (Error, ImportError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
