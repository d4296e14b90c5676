"""``rerun-importer-clutchest``: Rerun's viewer opens CAN logs, with the estimates over them.

The viewer starts it with every file that it is given, and takes a recording from its standard
output.  The vehicle is ``CLUTCHEST_VEHICLE``, a file or a shipped one, else the vehicle file that
lies beside the log.  Files that are no logs, and logs without a vehicle, are left to others.
"""

from __future__ import annotations

import argparse
import os
import sys
import tomllib
from pathlib import Path
from typing import NoReturn

NOT_OURS = 66  # as the viewer wants it said
SUFFIXES = {
    *(".asc", ".blf", ".crtd", ".csv", ".db", ".log", ".mf4", ".pcap", ".trc"),  # of frames
    *(".mat", ".mdf", ".parquet", ".tdms", ".xlsx"),  # of tables
}
VEHICLE = "CLUTCHEST_VEHICLE"


def main() -> None:
    """Write the recording of a log to standard output, or end with ``NOT_OURS``."""
    parser = argparse.ArgumentParser(prog="rerun-importer-clutchest")
    parser.add_argument("path", type=Path)
    parser.add_argument("--application-id", default="clutchest")
    parser.add_argument("--recording-id")
    given, _ = parser.parse_known_args()  # the viewer has more to say than is needed
    path: Path = given.path
    plain = path.name.lower().removesuffix(".gz")
    if Path(plain).suffix not in SUFFIXES or not path.is_file():
        sys.exit(NOT_OURS)
    vehicle = vehicle_of(path)
    if vehicle is None:
        _leave(f"{path.name}: no vehicle file beside it, and {VEHICLE} is not set")
    send(path, vehicle, given.application_id, given.recording_id)


def vehicle_of(log: Path) -> str | None:
    """The vehicle of a log: of the environment, else the only vehicle file beside it."""
    if stated := os.environ.get(VEHICLE):
        return stated
    beside = [file for file in sorted(log.parent.glob("*.toml")) if _is_vehicle(file)]
    return str(beside[0]) if len(beside) == 1 else None


def _is_vehicle(file: Path) -> bool:
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return {"name", "model"} <= set(content)


def send(path: Path, vehicle: str, application: str, recording: str | None) -> None:
    """Estimate over the log and send the recording."""
    import rerun as rr

    from clutchest.errors import ClutchestError
    from clutchest.estimate.replay import replay
    from clutchest.record.rerun import send_run

    try:
        run = replay(path, vehicle)
    except ClutchestError as problem:
        _leave(str(problem))
    stream = rr.RecordingStream(application, recording_id=recording, send_properties=False)
    stream.stdout()
    send_run(stream, run)
    stream.flush()
    stream.disconnect()


def _leave(why: str) -> NoReturn:
    print(f"clutchest: {why}", file=sys.stderr)
    sys.exit(NOT_OURS)


if __name__ == "__main__":
    main()
