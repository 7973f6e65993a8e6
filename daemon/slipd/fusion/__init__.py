"""The contact mechanics and the slip decision of one contact; pure."""
