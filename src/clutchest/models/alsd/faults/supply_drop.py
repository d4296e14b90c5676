"""A corroded contact takes its share of the voltage."""

from __future__ import annotations

from clutchest.models.alsd.effects.supply_drop import SupplyDrop
from clutchest.models.fault import ModelFault

FAULT = ModelFault("supply_drop", SupplyDrop(), "resistance", size=0.05, fmi=(18, 18))
