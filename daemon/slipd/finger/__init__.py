"""One finger: from its samples to a verdict on every force reading; pure.

A reading passes these files in this order: `finger` (may it wait for its image? `held_reads`), `verdict_path` (each step
in one place), `force_channel` and `image_channel` (conditioning), `contact_estimator` (the kernels of `slipd.fusion`),
`verdict_batch` (rows to states) with the rules of `verdict`, and out as a `finger_state`. Beside the path,
`force_image_check` compares force and image, `contact_presence` says whether something presses, `trust` whether a grip
may be raised, `tare_guard` gives up tares, and `stream_health` explains faults to people.
"""
