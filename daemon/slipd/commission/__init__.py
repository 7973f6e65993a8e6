"""How the sensors of a rig are mounted, found from a few presses and pushes of a person (``slipd commission``)."""
