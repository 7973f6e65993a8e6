"""`GripClient` under its former name, with the former names of its methods."""

from __future__ import annotations

from slipd_client.asking import Result
from slipd_client.grip import GripClient


class Requester(GripClient):
    """Use `GripClient`."""

    def renew(self) -> Result:
        """A lease renews itself; this does it once more."""
        return self.request("lease.renew")

    activate = GripClient.gripper_activate
    close = GripClient.gripper_close
    open = GripClient.gripper_open
    stop = GripClient.gripper_stop
