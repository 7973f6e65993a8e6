"""One finger: from its samples to a verdict on every force reading; pure.

A reading passes, in this order: `finger` (the order of all steps), `force_channel` or `image_channel` (conditioning),
`contact_estimator` (the kernels of `slipd.fusion`), and `finger_state` (rows to states, by the rules of `verdict`).
Beside that path, `force_image_check` compares force and image, `trust` decides whether something presses and whether a
grip may be raised, and `finger_tares` gives up tares.
"""
