"""How long a discovery takes, and what memory: python benchmarks/discovery_time.py

Stop-and-go drives by a driver whom no scenario contains, of so many slip events each, healthy and
with a cause to fit; every discovery in a process of its own, its models compiled before.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

DRIVE = """
import resource, sys, time
import clutchest
from clutchest.generator.mismatch import Mismatch

effects = {{"friction_speed": {{"slope": -0.08}}}} if {cause} else None
vehicle = clutchest.load_vehicle("truck")


def drive(seconds):
    return clutchest.simulate(
        vehicle, "city", {seed}, effects, duration=seconds, mismatch=Mismatch(own_driver=True)
    )


clutchest.discover(drive(60.0), vehicle)
log = drive({seconds})
events = sum(len(track.engagements) for track in clutchest.replay(log, vehicle).tracks)
wall, processor = time.perf_counter(), time.process_time()
answer = clutchest.discover(log, vehicle)
print(
    f"{{events:6d}} {{{seconds} / 60:8.0f}} {{answer.verdict:>9s}}"
    f" {{time.perf_counter() - wall:8.1f}} {{time.process_time() - processor:9.1f}}"
    f" {{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:7.0f}}"
)
"""
PER_EVENT = 20.0  # s, about


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, nargs="+", default=[10, 30, 100, 300])
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    print("events  minutes   verdict   wall s  processor   MiB")
    for events in arguments.events:
        for cause in (False, True):
            program = DRIVE.format(cause=cause, seed=arguments.seed, seconds=events * PER_EVENT)
            done = subprocess.run(
                [sys.executable, "-c", program], capture_output=True, text=True, check=False
            )
            print(done.stdout.rstrip() or done.stderr.splitlines()[-1], flush=True)


if __name__ == "__main__":
    main()
