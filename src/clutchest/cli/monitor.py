"""``monitor``: estimates over a live bus."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from clutchest.cli.groups import grouped
from clutchest.cli.options import (
    DEFAULT_OUT,
    Channel,
    Interface,
    Out,
    State,
    Trust,
    VehicleName,
    within,
)
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import note, print_json, progress

if TYPE_CHECKING:
    from clutchest.estimate.drive import Piece
    from clutchest.monitor.events import MonitorEvent, SessionStatus
    from clutchest.monitor.monitor import Monitor

REDRAW = 0.2  # s between two pictures of the panel


@dataclass(frozen=True, slots=True)
class BusOptions:
    """Where the frames are."""

    interface: Interface
    channel: Channel = None


@dataclass(frozen=True, slots=True)
class SessionOptions:
    """How long a session is, where it starts from, and what it sends."""

    duration: Annotated[
        float | None,
        Option(
            metavar="S",
            check=within(0.0),
            help="Stop after so many seconds.",
        ),
    ] = None
    state: State = None
    trust: Trust = False
    rate: Annotated[
        float,
        Option(
            metavar="HZ",
            check=within(0.1, 100.0),
            help="Rows per second of the estimates, 0.1 to 100.",
        ),
    ] = 10.0
    send_dm1: Annotated[bool, Option(help="Broadcast active trouble codes as J1939 DM1.")] = False


@dataclass(frozen=True, slots=True)
class ViewerOptions:
    """A live Rerun viewer."""

    serve: Annotated[
        bool,
        Option(help="Also serve a live Rerun viewer, to this machine only."),
    ] = False
    port: Annotated[
        int, Option(metavar="N", least=1024, most=65534, help="Port of the viewer.")
    ] = 9090


DEFAULT_SESSION, NO_VIEWER = SessionOptions(), ViewerOptions()


@grouped
def monitor(
    bus: BusOptions,
    vehicle: VehicleName,
    session: SessionOptions = DEFAULT_SESSION,
    viewer: ViewerOptions = NO_VIEWER,
    out: Out = DEFAULT_OUT,
    as_json: Annotated[
        bool, Option(names=("--json",), help="One JSON object per line instead of the panel.")
    ] = False,
) -> None:
    """Estimate live, over a CAN bus, and test for faults.

    Writes received.log (the frames with the stamps that were used), estimates.parquet,
    events.jsonl, recording.rrd and state.json; files of a killed session are completed by the
    next one in the same folder.
    Ctrl-C ends the session.

    \b
    Example:
      clutchest monitor --interface socketcan --channel can0 --vehicle truck
      clutchest monitor --interface udp_multicast --vehicle truck --serve
    """
    watching = _started(bus, vehicle, session, viewer, out)
    for number in {signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}:
        signal.signal(number, lambda *_: _end(watching))
    if watching.status.address and not sys.stdout.isatty():  # else the panel has it
        note(f"live viewer: {watching.status.address}")
    if as_json:
        watching.run(session.duration, _lines)
        return
    if sys.stdout.isatty():
        _watch(watching, session.duration)
    else:
        status = watching.run(session.duration, _words)
        print(f"{status.frames} frames, {status.losses}, {status.rows} rows of estimates")
        if not status.frames:
            print("No frame was received: is it this channel, at the bit rate of the bus?")
    print(f"Written to {out}: {', '.join(watching.written)}")


def _started(
    bus: BusOptions, vehicle: str, session: SessionOptions, viewer: ViewerOptions, out: Path
) -> Monitor:
    """A monitor that listens to the bus, with fault tests."""
    with progress() as show:
        show("loading", None)
        from clutchest.can.bus import open_bus
        from clutchest.monitor.faults import FaultWatcher
        from clutchest.monitor.monitor import Monitor
        from clutchest.monitor.store import RECEIVED
        from clutchest.reading import load_database
        from clutchest.record.files import read_state
        from clutchest.vehicle import load_vehicle

        car = load_vehicle(vehicle, trust=session.trust)
        database = load_database(car)
        before = None if session.state is None else read_state(session.state)
        watching: Monitor = Monitor(
            open_bus(bus.interface, bus.channel),
            car,
            out=out,
            rate=session.rate,
            state=before,
            serve=(viewer.port - 1, viewer.port) if viewer.serve else None,
            reopen=lambda: open_bus(bus.interface, bus.channel, watching.messages),
            progress=show,
        )
        # a bus that is not there is said before anything is compiled for it, and one that is there
        # is listened to meanwhile
        show("compiling the fault tests, once on this machine", None)
        send = watching.send if session.send_dm1 else None
        watching.add_watcher(FaultWatcher(car, database, send, log=out / RECEIVED))
    return watching


def _end(watching: Monitor) -> None:
    """End the session; while its last fault tests of the equations run, skip these."""
    if watching.analysing:
        raise KeyboardInterrupt
    if not watching.stopped and sys.stderr.isatty():
        note("last fault tests of the equations; Ctrl-C again skips them")
    watching.stop()


def _watch(watching: Monitor, duration: float | None) -> None:
    """The panel, drawn anew right behind a piece, when there is time."""
    from rich.console import Console
    from rich.live import Live as Screen

    from clutchest.monitor.panel import panel

    drawn = 0.0
    with Screen(console=Console(), auto_refresh=False, transient=False) as screen:

        def show(
            status: SessionStatus, piece: Piece | None, events: Sequence[MonitorEvent]
        ) -> None:
            nonlocal drawn
            now = time.monotonic()
            if now - drawn > REDRAW and (piece is not None or now - drawn > 2 * REDRAW):
                drawn = now
                screen.update(panel(status, watching.vehicle.machine), refresh=True)

        status = watching.run(duration, show)
        screen.update(panel(status, watching.vehicle.machine), refresh=True)


def _words(status: SessionStatus, piece: Piece | None, events: Sequence[MonitorEvent]) -> None:
    from clutchest.monitor.panel import words

    for event in events:
        print(f"{event.time:9.1f} s  {event.kind}: {words(event)}", flush=True)


def _lines(status: SessionStatus, piece: Piece | None, events: Sequence[MonitorEvent]) -> None:
    """Events and estimates, one object per line."""
    from dataclasses import asdict

    lines = [asdict(event) for event in events]
    if piece is not None:
        lines += _rows(piece)
    for line in lines:
        print_json(line, indent=None)
    if lines:
        sys.stdout.flush()


def _rows(piece: Piece) -> list[dict]:
    track = piece.track
    columns = {**track.states, **track.outputs}
    return [
        {
            "time": float(at),
            "kind": "estimate",
            "name": track.mode_names[track.mode[k]],
            "data": {
                name: {"value": e.value[k], "std": e.std[k], "valid": bool(e.valid[k])}
                for name, e in columns.items()
            },
        }
        for k, at in enumerate(track.time)
    ]
