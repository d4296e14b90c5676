"""What progress says of the time that is left."""

from __future__ import annotations

import clutchest.discovery.foreseen as module
from clutchest.discovery.foreseen import REMAINING, foreseen


def test_each_text_says_how_much_longer_it_may_take(monkeypatch):
    clock, said = [100.0], []
    monkeypatch.setattr(module, "perf_counter", lambda: clock[0])
    show = foreseen(lambda text, share: said.append((text, share)), 90.0)
    show("trying 1 cause", 0.0)
    clock[0] += 10.0
    show("testing the residuals", None)
    clock[0] += 1000.0  # longer than foreseen: nothing is said of it
    show("measuring the gain on held-out data", 0.5)
    least, most = (10.0 * times for times in REMAINING)
    assert said == [
        (f"trying 1 cause ({least:.0f} to {most:.0f} s more)", 0.0),
        (f"testing the residuals (0 to {most - 10.0:.0f} s more)", None),
        ("measuring the gain on held-out data", 0.5),
    ]
