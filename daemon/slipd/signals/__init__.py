"""Conditioning of readings, from sensor samples to the pad frame: mounting, tare, drift, health, clocks; pure."""
