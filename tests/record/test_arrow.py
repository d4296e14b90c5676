import subprocess
import sys

WITHOUT = """
import sys
import numpy as np
import pyarrow as pa
from clutchest.record.arrow import spare_pandas

spare_pandas()
pa.table({"a": np.arange(3.0)})
assert "pandas" not in sys.modules
assert pa.table({"a": np.arange(3.0)}).to_pandas()["a"].tolist() == [0.0, 1.0, 2.0]
"""


def test_arrow_takes_arrays_without_pandas_and_makes_frames_all_the_same():
    subprocess.run([sys.executable, "-c", WITHOUT], check=True)
