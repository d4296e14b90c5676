"""What the measurements told of each state, in which mode, and what would tell more.

Information is counted in bits: one halves a standard deviation.  A state that walks between its
measurements forgets, so that it may be told far more bits in an hour than its spread has shrunk by.
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
NOW = 10.0  # s; what was last informed longer ago is not observable now
TOGETHER = 0.9  # correlation beyond which two states are known together, hardly one by one


@dataclass(frozen=True, slots=True)
class Information:
    """Bits that measurements gave of each state, interval by interval.

    ``names`` the n states that the signals can inform; ``time`` (r,) s at each interval's end,
    ``mode`` (r,) in it, its place in ``mode_names``, ``bits`` (r, n).  The first interval ends at
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
        told = [i for i, state in enumerate(states) if state.name not in hidden]
        first = np.broadcast_to(before, len(states))[None, told]
        bits = np.diff(gained[:, told], axis=0, prepend=first) / log(2.0)
        names = tuple(states[i].name for i in told)
        return cls(names, time, mode, bits, compiled.machine.regimes.modes)

    def between(self, start: float, end: float) -> Information:
        """The intervals that end after ``start`` and not after ``end``, s."""
        # a start and its duration, added again, are the end only up to rounding
        a, b = np.searchsorted(self.time, [start + 1e-6, end + 1e-6])
        return replace(self, time=self.time[a:b], mode=self.mode[a:b], bits=self.bits[a:b])

    def total(self) -> dict[str, float]:
        """State → bits."""
        return dict(zip(self.names, self.bits.sum(axis=0).tolist(), strict=True))

    def by_mode(self) -> dict[str, dict[str, float]]:
        """Mode → state → bits, of all modes."""
        return {
            mode: dict(
                zip(self.names, self.bits[self.mode == code].sum(axis=0).tolist(), strict=True)
            )
            for code, mode in enumerate(self.mode_names)
        }

    def informed_at(self, name: str) -> float | None:
        """The time since which measurements told nothing of this state any more, s; None if they
        never did."""
        left = np.cumsum(self.bits[::-1, self.names.index(name)])[::-1]
        told = np.flatnonzero(left >= NOTHING)
        return float(self.time[told[-1]]) if len(told) else None


def between_engagements(
    information: Information, engagements: Sequence[tuple[float, float]]
) -> list[dict[str, Any]]:
    """What was told outside the slip events, whose (start, end) s are given in order: pieces with
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


def moving_together(compiled: Compiled, belief: Belief) -> dict[str, dict[str, float]]:
    """State → other state → correlation, of the pairs hardly known one by one; first the partner
    that the machine's separating manoeuvres name first."""
    model, P = compiled.model, covariance(compiled, belief)
    std = np.sqrt(np.diag(P))
    correlation = P / np.maximum(np.outer(std, std), 1e-300)
    seen = [state.name for state in model.states if state.name not in model.unobservable]
    pairs = [separation.pair for separation in compiled.machine.separating_manoeuvres]

    def found(name: str) -> dict[str, float]:
        named = [other for pair in pairs if name in pair for other in pair if other != name]
        row = correlation[model.state(name)]
        return {
            other: float(row[model.state(other)])
            for other in dict.fromkeys((*named, *seen))
            if other in seen and other != name and abs(row[model.state(other)]) > TOGETHER
        }

    return {name: found(name) for name in seen}


def moves_with(partners: Mapping[str, float]) -> str | None:
    """``moves with zero position (−0.97)``: the first partner; None without any."""
    for name, correlation in partners.items():
        return f"moves with {_words(name)} ({correlation:+.2f})".replace("-", "−")
    return None


def needs(machine: Machine, state: State, partners: Mapping[str, float]) -> str:
    """What would make a state known that is not: what parts it from a partner, else what informs
    it."""
    for separation in machine.separating_manoeuvres:
        for name in partners:
            if set(separation.pair) == {state.name, name}:
                return f"{separation.by}: it tells {_words(state.name)} and {_words(name)} apart"
    return state.informed_by


def not_observable_now(information: Information, name: str) -> str | None:
    """Since when nothing has informed a state; None while something does, or would if it were not
    known already as well as the present mode can tell it."""
    informed_at = information.informed_at(name)
    if informed_at is None:
        return "not observable: nothing in this drive informed it"
    bits = {mode: told[name] for mode, told in information.by_mode().items()}
    now = information.mode_names[int(information.mode[-1])]
    if now == max(bits, key=lambda mode: bits[mode]) or information.time[-1] - informed_at <= NOW:
        return None
    return f"not observable now: nothing has informed it since {informed_at:.0f} s"


def _words(name: str) -> str:
    head, _, tail = name.partition("_")
    return f"{tail} temperature" if head == "temp" else name.replace("_", " ")
