"""Names of the ROS topics that have no name in the daemon's own API."""

NAMESPACE = "/slipd"
"""Beginning of the topics that only slipd has."""

DIAGNOSTICS_TOPIC, TRANSFORMS_TOPIC = "/diagnostics", "/tf"
