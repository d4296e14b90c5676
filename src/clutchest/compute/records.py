"""What the kernels take and fill: records of arrays, of which only the arrays' contents change.

A kernel is compiled for the types of a record's fields in their order, so that this text joins
every generated module (see ``compute.build``).
"""

from __future__ import annotations

from typing import Any, NamedTuple

# --- the generated module goes on from here ---


class Numbers(NamedTuple):
    """Numbers of a model: parameters ``p`` and numbers ``g`` of its effects."""

    p: Any
    g: Any


class Events(NamedTuple):
    """Events k = 0…K−1 at times ``t`` (K), s.

    ``sensor`` (K) index or −1, measurement ``z`` (K) with variance ``R`` (K); ``u`` (K, nu)
    inputs, straight between events; ``row`` (K) the regime of the interval that ends at k;
    ``emit`` (K) the row of the output that stands for the event, −1 for none.
    """

    t: Any
    sensor: Any
    z: Any
    R: Any
    u: Any
    row: Any
    emit: Any


class RegimeTables(NamedTuple):
    """What holds in each regime: flags ``W`` (r, f), process noise ``Q`` (r, 2n), per s and per J
    of slip energy, longest step ``longest`` (r), s; and of the inputs in all of them the ``noise``
    density (nu), per s, and the ``variance`` (nu) of one sample."""

    W: Any
    Q: Any
    longest: Any
    noise: Any
    variance: Any


class Belief(NamedTuple):
    """State ``x`` (n), covariance ``P`` (n, n), and the response ``S`` (n, m) to every theta.

    The slip energy so far, which no measurement corrects: ``E`` (2) J and its variance, ``cE`` (n)
    its covariance with x, ``sE`` (m) its response to every theta.  ``held`` (n): the standard
    deviations that equations use, as the last reading left them; negative before the first.
    """

    x: Any
    P: Any
    S: Any
    E: Any
    cE: Any
    sE: Any
    held: Any


class Weighting(NamedTuple):
    """How readings are weighed.

    ``spread`` (m) standard deviation of every theta; ``considered`` the variances that gains take
    into account: (m), or (0) where they take none.  An innovation beyond ``limit`` standard
    deviations counts for less.  ``signature``: responses to the thetas are followed.

    ``gains`` (K, n + doubted), behind each the standard deviations that it leaves: used where they
    are ``frozen``, else filled where the array has rows.
    """

    spread: Any
    considered: Any
    limit: float
    signature: bool
    gains: Any
    frozen: bool


class RowResults(NamedTuple):
    """Results of a filter at each of r emitted rows: ``x`` (r, n), ``P`` (r, n, n), ``total``
    (r, n) variance with the thetas' spreads, ``outputs`` (r, outputs, 2) value and variance,
    ``energy`` (r, 3 + m): J, variance, own part of it, response to each theta; ``gained`` (r, n)
    information that measurements gave of each state, nats."""

    x: Any
    P: Any
    total: Any
    outputs: Any
    energy: Any
    gained: Any


class EventResults(NamedTuple):
    """Results of a filter at each event: ``innovation`` (K, 3), with its predicted and its used
    variance, and, where the array has rows, ``signature`` (K, m), its response to each theta."""

    innovation: Any
    signature: Any


class Window(NamedTuple):
    """What the smoother keeps of the filter, per event of one window: transition ``Phi``
    (K, n, n) from the event before, reading's derivative ``H`` (K, n), gain ``K`` (K, n),
    innovation's ``variance`` (K) and ``innovation`` (K, 1 + m), with its response to each theta;
    per emitted row ``X`` (r, n, 1 + m), state and its response, and ``P`` (r, n, n)."""

    Phi: Any
    H: Any
    K: Any
    variance: Any
    innovation: Any
    X: Any
    P: Any


class ExpansionPoints(NamedTuple):
    """States ``known`` (r, n) around which equations are linearised, ``row`` (K) of them after
    each event, −1 for none, and ``apart`` (n), the way from there to the estimate."""

    known: Any
    row: Any
    apart: Any


class Start(NamedTuple):
    """Where a run begins, and in the end where it has ended: state ``x`` (n), that with tracked
    states where a smooth input puts them, ``settled`` (n), covariance ``P`` (n, n) of the tracked
    states, and the response ``S`` (n, a) to each active theta."""

    x: Any
    settled: Any
    P: Any
    S: Any


class ActiveThetas(NamedTuple):
    """Of which thetas (``active`` (a), indices) responses are followed; number c acts in
    proportion to column ``which[c]`` of ``basis`` (K, b), fully where that is −1.  In results it
    stands in column ``place[c]``.  ``at_once`` (r): how many steps of the states a response takes
    in one."""

    active: Any
    basis: Any
    which: Any
    place: Any
    at_once: Any


class Denoised(NamedTuple):
    """Inputs and states without the noise of their readings: ``inputs`` (K, nu), their ``slope``
    (K, nu) on the way to each event, ``moves`` (K, nu) the slope that step maps see, and
    ``states`` (K, tracked)."""

    inputs: Any
    slope: Any
    moves: Any
    states: Any


class Varying(NamedTuple):
    """Numbers of effects that vary along a log: ``which`` (v), indices, have ``value`` (K, v) on
    the way to each event and there."""

    which: Any
    value: Any


class Tracking(NamedTuple):
    """``states`` (tracked), indices, that readings correct, by the ``gain`` (K, tracked) of each;
    ``variance`` (K) its prediction's; ``settling``, indices of those that an input settles at once.
    Gain and variance are used where they are ``frozen``, so
    that innovations are a smooth function of θ; else they are filled."""

    states: Any
    gain: Any
    variance: Any
    frozen: bool
    settling: Any


class Sensitivities(NamedTuple):
    """Results: state ``x`` (K, n) at each event; per emitted row ``innovation`` (r) and its
    derivative ``by_theta`` (r, ≥ a) by each theta."""

    x: Any
    innovation: Any
    by_theta: Any


class Path(NamedTuple):
    """States ``x`` (rows, n) of a run: from where each step of the responses begins, and at each
    event before it is taken, one after the other.  Where they are ``known``, no step of the states
    is made; else they are filled, if there are any rows."""

    x: Any
    known: bool


class MeasuredRates(NamedTuple):
    """Measured ``rate`` (K, tracked), per s, of the ``tracked`` (indices) states, and ``acts`` (K)
    where their equations hold."""

    tracked: Any
    rate: Any
    acts: Any


class Work(NamedTuple):
    """Memory that a kernel uses anew at every event: flags, state and inputs at the ends of a step,
    inputs that other measurements imply, derivatives, gain, outputs, an adjoint and its covariance,
    an array of nothing.  What is structurally zero in a derivative is never written, so an array
    serves one purpose."""

    w: Any
    xn: Any
    ua: Any
    ub: Any
    va: Any
    vb: Any
    slope: Any
    F: Any
    Q: Any
    T: Any
    e: Any
    G: Any
    eG: Any
    H: Any
    Hm: Any
    K: Any
    PH: Any
    y: Any
    Y: Any
    Yu: Any
    Ym: Any
    L: Any
    A: Any
    nothing: Any


class SensitivityWork(NamedTuple):
    """The same for ``filter_sensitivities``: responses ``S`` and ``T`` (n, ≥ a), in turns, how far
    each theta ``acts`` (a), a reading's response ``by_theta`` (a), the ``row`` (1) of the path that
    comes next, states, inputs at the ends of a step, derivatives."""

    S: Any
    T: Any
    acts: Any
    by_theta: Any
    row: Any
    xn: Any
    xc: Any
    xs: Any
    xd: Any
    ua: Any
    ub: Any
    va: Any
    vb: Any
    F: Any
    Q: Any
    P: Any
    G: Any
    H: Any
    Hm: Any
    PH: Any
