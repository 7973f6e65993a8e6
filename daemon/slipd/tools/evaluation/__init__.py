"""What slipd reports on recordings, with one config or another."""
