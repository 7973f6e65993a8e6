"""Compile every kernel before the first reading needs it."""

from __future__ import annotations

from typing import cast

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, Pad, Slip, Wrench
from slipd.finger.finger import Finger
from slipd.finger.force_image_check import COMPARE_NS
from slipd.finger.freshness import Read
from slipd.finger.image_channel import ImageChannel
from slipd.fusion import contact_from_wrench
from slipd.fusion.contact_state import ContactState, WrenchUncertainty
from slipd.fusion.held_pad import HeldPad, tipping_edges, twist_net
from slipd.fusion.motion_limits import nearest_limit, worst_turn
from slipd.fusion.motion_scale import check_points, follow_gravity, largest_scales
from slipd.fusion.object_swing import swing_excess
from slipd.fusion.streaming import move_to_pad, new_readings
from slipd.grasp.swing_estimate import SwingEstimate
from slipd.motion.evidence import BLOCK_S
from slipd.motion.image_blocks import Block, ImageBlocks
from slipd.motion.image_fit import ImageComparison
from slipd.motion.image_shift import ImageShift
from slipd.signals.charge_reconstruction import ChargeReconstruction
from slipd.signals.force_image_agreement import Agreement
from slipd.signals.pad import PadGeometry
from slipd.signals.taxel_blocks import BLOCK_NS, WINDOW
from slipd.signals.taxel_health import TaxelHealth
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample


def warm_up() -> None:
    """Call each kernel with arrays of the types that a run uses; with a warm cache this takes some 10 ms."""
    x, y = np.array((0.0, 0.01, 0.0, 0.01)), np.array((0.0, 0.0, 0.01, 0.01))
    move_to_pad(new_readings([(0.0,) * 6], [0]), ContactState(Levels(), Slip(), 0.0, 0.5).row)
    contact = contact_from_wrench((0.1, 0.0, -1.0), (0.0, 0.0, 0.001))
    Agreement(2, 2, 0.01, 0.5).update(0, contact, 0.02, x, y, np.ones(4))
    charge = ChargeReconstruction(4, 1.0)
    charge.update(np.zeros(4), 0.0, True)
    charge.update(np.ones(4), 0.01, False)
    health = TaxelHealth(2, 2)
    for k in range(WINDOW + 1):
        health.update(np.zeros(4), k * BLOCK_NS, None, None)
    _look_for_motion()
    _judge_contact()
    _advise_motion(x, y, np.full(4, 0.25))


def _judge_contact() -> None:
    """Judge a held object with a force sensor that measures torque, and with one that does not."""
    wrench = Wrench(device="bota", port="-", rate_hz=1000.0)
    pad = Pad(device="pvdf", port="-", rate_hz=100.0, rows=2, cols=2, pitch_m=0.01, electrode_m=0.005)
    finger = Finger("warm", FingerConfig(mu=0.5, wrench=wrench, pad=pad), Levels())
    for tare in (channel.tare for channel in (finger.force, finger.image) if channel is not None):
        tare.observe(0)  # without a known zero nothing is a contact
    for t_ns, torque in ((0, np.zeros(3)), (COMPARE_NS, None)):
        finger.update_image(TactileSample(t_ns, None, np.ones(4)))
        samples = [WrenchSample(k, None, np.array((0.1, 0.0, -1.0 - k)), torque) for k in range(3)]
        for read in (samples[:2], samples[2:]):  # readings that arrive together and alone take different paths
            for batch in finger.decide(Read(read, [sample.t_ns for sample in read])):
                batch[-1].needed_normal_n(finger.config)
    cast("ImageChannel", finger.image).shape()


def _look_for_motion() -> None:
    """Compare two blocks of images of a contact that rests."""
    geometry, noise = PadGeometry(2, 2, 0.01, 0.005), WrenchUncertainty(0.0, 0.0)
    shift, blocks = ImageShift(geometry, noise), ImageBlocks(geometry, noise)
    for k in range(9):
        t_ns, image, wrench = k * round(BLOCK_S * 1e9), np.ones(4), (0.1, 0.0, -1.0, 0.0, 0.0, 0.0)
        shift.update(t_ns, image, wrench)
        block = blocks.update(t_ns, image, wrench)
    rests = cast("Block", block)
    ImageComparison(geometry).shows_shift(rests, rests, np.zeros(3))


def _advise_motion(x: Array, y: Array, loads: Array) -> None:
    """Find the limits of the motion of an object between two pads."""
    net, halves = twist_net(x, y, loads, 0.005, 0.005), np.full(2, 0.5)
    edges = tipping_edges(x[[0, 1, 3, 2]], y[[0, 1, 3, 2]], 0.0, 0.0, 0.005)
    zero = np.zeros(3)
    pad = HeldPad(np.eye(3), zero, zero, zero, 1.0, halves, halves, halves, 0.5, 1.0, net, edges)
    each, rest = np.empty(net.shape[1]), np.zeros((1, 6))
    nearest_limit(pad, rest[0], 1.5, 3.0, np.empty(3))
    worst_turn(pad, np.zeros(3), 9.81, np.empty(3))
    largest_scales(pad, pad, rest[0], rest, 1.5, 1.0, each, np.empty(1))
    check_points(pad, pad, rest, rest, 1.5, each)
    follow_gravity(np.zeros((1, 10)), np.zeros(3), np.empty((1, 3)))
    swing_excess(np.zeros(1), np.zeros(1), 30.0, 0.0, np.empty((2, 1)))
    swing = SwingEstimate()
    for t_ns in (1, 2):
        swing.update(t_ns, 0.0, 0.0)
