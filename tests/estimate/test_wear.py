"""Wear, its rate and what is left: the numbers, what carries over, and whether they hold."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.estimate.initial_state import History, carried_on, fresh
from clutchest.estimate.timeline import build
from clutchest.estimate.wear import remaining, remaining_energy
from clutchest.estimate.whole_log import compile_model
from clutchest.models import machine_of
from clutchest.record.report import informed
from clutchest.vehicle.vehicle import Estimation

TRUCK = clutchest.load_vehicle("truck")
NOMINAL = TRUCK.parameters["zero_position_ref"].value
DAY = 86_400_000_000_000  # ns


def after_days(signals, days):
    return replace(signals, start_ns=signals.start_ns + round(days * DAY))


@pytest.fixture(scope="module")
def drive():
    return clutchest.simulate(TRUCK, "launches", 2, duration=300.0)


@pytest.fixture(scope="module")
def first(drive):
    return clutchest.replay(drive, TRUCK)


class TestWhatIsLeft:
    """The interval of the energy left, against drawn pads."""

    @pytest.mark.parametrize(
        ("mm", "rate", "stds", "correlation", "wandering"),
        [
            (2.0, 0.02, (0.02, 0.002), 0.3, 1e-4),
            (2.0, 0.02, (0.3, 0.006), -0.6, 1e-4),
            (0.5, 0.05, (0.1, 0.02), 0.0, 0.0),
        ],
    )
    def test_ends_leave_out_two_and_a_half_per_cent_each(
        self, mm, rate, stds, correlation, wandering
    ):
        P = np.diag(np.square(stds))
        P[0, 1] = P[1, 0] = correlation * stds[0] * stds[1]
        ends = remaining_energy(mm, rate, P, wandering)
        rng = np.random.default_rng(0)
        # a higher zero position means more left
        drawn = rng.multivariate_normal([mm, rate], P, 400_000)
        noise = rng.standard_normal(400_000)
        for end, share in zip(ends, (0.025, 0.975), strict=True):
            left = drawn[:, 0] - drawn[:, 1] * end + np.sqrt(wandering * end) * noise
            assert np.mean(left < 0.0) == pytest.approx(share, abs=0.0013)  # five σ of 400 000

    def test_exact_numbers_have_one_answer(self):
        assert remaining_energy(2.0, 0.02, np.zeros((2, 2)), 0.0) == pytest.approx((100.0, 100.0))

    @pytest.mark.parametrize("rate", [0.0, 0.01, -0.005])
    def test_a_rate_that_may_be_zero_bounds_nothing_from_above(self, rate):
        low, high = remaining_energy(2.0, rate, np.diag([1e-4, 1e-4]), 1e-4)
        assert high is None
        assert low is not None and 0.0 < low < 2.0 / (rate + 1.96 * 0.01)

    def test_a_clutch_that_grows_lasts(self):
        assert remaining_energy(2.0, -0.02, np.diag([1e-4, 1e-8]), 0.0) == (None, None)

    def test_a_limit_that_is_reached(self):
        P = np.diag([1e-2, 1e-6])
        assert remaining_energy(-1.0, 0.02, P, 0.0) == (0.0, 0.0)
        low, high = remaining_energy(0.05, 0.02, P, 0.0)  # perhaps reached
        assert low == 0.0 and 2.5 < high < 20.0


class TestTheSection:
    """``wear`` in the summary."""

    def test_amount_and_rate_are_the_states(self, first):
        states, wear = first.summary["states"], first.summary["wear"]
        # the last row of the grid lies up to 0.1 s before the end
        worn = NOMINAL - states["zero_position"]["value"]
        assert wear["amount"]["value"] == pytest.approx(worn, abs=1e-3)
        new = TRUCK.parameters["zero_position_ref"].spread  # of the clutch when new
        assert wear["new"] == {"value": NOMINAL, "std": new, "unit": "mm"}
        std = np.hypot(states["zero_position"]["std"], new)
        assert wear["amount"]["std"] == pytest.approx(std, rel=0.01)
        assert wear["rate"]["value"] == pytest.approx(states["wear_rate"]["value"], abs=1e-3)
        assert wear["slip_energy"]["value"] == pytest.approx(
            first.summary["slip_energy_J"] * 1e-6, rel=1e-3
        )
        low, high = wear["amount"]["ci95"]
        assert high - low == pytest.approx(2 * 1.96 * wear["amount"]["std"])

    def test_a_log_that_informs_no_position_has_no_wear(self, drive):
        """The prior of the zero position is no estimate of wear."""
        short = drive.between(0.0, 0.3)
        run = clutchest.replay(short, TRUCK)
        assert not run.summary["states"]["zero_position"]["valid"]
        assert run.summary["wear"] is None

    def test_nothing_is_counted_in_slip_events_where_there_was_none(self):
        left = remaining(3.0, "mm", 0.02, np.diag([1e-4, 1e-8]), 0.0, History(60.0, 0, 1e5))
        assert left["MJ"]["value"] == pytest.approx(150.0)
        assert left["engagements"] == {"value": None, "ci95": [None, None]}

    def test_a_new_clutch_that_was_measured(self, drive):
        """Its zero position is stated with the deviation of that measurement."""
        ref = replace(TRUCK.parameters["zero_position_ref"], value=38.5, spread=0.01)
        (x0,) = [s for s in TRUCK.machine.states if s.name == "zero_position"]
        treated = Estimation(x0.role, x0.process_noise, 0.2, x0.useful_std, x0.wander)
        parameters = {**TRUCK.parameters, "zero_position_ref": ref}
        estimation = {**TRUCK.estimation, "zero_position": treated}
        measured = replace(TRUCK, parameters=parameters, estimation=estimation)
        run = clutchest.replay(drive, measured)
        state, wear = run.summary["states"]["zero_position"], run.summary["wear"]
        assert wear["amount"]["value"] == pytest.approx(38.5 - state["value"], abs=1e-3)
        assert wear["amount"]["std"] == pytest.approx(np.hypot(state["std"], 0.01), rel=0.01)
        assert "counted from" not in wear["words"][0]

    def test_what_is_left_in_hours_and_slip_events(self, first):
        left, history = first.summary["wear"]["remaining"], first.final["history"]
        assert history["engagements"] == len(first.tracks[0].engagements)
        assert history["driven_s"] == pytest.approx(300.0, abs=0.1)
        spent = history["slip_energy_J"] * 1e-6
        assert left["MJ"]["ci95"][0] > 10.0 and left["MJ"]["ci95"][1] is None  # five minutes
        assert left["h"]["ci95"][0] == pytest.approx(
            left["MJ"]["ci95"][0] / spent * history["driven_s"] / 3600.0
        )
        assert left["engagements"]["ci95"][0] == pytest.approx(
            left["MJ"]["ci95"][0] / spent * history["engagements"]
        )
        assert "not bounded from above" in first.summary["wear"]["words"][1]

    def test_without_a_limit_nothing_is_left_to_tell(self, drive):
        wear = clutchest.replay(drive, replace(TRUCK, limits={})).summary["wear"]
        assert wear["limit"] is None and wear["remaining"] is None
        assert "no limit" in wear["words"][1]

    @pytest.mark.slow
    def test_a_rate_in_the_vehicle_file_counts(self, drive):
        knowing = replace(TRUCK, effects={"wear": {"rate": 0.05}})
        run = clutchest.replay(drive, knowing)
        state = run.summary["states"]["wear_rate"]["value"]
        assert run.summary["wear"]["rate"]["value"] == pytest.approx(state + 0.05, abs=1e-3)


class TestHistory:
    """How hard the clutch is used travels in state.json."""

    def test_it_adds_up_over_drives(self, drive, first):
        state = json.loads(json.dumps(first.final))
        chained = clutchest.replay(after_days(drive, 3), TRUCK, state=state).final["history"]
        together = clutchest.replay(replace(drive, later=(after_days(drive, 3),)), TRUCK)
        assert together.final["history"] == chained
        assert chained["driven_s"] == pytest.approx(2 * state["history"]["driven_s"])
        assert chained["engagements"] == 2 * state["history"]["engagements"]

    def test_a_state_that_lacks_it(self, drive, first):
        older = {key: value for key, value in first.final.items() if key != "history"}
        run = clutchest.replay(after_days(drive, 3), TRUCK, state=older)
        assert run.final["history"]["engagements"] == len(run.tracks[0].engagements)
        # energy of the drives that the history knows, not of all
        total = run.summary["wear"]["slip_energy"]["value"] * 1e6
        assert run.final["history"]["slip_energy_J"] == pytest.approx(total / 2, rel=0.05)

    @pytest.mark.parametrize(
        "history", [3, {"driven_s": "long"}, {"driven_s": -1.0}, {"engagement": 3}]
    )
    def test_a_damaged_one_is_refused(self, drive, first, history):
        state = {**first.final, "history": history}
        with pytest.raises(ClutchestError, match="'history' must be numbers of driven_s"):
            clutchest.replay(after_days(drive, 3), TRUCK, state=state)


class TestStandingStill:
    """What no measurement tells does not change."""

    CARRIED = ("temp_body", "temp_housing", "temp_disc", "zero_position", "friction", "wear_rate")

    def test_weeks_between_drives(self, drive, first):
        later = after_days(drive, 40)
        model = machine_of(TRUCK.model).equations(set(later))
        compiled = compile_model(TRUCK, model)
        timeline = build(later, TRUCK, model, 10.0, {})
        belief, warning = carried_on(TRUCK, compiled, timeline, first.final, later.start_ns)
        assert warning is None
        kept = [model.state(name) for name in ("zero_position", "friction", "wear_rate")]
        x, P, S = (np.array(first.final[key]) for key in ("x", "P", "signature"))
        np.testing.assert_allclose(belief.x[kept], x[kept], rtol=1e-12)
        np.testing.assert_allclose(np.diag(belief.P)[kept], np.diag(P)[kept], rtol=1e-12)
        np.testing.assert_allclose(belief.S[kept], S[kept], rtol=1e-12)
        rest = fresh(TRUCK, compiled, timeline).x
        assert abs(x - rest)[model.state("temp_body")] > 1.5  # it was warm
        for name in ("temp_body", "temp_housing", "temp_disc"):
            i = model.state(name)
            assert belief.x[i] == pytest.approx(rest[i], abs=0.5)

    def test_half_an_hour_without_slip(self):
        run = clutchest.replay(clutchest.simulate(TRUCK, "closed", 2), TRUCK)
        states = run.tracks[0].states
        for name in self.CARRIED:
            moved = states[name].value - states[name].value[0]
            assert np.all(np.abs(moved) < states[name].std[0]), name
        for name in ("friction", "wear_rate"):  # which nothing can inform here
            assert np.ptp(states[name].value) < 1e-9
            assert np.diff(states[name].std).min() > -1e-9


@pytest.mark.statistics
def test_the_trend_of_many_drives_holds_what_it_says():
    """Four trucks, 50 drives each: true wear and rate within their 95 % intervals."""
    rate, inside = 0.02, []
    for truck in range(4):
        state, worn = None, 0.0
        for number in range(50):
            signals = clutchest.simulate(
                TRUCK,
                "launches",
                50 * truck + number,
                {"wear": {"rate": rate, "amount": worn}},
                truck_seed=truck,
                duration=600.0,
            )
            run = clutchest.replay(signals, TRUCK, state=state)
            state, truth, wear = run.final, signals.truth.columns, run.summary["wear"]
            worn += rate * truth["slip_energy"][-1] * 1e-6
            true = {"amount": worn, "rate": rate}
            inside.append([wear[k]["ci95"][0] < true[k] < wear[k]["ci95"][1] for k in true])
        remaining = (3.0 - true["amount"]) / rate
        low, high = wear["remaining"]["MJ"]["ci95"]
        assert low < 1.3 * remaining and (high is None or high > remaining / 1.3)
    amount, speed = np.mean(inside, axis=0)
    print(
        f"share of {len(inside)} drives: amount {amount:.3f}, rate {speed:.3f}; truck by truck\n",
        np.reshape(inside, (4, 50, 2)).mean(axis=1),
    )
    assert amount >= 0.9
    assert speed >= 0.9


STEP = 1e-5  # m of free play, from drive to drive


@pytest.fixture(scope="module")
def runs():
    """Three drives of a differential, each from the state that the one before left."""
    left, runs, begin = None, [], 0
    for k in range(3):
        effects = {"free_play_growth": {"growth": (k + 1) * STEP}}
        short = {"duration": 6.0, "nominal": True}
        drive = clutchest.simulate("alsd_rig", "rig-steps", 5, effects, **short)
        begin = begin or drive.start_ns  # the date of a simulation follows its effects
        drive = after_days(replace(drive, start_ns=begin), k)
        runs.append(clutchest.replay(drive, "alsd_rig", state=left))
        left = json.loads(json.dumps(runs[-1].final))
    return runs


class TestFromDriveToDrive:
    """Free play of the differential, whose model has no state for the rate of wear."""

    def test_one_drive_has_no_trend(self, runs):
        wear = runs[0].summary["wear"]
        assert wear["rate"]["value"] is None and wear["remaining"]["MJ"]["value"] is None
        assert "--state" in wear["words"][1]

    def test_trend_and_remaining_life(self, runs):
        assert [run.summary["contradiction"] for run in runs] == [None] * 3
        energy = [run.final["history"]["slip_energy_J"] / 1e6 for run in runs]
        for k in (1, 2):
            wear, true = runs[k].summary["wear"], k * STEP / (energy[k] - energy[0])
            assert abs(wear["rate"]["value"] - true) < 3 * wear["rate"]["std"]
            assert wear["rate"]["std"] < 0.1 * true
            left = wear["remaining"]["m"]["value"] / wear["rate"]["value"]
            assert wear["remaining"]["MJ"]["value"] == pytest.approx(left)
            low, high = wear["remaining"]["MJ"]["ci95"]
            assert low < left < high

    def test_words_are_in_millimetres(self, runs):
        words = runs[2].summary["wear"]["words"][0]
        assert " mm of 0.3 mm, counted from free_play = 0.19 ± 0.03 mm, at " in words

    def test_an_older_state_file_begins_the_trend(self, runs):
        left = {**runs[0].final, "history": {"driven_s": 10.0}}
        run = clutchest.replay(runs[1].signals, "alsd_rig", state=left)
        assert run.summary["wear"]["rate"]["value"] is None
        assert run.final["history"]["wear_std"] > 0.0

    @pytest.mark.slow
    def test_diagnose_knows_the_limit(self, runs):
        """With a limit below what is worn, the monitor fails; at the shipped one it passes."""
        vehicle = clutchest.load_vehicle("alsd_rig")
        limit = replace(vehicle.limits["wear"], value=5e-6)
        tight = replace(runs[2], vehicle=replace(vehicle, limits={"wear": limit}))
        for run, status in ((runs[2], "passed"), (tight, "failed")):
            diagnosis = clutchest.diagnose(run)
            (monitor,) = [m for m in diagnosis.monitors if m.name == "wear"]
            assert monitor.status == status, monitor.why
        assert diagnosis.faults[0].fault == "wear"


def test_a_drive_without_slip_adds_no_trend_but_what_the_one_before_knew():
    """A locked clutch: micrometres over millijoules are no rate; the friction is carried over."""
    rig = clutchest.load_vehicle("alsd_rig")
    steps = clutchest.simulate(rig, "rig-steps", 4, truck_seed=4, duration=20.0)
    before = clutchest.replay(steps, rig)
    locked = clutchest.simulate(rig, "I8", 5, truck_seed=4)
    run = clutchest.replay(after_days(locked, 1), rig, state=before.final)
    assert run.summary["wear"]["rate"]["value"] is None
    assert "more slip since the first drive" in run.summary["wear"]["words"][1]
    friction = run.summary["states"]["friction"]
    assert friction["carried_over"] and informed(friction).startswith("carried over from the drive")
    assert not before.summary["states"]["friction"]["carried_over"]
    assert not run.summary["states"]["temp_pack"]["carried_over"]
