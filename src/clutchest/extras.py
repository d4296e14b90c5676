"""Libraries that only some users need: extras of the package, ``pip install 'clutchest[all]'``."""

from __future__ import annotations

from importlib.util import find_spec

from clutchest.errors import ClutchestError

EXTRAS = {  # library → extra
    "asammdf": "mf4",
    "distributed": "fleet",
    "fmpy": "fmu",
    "h5py": "mat",
    "matplotlib": "plots",
    "mcap": "mcap",
    "nptdms": "tdms",
    "openpyxl": "excel",
    "polars": "polars",
    "rerun": "rerun",
    "rerun_notebook": "notebook",
}


def installed(library: str) -> bool:
    """Whether a library is there; it is not loaded."""
    return find_spec(library) is not None


def missing(library: str) -> ClutchestError:
    """That a library is not there, and how to get it."""
    return ClutchestError(
        f"this needs {library}, which is not installed: pip install 'clutchest[{EXTRAS[library]}]'"
    )


def required(library: str) -> None:
    """Raises ClutchestError where a library is not there."""
    if not installed(library):
        raise missing(library)
