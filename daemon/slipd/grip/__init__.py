"""What a grip request may do; pure."""
