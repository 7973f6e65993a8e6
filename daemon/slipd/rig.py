"""The parts of a rig, made from its config; engine, messages and requests share them."""

from __future__ import annotations

from typing import NamedTuple, cast

from slipd.config import Config
from slipd.devices import GripperSession
from slipd.events import WallClock
from slipd.finger.finger import Finger
from slipd.finger.freshness import Lateness
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.grasp_fingers import place_fingers, weighed_fingers
from slipd.grasp.grasp_view import GraspView
from slipd.grasp.held_object import HeldObject, KnownObjects
from slipd.grasp.motion_advice import MotionAdvice
from slipd.grasp.object_estimate import NamedObject
from slipd.gripper.grip_policy import NoGripper
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.reflex import ReflexController
from slipd.links.device_link import make_links

GRIPPER_LINK = "gripper"


class GraspParts(NamedTuple):
    """Both fingers together.

    Attributes:
        view: The two fingers as one grasp.
        held: The object between them.
        advice: How fast the arm may go with it.
    """

    view: GraspView
    held: HeldObject
    advice: MotionAdvice


class Rig:
    """The parts of a rig in one run.

    Args:
        config: Its config.
        boot: Id of the run.
        wall: Wall clock of the run.

    Attributes:
        config: As above.
        boot: As above.
        wall: As above.
        lateness: How late the daemon is.
        named: The object that clients named.
        fingers: The fingers by name.
        channels: The channels of all fingers by stream.
        links: The links by name.
        gripper: The gripper; keeps the lease.
        reflex: Controller of the reflex; None if the config has no reflex.
        arm: Motion of the arm; None: no stream reports it.
        grasp: Both fingers together; None: the config has no ``[grasp]``.
    """

    def __init__(self, config: Config, boot: str, wall: WallClock) -> None:
        self.config, self.boot, self.wall = config, boot, wall
        self.lateness, self.named = Lateness(), NamedObject()
        self.fingers = {name: Finger(name, finger, config.levels) for name, finger in config.finger.items()}
        self.channels = {
            f"{name}.{kind}": channel
            for name, finger in self.fingers.items()
            for kind, channel in finger.channels.items()
        }
        self.links = make_links(config, {name: channel.freshness for name, channel in self.channels.items()})
        self.gripper: GripperControl | NoGripper = NoGripper()
        if config.gripper is not None:
            session = cast("GripperSession", self.links[GRIPPER_LINK].session)
            self.gripper = GripperControl(config.gripper, session, self.fingers)
        self.arm: ArmMotion | None = None
        self.grasp: GraspParts | None = None
        if (grasp := config.grasp) is not None:
            placed = place_fingers(grasp, self.fingers)
            weighed = weighed_fingers(placed)
            self.arm = None if grasp.arm is None else ArmMotion(grasp.arm, weighed)
            held = HeldObject(weighed, self.arm, KnownObjects(self.named, grasp.motion.regrip_std_m))
            advice = MotionAdvice(grasp, placed, held, self.arm)
            self.grasp = GraspParts(GraspView(placed), held, advice)
        self.reflex: ReflexController | None = None
        if config.reflex.enabled and self.grasp is not None and isinstance(self.gripper, GripperControl):
            self.reflex = ReflexController(config.reflex, self.grasp.view, self.gripper)
