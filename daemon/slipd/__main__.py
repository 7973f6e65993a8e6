"""``python -m slipd`` is ``slipd``."""

import sys

from slipd.cli import main

sys.exit(main())
