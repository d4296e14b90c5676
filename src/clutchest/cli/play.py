"""``play``: a log onto a bus."""

from __future__ import annotations

from typing import Annotated

from clutchest.cli.options import Channel, Interface, within
from clutchest.cli.parameters import Argument, Option
from clutchest.cli.terminal import progress


def play(
    log: Annotated[
        str,
        Argument(metavar="LOG", help="A CAN log, or a shipped one: alsd, demo."),
    ],
    interface: Interface,
    channel: Channel = None,
    speed: Annotated[
        float,
        Option(
            metavar="X",
            check=within(0.001, 1000.0),
            help="So many times as fast as it was, 0.001 to 1000; a monitor's estimates are right "
            "at 1 only, since it goes by the time of reception.",
        ),
    ] = 1.0,
) -> None:
    """Send a log onto a bus at its own pace.

    \b
    Example:
      clutchest play demo --interface udp_multicast
      clutchest play drive.blf --interface socketcan --channel vcan0 --speed 2
    """
    from clutchest.can.bus import open_bus
    from clutchest.can.player import Played
    from clutchest.can.player import play as send
    from clutchest.shipped import locate

    path = locate(log, "logs")
    bus = open_bus(interface, channel)
    try:
        with progress() as show:

            def report(played: Played, at: float) -> None:
                show(f"{played.sent} frames, {at:.0f} s of {path.name}", None)

            played = send(path, bus, speed=speed, progress=report)
    finally:
        bus.shutdown()
    skipped = f", {played.skipped} error frames left out" if played.skipped else ""
    print(f"{played.sent} frames sent{skipped}; none later than {1e3 * played.late:.1f} ms")
