"""A driver of his own: a queue that moves by lengths of a truck, which no scenario contains."""

from __future__ import annotations

from clutchest.generator.scenarios import (
    DRIVE,
    REST,
    Legs,
    Random,
    TruckScenario,
    launch_leg,
)

QUEUE = 1200.0  # s


def _queue(random: Random, duration: float, mass: float, kiss_point: float) -> Legs:
    """Launches in the lowest gears every half minute or so, some up a ramp, some broken off
    or taken up again before the truck stands; never a gear above what walking pace needs."""
    legs: Legs = [{"time": 0.0, "kind": REST}]
    time = random.uniform(3.0, 12.0)
    grade = 0.0
    while time < duration:
        if random.random() < 0.15:
            grade = random.uniform(-0.01, 0.045)
        gear = int(random.integers(1, 5))
        lasts, idle = random.uniform(0.8, 2.6), random.uniform(64.0, 92.0)
        leg = launch_leg(time, random.uniform(1.2, 4.5), grade, mass, gear, lasts, idle)
        legs.append(leg)
        time += random.uniform(9.0, 25.0)
        if random.random() < 0.35:  # the queue moves on
            legs.append({**leg, "time": time, "speed": random.uniform(2.5, 7.0)})
            time += random.uniform(6.0, 18.0)
        if random.random() < 0.25:  # brakes, and goes on before standing
            legs.append({**leg, "time": time, "speed": random.uniform(0.8, 1.6)})
            time += random.uniform(4.0, 9.0)
            continue
        legs.append({**leg, "time": time, "kind": DRIVE, "speed": 0.0})
        time += random.uniform(5.0, 12.0)
        if random.random() < 0.5:
            legs.append({"time": time, "kind": REST, "grade": grade})
            time += random.uniform(5.0, 35.0)
    return legs


STOP_AND_GO = TruckScenario(
    "stop-and-go", "a queue that moves by lengths of a truck", QUEUE, _queue
)
