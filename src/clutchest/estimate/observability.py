"""Observability: the information about each state by mode, correlated states, and excitations.

Information is counted in bits: one halves a standard deviation.  A state with process noise loses
information between its measurements, so that the sum over an hour may be far more than its standard
deviation has shrunk by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest.models.machine import Machine
from clutchest.models.symbols import State
from clutchest.signals import Floats

if TYPE_CHECKING:
    from clutchest.estimate.whole_log import Belief, Compiled

NOTHING = 0.01  # bits; less narrows a standard deviation by under 1 %
NOW_S = 10.0  # s; a state without information for longer is not observable now
ByMode = dict[str, dict[str, float]]  # mode → state → bits
STRONG = 0.9  # correlation beyond which two states are hardly observable one by one


@dataclass(frozen=True, slots=True)
class Information:
    """Information of the measurements about each state, interval by interval.

    ``names`` of the n states that the signals can observe; ``time`` (r,) s at each interval's end,
    ``mode`` (r,) in it, its index in ``mode_names``, ``bits`` (r, n).  The first interval ends at
    the first output.
    """

    names: tuple[str, ...]
    time: Floats
    mode: NDArray[np.uint8]
    bits: Floats
    mode_names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        compiled: Compiled,
        time: Floats,
        mode: NDArray[np.uint8],
        gained: Floats,
        before: Floats | float = 0.0,
    ) -> Information:
        """From the kernel's running sum ``gained`` (r, states), nats, ``before`` (states) the first
        row."""
        states, hidden = compiled.model.states, compiled.model.unobservable
        observable = [i for i, state in enumerate(states) if state.name not in hidden]
        first = np.broadcast_to(before, len(states))[None, observable]
        bits = np.diff(gained[:, observable], axis=0, prepend=first) / log(2.0)
        names = tuple(states[i].name for i in observable)
        return cls(names, time, mode, bits, compiled.machine.regimes.modes)

    def between(self, start: float, end: float) -> Information:
        """The intervals that end after ``start`` and not after ``end``, s."""
        # start + duration equals the end only up to rounding
        a, b = np.searchsorted(self.time, [start + 1e-6, end + 1e-6])
        return replace(self, time=self.time[a:b], mode=self.mode[a:b], bits=self.bits[a:b])

    def total(self) -> dict[str, float]:
        """State → bits."""
        return dict(zip(self.names, self.bits.sum(axis=0).tolist(), strict=True))

    def by_mode(self) -> ByMode:
        """Mode → state → bits, of all modes."""
        return {
            mode: dict(
                zip(self.names, self.bits[self.mode == code].sum(axis=0).tolist(), strict=True)
            )
            for code, mode in enumerate(self.mode_names)
        }

    def informed_at(self, name: str) -> float | None:
        """The last time at which this state got information, s; None if it never did."""
        still = np.cumsum(self.bits[::-1, self.names.index(name)])[::-1]
        informed = np.flatnonzero(still >= NOTHING)
        return float(self.time[informed[-1]]) if len(informed) else None


def between_engagements(
    information: Information, engagements: Sequence[tuple[float, float]]
) -> list[dict[str, Any]]:
    """Information outside the events, whose (start, end) s are given in order: pieces with
    ``start_s``, ``duration_s``, and ``modes``: mode → ``seconds`` and ``information_bits``."""
    time = information.time
    if not len(time):
        return []
    edges = [-np.inf, *(edge for event in engagements for edge in event), np.inf]
    pieces = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        start, end = max(a, float(time[0])), min(b, float(time[-1]))
        piece = information.between(a, b)
        if not len(piece.time):
            continue
        seconds = np.diff(piece.time, prepend=start)
        modes = {}
        for mode, bits in piece.by_mode().items():
            of = piece.mode == information.mode_names.index(mode)
            if of.any():
                modes[mode] = {"seconds": float(seconds[of].sum()), "information_bits": bits}
        pieces.append({"start_s": start, "duration_s": end - start, "modes": modes})
    return pieces


def covariance(compiled: Compiled, belief: Belief) -> Floats:
    """Covariance of the states, the parameters' spreads in it; shape (n, n)."""
    across = belief.S * compiled.spread
    return belief.P + across @ across.T


def strong_correlations(compiled: Compiled, belief: Belief) -> dict[str, dict[str, float]]:
    """State → other state → correlation, of the pairs hardly observable one by one; in the order of
    the machine's separating manoeuvres."""
    model, P = compiled.model, covariance(compiled, belief)
    std = np.sqrt(np.diag(P))
    correlation = P / np.maximum(np.outer(std, std), 1e-300)
    names = [state.name for state in model.states if state.name not in model.unobservable]
    pairs = [separation.pair for separation in compiled.machine.separating_manoeuvres]

    def partners(name: str) -> dict[str, float]:
        declared = [other for pair in pairs if name in pair for other in pair if other != name]
        row = correlation[model.state(name)]
        return {
            other: float(row[model.state(other)])
            for other in dict.fromkeys((*declared, *names))
            if other in names and other != name and abs(row[model.state(other)]) > STRONG
        }

    return {name: partners(name) for name in names}


def correlated_with(partners: Mapping[str, float]) -> str | None:
    """The first of a state's correlated partners, in words; None without any."""
    for name, correlation in partners.items():
        return f"strongly correlated with {_words(name)} ({correlation:+.2f})".replace("-", "−")
    return None


def needs(machine: Machine, state: State, partners: Mapping[str, float]) -> str:
    """The manoeuvre that would make a state observable: one that separates it from a correlated
    partner, else one that informs it."""
    for separation in machine.separating_manoeuvres:
        for name in partners:
            if set(separation.pair) == {state.name, name}:
                return f"{separation.by}: it separates {_words(state.name)} from {_words(name)}"
    return state.informed_by


def not_observable_now(information: Information, by_mode: ByMode, name: str) -> str | None:
    """Since when a state has had no information, of which ``by_mode`` is the sum; None while it
    has, or where the present mode is the one that informs it most."""
    informed_at = information.informed_at(name)
    if informed_at is None:
        return "not observable: no information in this drive"
    bits = {mode: by_state[name] for mode, by_state in by_mode.items()}
    now = information.mode_names[int(information.mode[-1])]
    if now == max(bits, key=lambda mode: bits[mode]) or information.time[-1] - informed_at <= NOW_S:
        return None
    return f"not observable now: no information since {informed_at:.0f} s"


def _words(name: str) -> str:
    head, _, tail = name.partition("_")
    return f"{tail} temperature" if head == "temp" else name.replace("_", " ")
