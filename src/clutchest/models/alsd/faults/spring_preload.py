"""The reset spring sets or breaks: the clutch no longer opens by itself."""

from __future__ import annotations

from clutchest.models.alsd.effects.spring_preload import SpringPreload
from clutchest.models.fault import ModelFault

FAULT = ModelFault("spring_preload", SpringPreload(), "change", size=0.3, fmi=(16, 18))
