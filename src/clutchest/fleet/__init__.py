"""Many drives of many vehicles of one kind: estimates, wear trends, and vehicles that differ.

``clutchest.fleet(…)`` calls :func:`clutchest.fleet.fleet.analyse_fleet`."""

from clutchest.callable_room import call_by

call_by(__name__, "clutchest.fleet.fleet", "analyse_fleet")
