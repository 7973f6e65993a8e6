"""Times in nanoseconds: a millisecond, a second, and when most tests begin."""

MS = 1_000_000
S = 1_000 * MS
T0 = 100 * S
