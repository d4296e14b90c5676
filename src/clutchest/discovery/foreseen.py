"""How much longer a discovery may take, by how long it has taken to begin."""

from __future__ import annotations

from time import perf_counter

from clutchest.progress import Progress

# Of the time until the search begins: without a cause, and with one to fit, to test and to measure
# (truck, 20 minutes and an hour: 1.2 and 4.4; differential, one minute: 0.7).
REMAINING = (0.7, 5.0)


def foreseen(progress: Progress, begun: float) -> Progress:
    """``progress`` that says how many seconds more it may take beside what is done now; ``begun``:
    when it was, by ``time.perf_counter``."""
    now = perf_counter()
    ends = [now + times * (now - begun) for times in REMAINING]

    def show(text: str, share: float | None) -> None:
        least, most = (max(end - perf_counter(), 0.0) for end in ends)
        progress(f"{text} ({least:.0f} to {most:.0f} s more)" if most else text, share)

    return show
