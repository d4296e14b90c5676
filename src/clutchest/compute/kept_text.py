"""The lowered text of a model, kept from one run to the next.

Differentiating the equations and writing them out takes as long as reading a minute of a log.  The
text follows from the equations, as CasADi writes them as instructions, from what the model declares
beside them, and from the files that lower it: these are what it is kept under.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from importlib.metadata import version
from inspect import getsource

import casadi as ca

from clutchest import __version__
from clutchest.cache import recalled, remember
from clutchest.casadi_later import one_at_a_time
from clutchest.compute import functions, lower, step
from clutchest.models import model as models
from clutchest.models.model import Model

_LOWERED_BY = (functions, lower, step, models)
_WRITTEN_OUT = ("pieces", "effects")  # functions: what they do is in the equations


Thetas = tuple[tuple[str, str], ...]


def kept_text(text_of: Callable[[Model, Thetas], str], model: Model, thetas: Thetas) -> str:
    """What ``text_of`` gives, a function of ``compute.functions``; from the cache folder where it
    is there."""
    name = f"{text_of.__name__}_{key(model, thetas)}"
    if (known := recalled(name)) is not None:
        return known.decode()
    text = text_of(model, thetas)
    remember(name, text.encode())
    return text


@one_at_a_time
def key(model: Model, thetas: Sequence[tuple[str, str]]) -> str:
    """Another one where the text may be another."""
    e = model.expressions()
    given = [e.x, e.u, e.u0, e.w, e.p, e.g]
    made = [e.rate, e.readings, e.outputs, e.initial, e.mapped, e.implied]
    declared = {f.name: getattr(model, f.name) for f in fields(model) if f.name not in _WRITTEN_OUT}
    effects = [(x.name, x.parameters, dict(x.delays), dict(x.lateness)) for x in model.effects]
    equations = ca.Function("equations", given, made).serialize()
    text = "\n".join([_lowering(), repr((declared, effects, tuple(thetas))), equations])
    return hashlib.sha256(text.encode()).hexdigest()[:24]


@cache
def _lowering() -> str:
    """What turns equations into text."""
    return "\n".join([version("casadi"), __version__, *map(getsource, _LOWERED_BY)])
