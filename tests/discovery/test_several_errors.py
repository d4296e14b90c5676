"""Which of several equations in error comes first."""

from __future__ import annotations

import numpy as np

import clutchest
from clutchest.discovery.nuisances import Nuisances
from clutchest.discovery.refitted_curves import Located
from clutchest.discovery.residual_curves import curves
from clutchest.discovery.several_errors import CurveColumns, evidence_joined, several_errors
from clutchest.inference.objective import Objective
from clutchest.inference.problem import Problem
from clutchest.inference.unknowns import UnknownParameter
from clutchest.models.error_term_effects import error_term_effects
from made_up import objective_of


def told(columns: np.ndarray) -> CurveColumns:
    """A curve of which nothing is noise of its inputs."""
    return CurveColumns(columns, np.zeros(2 * columns.shape[1:]))


def test_two_curves_of_one_equation_count_for_more_than_a_better_one_elsewhere():
    rng = np.random.default_rng(8)
    own = rng.standard_normal((600, 2))
    elsewhere = own.sum(axis=1, keepdims=True) + 0.8 * rng.standard_normal((600, 1))
    measured = 0.4 * own.sum(axis=1) + rng.standard_normal(600)
    objective = objective_of(
        lambda theta: (measured, np.ones((600, 1))), (UnknownParameter("level", 1.0),)
    )
    fit = objective.linearise_at(np.zeros(1))
    bare = Nuisances(fit, np.array([0]), objective.prior)

    def of(*curves: np.ndarray) -> float:
        return evidence_joined(bare, [told(each) for each in curves]).evidence

    assert max(of(own[:, :1]), of(own[:, 1:])) < of(elsewhere) < of(own[:, :1], own[:, 1:])
    assert of(rng.standard_normal((600, 3))) < 0.0


def test_one_curve_that_explains_an_error_does_not_pay_for_others_that_do_not():
    """All curves of an equation together say less than the one that is its error."""
    rng = np.random.default_rng(9)
    curves = [rng.standard_normal((600, 5)) for _ in range(8)]
    measured = 0.5 * curves[2].sum(axis=1) + rng.standard_normal(600)
    objective = objective_of(
        lambda theta: (measured, np.ones((600, 1))), (UnknownParameter("level", 1.0),)
    )
    bare = Nuisances(objective.linearise_at(np.zeros(1)), np.array([0]), objective.prior)
    joined = evidence_joined(bare, [told(each) for each in curves])
    assert joined.which == (2,)
    assert joined.evidence > evidence_joined(bare, [told(np.column_stack(curves))]).evidence + 20.0


def test_an_error_for_which_there_is_no_evidence_stands_alone_where_no_other_is_significant():
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "city", 5, duration=60.0)
    problem = Problem.of(signals, truck, error_term_effects(truck.machine))
    objective = Objective.of(problem)
    fit = objective.white_at(problem.begin)
    found = curves(objective, fit, Nuisances(fit, problem.nuisances, objective.prior), seed=3)
    faint = [min(found, key=lambda curve: curve.evidence)]
    place = Located(faint, objective, fit)
    assert several_errors(place, problem.nuisances, 0.0).found == [faint]
