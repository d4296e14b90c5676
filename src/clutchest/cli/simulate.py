"""``simulate``: a drive whose truth is known."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from clutchest.cli.groups import grouped
from clutchest.cli.options import AsJson, Trust, VehicleName, within
from clutchest.cli.parameters import Option
from clutchest.cli.terminal import loaded, print_json, progress
from clutchest.cli.verb import Verb
from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    from clutchest.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class TruthOptions:
    """The truth of a simulated drive."""

    nominal: Annotated[
        bool,
        Option(
            help="Parameters as in the vehicle file, not drawn from their spreads.",
        ),
    ] = False
    duration: Annotated[
        float | None,
        Option(
            metavar="S",
            check=within(0.1),
            help="Seconds, at least 0.1, instead of the scenario's own.",
        ),
    ] = None
    effect: Annotated[
        list[str] | None,
        Option(
            metavar="NAME:P=V,P2=V2",
            help="An effect in the truth with its numbers (docs/effects.md); repeat for several.",
        ),
    ] = None
    effects: Annotated[
        list[Path] | None,
        Option(
            metavar="FILE.py",
            help="Your own effect classes, which --effect may name beside the library's; repeat "
            "for several.",
        ),
    ] = None
    disturb: Annotated[
        list[str] | None,
        Option(
            metavar="KEY=VALUE",
            help="What varies at random during the drive: torque_bias_walk Nm/√s from a start of "
            "torque_bias_std Nm, friction_walk 1/√s from friction_std; repeat for several.",
        ),
    ] = None
    onset: Annotated[
        float,
        Option(
            metavar="S",
            check=within(0.0),
            help="When the effects begin to act, s into the drive; of the differential.",
        ),
    ] = 0.0
    truck_seed: Annotated[
        int | None,
        Option(
            metavar="N",
            least=0,
            help="Seed of the machine's parameters, where --seed is to give another drive of "
            "the same machine. The same as --seed unless given.",
        ),
    ] = None

    def given(self) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
        """Effects and disturbances by name.  Raises BadParameter for what is neither."""
        effects: dict[str, dict[str, float]] = {}
        for text in self.effect or ():
            name, colon, values = text.partition(":")
            if not colon:
                raise click.BadParameter(
                    f"'{text}' is not NAME:P=V,P2=V2, for example wear:amount=0.5",
                    param_hint="--effect",
                )
            _numbers(values.split(","), effects.setdefault(name.strip(), {}), "--effect")
        disturbances: dict[str, float] = {}
        _numbers(self.disturb or (), disturbances, "--disturb")
        return effects, disturbances


DEFAULT_TRUTH = TruthOptions()


class WithScenarios(Verb):
    """A command whose help ends with the scenarios of every machine, and that names those of the
    vehicle where none is given."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """See :meth:`click.Command.format_epilog`."""
        from clutchest.models import machine_of, names

        machines = [machine_of(name) for name in names()]
        with formatter.section("Scenarios"):
            formatter.write_dl([(m.name, ", ".join(m.scenario_names)) for m in machines])

    def choices(self, name: str, given: Mapping[str, Any]) -> str:
        """See :meth:`Verb.choices`."""
        if name != "scenario" or "vehicle" not in given:
            return super().choices(name, given)
        from clutchest.vehicle import load_vehicle

        try:
            car = load_vehicle(given["vehicle"], trust=bool(given.get("trust")))
        except ClutchestError as problem:
            return str(problem)
        return f"scenarios of {car.name}: {', '.join(car.machine.scenarios_for(car.signals))}"


Scenario = Annotated[
    str,
    Option(
        metavar="NAME",
        help="A scenario of the vehicle's machine, as listed below; of your own machine one of its "
        "excitations.",
    ),
]
Seed = Annotated[int, Option(metavar="N", least=0, help="Same seed, same drive.")]
Output = Annotated[
    Path,
    Option(
        names=("-o", "--output"),
        metavar="LOG",
        help="The log to write, format by suffix; .csv and .parquet hold decoded signals.",
    ),
]


@grouped
def simulate(
    vehicle: VehicleName,
    scenario: Scenario,
    out: Output,
    seed: Seed = 0,
    truth: TruthOptions = DEFAULT_TRUTH,
    trust: Trust = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a drive, and write its log and the truth.

    The truth is written beside it, to LOG.truth.parquet, with the seed among its metadata.

    \b
    Example:
      clutchest simulate --vehicle truck --scenario city --seed 1 -o city.log
      clutchest simulate --vehicle truck --scenario launches --seed 2 \\
          --effect wear:amount=0.5,rate=0.02 \\
          --disturb friction_walk=5e-4 -o worn.mf4
      clutchest simulate --vehicle truck --scenario city --seed 3 \\
          --effects own.py --effect cold_lining:loss=0.1 -o rehearsal.log
    """
    effects, disturbances = truth.given()
    with progress() as show:
        show("simulating", None)
        from clutchest.record.files import finished_into
        from clutchest.simulated import write_simulation

        car, files = loaded(vehicle, trust), tuple(truth.effects or ())
        if files:
            _check_own(files, car, effects)
        with finished_into(out.parent) as folder:
            truth_file = write_simulation(
                folder / out.name,
                car,
                scenario,
                seed,
                effects,
                nominal=truth.nominal,
                duration=truth.duration,
                onset=truth.onset,
                truck_seed=truth.truck_seed,
                disturbances=disturbances,
                effects_files=files,
            )
    made = {
        "log": str(out),
        "truth": str(out.parent / truth_file.name),
        "scenario": scenario,
        "seed": seed,
        "truck_seed": seed if truth.truck_seed is None else truth.truck_seed,
        "effects": effects,
        "disturbances": disturbances,
    }
    if as_json:
        print_json(made)
    else:
        print(f"Written: {out} and {truth_file.name} ({scenario}, seed {seed})")


def _check_own(files: Sequence[Path], car: Vehicle, named: Container[str]) -> None:
    """Raises where a user's effects are invalid, or none of them is ``named`` with its size."""
    from clutchest.discovery.user_effects import user_effects

    own = user_effects(files, car)
    if own and not any(each.name in named for each in own):
        first = own[0]
        raise click.BadParameter(
            f"no --effect names one of them: add for example --effect "
            f"{first.name}:{first.gains[0].key}={first.gains[0].upper / 2.0:g}",
            param_hint="--effects",
        )


def _numbers(given: Iterable[str], into: dict[str, float], option: str) -> None:
    """``KEY=VALUE`` texts into ``into``; a key may come once."""
    for text in given:
        key, _, value = (part.strip() for part in text.partition("="))
        if key in into:
            raise click.BadParameter(f"'{key}' is given twice", param_hint=option)
        try:
            into[key] = float(value)
        except ValueError:
            raise click.BadParameter(
                f"'{text}' is not KEY=VALUE with a number", param_hint=option
            ) from None
