"""The evidence of coefficients of unknown size, and what they are then expected to be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from clutchest.signals import Floats

SCALES = np.array(
    [0.1, 0.3, 1.0, 3.0, 10.0]
)  # standard deviations of coefficients, in units of an error


def evidence(score: Floats, information: Floats, negligible: Floats) -> Floats:
    """2 ln of the Bayes factor of coefficients of any of SCALES against none; ``score`` (…, c) and
    its ``information`` (c, c), which counts as none in directions in which it is less than
    ``negligible`` (c, c): the remainder of a curve that is nearly a known one is input noise."""
    each = _of_scales(score, information, negligible)[0]
    top = each.max(axis=-1, keepdims=True)
    mean = np.log(np.mean(np.exp((each - top) / 2.0), axis=-1))
    return np.asarray(top[..., 0] + 2.0 * mean)


def expected(score: Floats, information: Floats, negligible: Floats) -> tuple[Floats, Floats]:
    """Coefficients (c) in the mean over SCALES, each as likely as its ``evidence`` says; in rows
    (c, c) the principal directions in which they may be off, by a standard deviation each, of
    those that the data inform: the others are known ones'."""
    each, means, covariances = _of_scales(score, information, negligible)
    weight = softmax(each / 2.0)
    mean = np.asarray(weight @ means)
    apart = (means - mean) * np.sqrt(weight)[:, None]
    return mean, principal_deviations(np.tensordot(weight, covariances, 1) + apart.T @ apart)


def principal_deviations(covariance: Floats) -> Floats:
    """In rows (c, c) the principal directions of a ``covariance`` (c, c), a standard deviation
    each."""
    variance, directions = np.linalg.eigh(covariance)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0))[:, None] * directions.T)


def covariance(information: Floats, negligible: Floats, std: float = 1.0) -> Floats:
    """Covariance (c, c) of coefficients under a prior of standard deviation ``std``, none in
    directions in which the data inform less than ``negligible`` (c, c): there they stay 0."""
    strength, directions = np.linalg.eigh(information)
    informed = _informed(strength, directions, negligible)
    return np.asarray((directions * (informed / (std**-2.0 + strength))) @ directions.T)


def freedom(coefficients: Floats, information: Floats, negligible: Floats, std: float) -> float:
    """What these ``coefficients`` (c), the most probable ones under a prior of standard deviation
    ``std``, take off a curve's evidence, in 2 ln of the Bayes factor: their size may be any of
    SCALES, where others are the most probable ones, and others would explain as much."""
    strength, directions = np.linalg.eigh(information)
    informed = _informed(strength, directions, negligible)
    along, strength = (coefficients @ directions)[informed], strength[informed]
    shrunk = 1.0 + std**2 * strength  # by the prior, from what the data alone would have
    by_data = (along * shrunk / std**2) ** 2 / strength
    by_scale = 1.0 + SCALES[:, None] ** 2 * strength
    each = np.sum(by_data * (1.0 / by_scale - shrunk**-2.0) + np.log(by_scale), axis=1)
    return float(-2.0 * (logsumexp(-each / 2.0) - np.log(len(SCALES))))


def _informed(strength: Floats, directions: Floats, negligible: Floats) -> NDArray[np.bool_]:
    """Which ``directions`` (columns of (c, c)) of a ``strength`` (c) count."""
    return np.asarray(strength > np.sum(directions * (negligible @ directions), axis=0))


def _of_scales(
    score: Floats, information: Floats, negligible: Floats
) -> tuple[Floats, Floats, Floats]:
    """2 ln of the Bayes factor (…, s) of each scale, its most probable coefficients (…, s, c), and
    their covariance (s, c, c)."""
    strength, directions = np.linalg.eigh(information)
    informed = _informed(strength, directions, negligible)
    variance = SCALES[:, None] ** 2
    shrunk = 1.0 + variance * np.where(informed, strength, 0.0)
    along = np.where(informed, score @ directions, 0.0)
    each = along**2 @ (variance / shrunk).T - np.log(shrunk).sum(axis=1)
    known = variance / shrunk
    covariances = (directions * np.where(informed, known, 0.0)[:, None, :]) @ directions.T
    return each, (along[..., None, :] * known) @ directions.T, covariances
