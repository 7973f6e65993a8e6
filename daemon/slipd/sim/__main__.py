"""Runs the virtual gripper: ``python -m slipd.sim --dir DIR [--seed N] [--seconds S]``."""

import sys

from slipd.sim.virtual_gripper import main

sys.exit(main())
