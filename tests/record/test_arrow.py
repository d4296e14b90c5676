import subprocess
import sys

WITHOUT = """
import sys
import numpy as np
import pyarrow as pa
from clutchest.record.arrow import without_pandas

with without_pandas():
    pa.table({"a": np.arange(3.0), "b": ["x", "y", "z"]})
assert "pandas" not in sys.modules
assert pa.table({"a": np.arange(3.0)}).to_pandas()["a"].tolist() == [0.0, 1.0, 2.0]
"""


def test_arrow_takes_arrays_without_pandas_and_makes_frames_all_the_same():
    subprocess.run([sys.executable, "-c", WITHOUT], check=True)


REPLAY = """
import sys
from pathlib import Path
import clutchest
from clutchest.record.files import write_run

truck = clutchest.load_vehicle("truck")
run = clutchest.replay(clutchest.simulate(truck, "launches", 1, duration=60.0), truck)
write_run(run, Path(sys.argv[1]), innovations=True)
assert "pandas" not in sys.modules
"""


def test_a_replay_is_written_without_pandas(tmp_path):
    subprocess.run([sys.executable, "-c", REPLAY, str(tmp_path)], check=True)
