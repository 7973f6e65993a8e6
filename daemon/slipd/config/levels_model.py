"""Keys of ``[levels]`` and ``[rates]``, with units and defaults."""

from __future__ import annotations

from pydantic import Field

from slipd.config.stream_model import Hertz
from slipd.config.value_bounds import FalseAlarms, StrictModel


class Levels(StrictModel):
    """``[levels]``: thresholds on the upper bound of the utilisation.

    Attributes:
        caution: Utilisation at which the level becomes "caution".
        warning: Utilisation at which the level becomes "warning".
        hysteresis: How far the utilisation must fall below a threshold before the level is left.
        false_alarms_per_hour: How often noise alone may be reported as a slip, on each finger, 1/h.
    """

    caution: float = Field(default=0.70, gt=0.0, lt=1.0)
    warning: float = Field(default=0.85, gt=0.0, le=1.0)
    hysteresis: float = Field(default=0.05, ge=0.0, lt=0.5)
    false_alarms_per_hour: FalseAlarms = 1.0


class Rates(StrictModel):
    """``[rates]``: highest publishing rate of each topic, Hz of data time. A change of level is always published."""

    slip_hz: Hertz = 250.0
    wrench_hz: Hertz = 250.0
    tactile_hz: Hertz = 50.0
    grasp_hz: Hertz = 50.0
    status_hz: Hertz = 1.0
