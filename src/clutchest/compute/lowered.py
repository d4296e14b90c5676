"""The functions that a model is lowered to, as the kernel sees them.

The generated module holds the real ones; here they have their names and shapes only.  ``x`` (n)
states, ``u`` (nu) inputs, ``w`` regime flags, ``p`` parameters, ``g`` numbers of the effects, m
thetas.  Output arrays start as zeros; only entries that can differ from zero are written.
"""

from __future__ import annotations

from typing import Any

STATES = INPUTS = OUTPUTS = SENSORS = THETAS = 0
HAS_MAP = False
SCALES: Any = ()  # states that are factors
DOUBTED: Any = ()  # states whose standard deviations stand at the end of w
# of the G of a ``transition``: FIRST[k] to FIRST[k + 1] are column k's places, in these ROWs
FIRST: Any = ()
ROW: Any = ()


def step(
    x: Any,
    u0: Any,
    u1: Any,
    dt: float,
    w: Any,
    p: Any,
    g: Any,
    q: Any,
    noise: Any,
    xn: Any,
    F: Any,
    Q: Any,
    e: Any,
) -> float:
    """xn (n) = x after ``dt`` s, F (n, n) = ∂xn/∂x, Q (n, n) the noise of process (``q`` (2n)) and
    inputs (``noise`` (nu)); returns the slip energy of the step, e (n) its derivative by x."""
    raise NotImplementedError


def step_signature(
    x: Any, u0: Any, u1: Any, dt: float, w: Any, p: Any, g: Any, slope: Any, G: Any, eG: Any
) -> float:
    """G (n, m) = ∂xn/∂θ, eG (m) = ∂energy/∂θ; ``slope`` (nu): of the inputs, where delays act."""
    raise NotImplementedError


def propagate(P: Any, F: Any, Q: Any, T: Any) -> None:
    """P ← F P Fᵀ + Q, exactly symmetric, for the F of a ``step``; T (n, n) is memory."""
    raise NotImplementedError


def propagate_signature(S: Any, F: Any, G: Any) -> None:
    """S ← F S + G, how the state answers to every θ, for the F of a ``step``."""
    raise NotImplementedError


def advance(x: Any, u0: Any, u1: Any, dt: float, w: Any, p: Any, g: Any, xn: Any) -> float:
    """xn (n) = x after ``dt`` s."""
    raise NotImplementedError


def follow(
    x: Any, u0: Any, u1: Any, dt: float, w: Any, p: Any, g: Any, moves: Any, xn: Any
) -> float:
    """xn (n) = x after ``dt`` s; step maps see inputs that move by ``moves`` (nu) per s."""
    raise NotImplementedError


def settle(
    x: Any, u0: Any, u1: Any, dt: float, w: Any, p: Any, g: Any, moves: Any, xn: Any
) -> float:
    """The same of the states alone that an input settles at once."""
    raise NotImplementedError


def transition(
    x: Any,
    u0: Any,
    u1: Any,
    dt: float,
    w: Any,
    p: Any,
    g: Any,
    moves: Any,
    slope: Any,
    F: Any,
    G: Any,
) -> float:
    """F and G of ``follow``, as ``step`` and ``step_signature`` have them."""
    raise NotImplementedError


def carry(F: Any, X: Any, T: Any, columns: int) -> None:
    """T ← F X, the first ``columns`` of them, for the F of a ``transition``."""
    raise NotImplementedError


def gathered(
    x: Any,
    u0: Any,
    u1: Any,
    dt: float,
    w: Any,
    p: Any,
    g: Any,
    moves: Any,
    q: Any,
    noise: Any,
    Q: Any,
) -> float:
    """Q of ``follow``, as ``step`` has it."""
    raise NotImplementedError


def implied(x: Any, u: Any, w: Any, p: Any, g: Any, v: Any) -> float:
    """v (nu) the inputs, noisy ones as other measurements imply them."""
    raise NotImplementedError


def dynamics(x: Any, u: Any, w: Any, p: Any, g: Any, f: Any, A: Any, B: Any) -> float:
    """f (n) = dx/dt, A (n, n) = ∂f/∂x, B (n, nu) = ∂f/∂u."""
    raise NotImplementedError


def decays(x: Any, u: Any, w: Any, p: Any, g: Any, decay: Any, D: Any) -> float:
    """decay (n) ≤ 0 the own linear decay of every stiff state, 1/s; D (n, n) its derivative."""
    raise NotImplementedError


def outputs(x: Any, u: Any, w: Any, p: Any, g: Any, y: Any, Y: Any, Yu: Any) -> float:
    """y the model's outputs, Y and Yu their derivatives by x and u."""
    raise NotImplementedError


def outputs_signature(x: Any, u: Any, w: Any, p: Any, g: Any, Ym: Any) -> float:
    """Ym the derivative of the outputs by θ."""
    raise NotImplementedError


def reading(sensor: int, x: Any, u: Any, w: Any, p: Any, g: Any, H: Any) -> float:
    """What a sensor reads; H (n) its derivative by x."""
    raise NotImplementedError


def reading_signature(sensor: int, x: Any, u: Any, w: Any, p: Any, g: Any, Hm: Any) -> float:
    """Hm (m) the derivative of a sensor's reading by θ."""
    raise NotImplementedError


def initial(x: Any, p: Any, g: Any, xi: Any, Si: Any) -> float:
    """xi (n) the start state that effects make of ``x``, Si (n, m) its derivative by θ."""
    raise NotImplementedError


def step_map(x: Any, u0: Any, u: Any, w: Any, p: Any, g: Any, mapped: Any, J: Any) -> float:
    """The state after a step's discrete part, and its derivative J (n, n)."""
    raise NotImplementedError


def watch(x: Any, u: Any, w: Any, p: Any, g: Any, y: Any) -> float:
    """y the quantities that a run forward writes out."""
    raise NotImplementedError
