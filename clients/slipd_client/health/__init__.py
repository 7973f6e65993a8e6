"""Health of a running slipd for people: what needs a repair, and a bundle for those who help."""
