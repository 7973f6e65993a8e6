"""Friction learned in the hand: what the readings of a grasp reveal of its coefficients; pure.

All of it is in required friction q, the coefficient at which the load of a reading would just slip. It follows from
the measured contact alone, whatever coefficient is assumed. `friction_estimate` is what a finger keeps;
`slipd.fusion.friction_learning` has the kernels that read rows.
"""
