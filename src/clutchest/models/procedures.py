"""What a machine declares for identification: procedures, and the pictures of what they fit."""

from __future__ import annotations

from dataclasses import dataclass

from clutchest.models.effects.effect import Effect


@dataclass(frozen=True, slots=True)
class Line:
    """A ``quantity`` of the equations over time, and its ``label``; ``style`` as matplotlib has
    it."""

    quantity: str
    label: str
    style: str = "-"


@dataclass(frozen=True, slots=True)
class PicturePanel:
    """Lines over time on axes with one ``label``, unit in it."""

    label: str
    lines: tuple[Line, ...]


@dataclass(frozen=True, slots=True)
class TimePicture:
    """``panels`` below each other, over time while the surfaces slide; a PNG named ``file``."""

    file: str
    panels: tuple[PicturePanel, ...]


@dataclass(frozen=True, slots=True)
class ReadingsPicture:
    """Measured and fitted readings of a ``sensor`` over time, on axes with this ``label``."""

    file: str
    sensor: str
    label: str


@dataclass(frozen=True, slots=True)
class CurvePicture:
    """Quantities over another one: ``measured`` as points, ``curve`` as it was before and as it is
    after the fit; ``labels`` of both axes."""

    file: str
    over: str
    measured: str
    curve: str
    labels: tuple[str, str]


Picture = TimePicture | ReadingsPicture | CurvePicture


@dataclass(frozen=True, slots=True)
class Procedure:
    """One way to determine ``parameters`` (keys) of the vehicle file from logs.

    ``what`` it determines, in a few words.  ``sensor``: the one whose readings alone count, "" for
    all; ``effects`` that stand in its equations, without any number of their own, as one that puts
    a measured quantity in place of a computed one; ``pictures`` of data against fit.
    """

    name: str
    what: str
    parameters: tuple[str, ...]
    sensor: str = ""
    effects: tuple[Effect, ...] = ()
    pictures: tuple[Picture, ...] = ()
