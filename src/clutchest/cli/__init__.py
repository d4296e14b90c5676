"""The command line: each verb reads, calls the library, and says in a few lines what came out.

Whatever is heavy is imported by the verb that needs it, so that ``--help`` answers at once.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys

import click

from clutchest import __version__
from clutchest.cli.convert import convert
from clutchest.cli.diagnose import diagnose
from clutchest.cli.discover import discover
from clutchest.cli.export import export
from clutchest.cli.feedforward import feedforward
from clutchest.cli.fleet import fleet
from clutchest.cli.identify import identify
from clutchest.cli.inspect import inspect
from clutchest.cli.light_python_can import hide_asammdf
from clutchest.cli.monitor import monitor
from clutchest.cli.play import play
from clutchest.cli.replay import replay
from clutchest.cli.reproduce import reproduce
from clutchest.cli.simulate import WithScenarios, simulate
from clutchest.cli.terminal import fail, hush, printable, unexpected
from clutchest.cli.trust import trust
from clutchest.cli.verb import Verb, Verbs
from clutchest.errors import ClutchestError
from clutchest.extras import EXTRAS, missing

_SWITCH_S = 1e-4  # compiled code that has ended waits no longer for a thread that runs Python
_OBJECTS = 200_000  # made before Python searches for circles among them: in vain after imports

_VERBS = (
    replay,
    inspect,
    convert,
    simulate,
    identify,
    diagnose,
    discover,
    reproduce,
    monitor,
    play,
    export,
    fleet,
    feedforward,
    trust,
)

app = Verbs(
    commands={
        verb.__name__: WithScenarios(verb) if verb is simulate else Verb(verb) for verb in _VERBS
    },
    help="Clutch temperatures, wear and friction from production CAN signals.",
    epilog="To begin: clutchest replay demo --vehicle truck",
)
click.version_option(__version__, message="clutchest %(version)s", help="Print the version.")(app)


def main() -> None:
    """Run the command line.  Bad input ends in one line on stderr and exit code 1; so does what
    nobody foresaw, with a file to send."""
    printable()
    hide_asammdf()
    os.environ.setdefault("RUST_LOG", "off")  # Rerun's own remarks are not the user's
    # what is worth sharing is shared already, and threads of linear algebra beside it only spin
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(_OBJECTS)
    sys.setswitchinterval(_SWITCH_S)
    atexit.register(gc.freeze)  # nor in the end, which would take a quarter of a second
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except ClutchestError as problem:
        fail(str(problem))
    except ModuleNotFoundError as problem:
        library = (problem.name or "").split(".")[0]
        fail(str(missing(library)) if library in EXTRAS else unexpected(problem))
    except MemoryError as problem:
        fail(f"not enough memory: {problem or 'the log or the duration is too long'}")
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        hush()
        fail(f"{where}{problem.strerror or problem}")
    except RecursionError:
        fail("an input is nested too deeply")
    except Exception as problem:
        if "CLUTCHEST_TRACEBACK" in os.environ:
            raise
        fail(unexpected(problem))
