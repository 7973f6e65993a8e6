"""Keys of ``[levels]`` and ``[rates]``, with units and defaults."""

from __future__ import annotations

from pydantic import Field

from slipd.config.stream_model import Hertz
from slipd.config.value_bounds import FalseAlarms, StrictModel


class Levels(StrictModel):
    """``[levels]``: thresholds on the upper bound of the utilisation.

    Attributes:
        caution: Utilisation at which the level becomes "caution"; below ``warning``. Wrong: too low, and caution is the
            normal state; too high, and it comes late.
        warning: Utilisation at which the level becomes "warning". Wrong: too high, and the warning comes too late to
            act; too low, and it is ignored.
        hysteresis: How far the utilisation must fall below a threshold before the level is left; below ``caution``.
            A load that grows steadily is warned of by as much before its threshold. Wrong: too small, and the level
            flickers; too large, and it stays after the danger.
        false_alarms_per_hour: How often noise alone may be reported as a slip, on each finger, 1/h. Wrong: too high,
            and noise is reported; too low, and slips are reported later.
    """

    caution: float = Field(default=0.70, gt=0.0, lt=1.0)
    warning: float = Field(default=0.85, gt=0.0, le=1.0)
    hysteresis: float = Field(default=0.05, ge=0.0, lt=0.5)
    false_alarms_per_hour: FalseAlarms = 1.0


class Rates(StrictModel):
    """``[rates]``: highest publishing rate of each topic, Hz of data time. A change of level is always published.

    Attributes:
        slip_hz: Of `slip`, each finger. Wrong: too low, and displays lag; too high costs processor time in every
            subscriber.
        wrench_hz: Of `wrench`, each finger. Wrong: likewise.
        tactile_hz: Of `tactile`, each finger. Wrong: likewise.
        grasp_hz: Of `grasp`. Wrong: likewise.
        status_hz: Of `status`. Wrong: likewise.
    """

    slip_hz: Hertz = 250.0
    wrench_hz: Hertz = 250.0
    tactile_hz: Hertz = 50.0
    grasp_hz: Hertz = 50.0
    status_hz: Hertz = 1.0
