"""Which devices are on the serial ports of this machine, and a first config for them (``slipd init``)."""
