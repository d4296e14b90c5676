"""Work is shared among cores, and among as many fits as memory holds."""

from __future__ import annotations

import pytest

from clutchest.inference import cores


@pytest.fixture
def two_cores(monkeypatch) -> None:
    monkeypatch.setattr(cores, "cores", lambda: 2)


@pytest.mark.parametrize("tasks", [[1], [1, 2], [1, 2, 3]])
def test_a_task_alone_may_share_its_own_work_and_several_may_not(two_cores, tasks):
    shares = cores.shared(lambda _: cores.halved(cores.FEWEST), iter(tasks))
    assert shares == [len(tasks) == 1] * len(tasks)


def test_results_come_in_the_order_of_the_tasks(two_cores):
    assert cores.shared(lambda task: task**2, range(7)) == [0, 1, 4, 9, 16, 25, 36]
    assert cores.shared(lambda task: task, []) == []


@pytest.mark.parametrize(
    ("entries", "held", "count"),
    [
        (0.3, 0.3, 2),
        (0.5, 0.0, 2),
        (0.4, 0.3, 1),
        (0.5, 1.5, 1),  # one must be made all the same
    ],
)
def test_fits_at_once_are_as_many_as_fit_beside_what_is_held(two_cores, entries, held, count):
    most = int(cores.ENTRIES)
    assert cores.fits_at_once(int(entries * most), int(held * most)) == count
