"""A rigid object held by two compliant pads: distributed stick and slip, computed from mechanics alone.

Nothing here uses `slipd.fusion` for the dynamics, so the truth does not depend on the code that is tested with it. Pure
and without seed: the same scene moves in the same way.

- Motion. The object has three degrees of freedom: x, y and the angle about the normal of the pads. Weight, inertia,
  pulls and collisions are a load over time at a point of the object.
- Friction. The contact is divided into cells of 1 or 2 mm. In each, a spring and damper (a bristle) in series with a
  slider carries T = k z + c ż, and never more than (μ(w) + ν |ṡ|) p: p is the normal force on the cell, ṡ the speed
  of the slider, and μ(w) = μ_d + (μ_s − μ_d) / (1 + (w / v_s)²) falls with the sliding speed w from the static to the
  dynamic coefficient (Hess and Soom 1990). w follows the speed of the object with a lag of a millisecond, the
  frictional memory. With ν > 0 the contact creeps. A slider does not drift below its limit, as a bristle of the LuGre
  model does (Dupont et al. 2002).
- Pressure. Here it stays on the pad and keeps its shape, as with a crowned pad on a flat box. A grasp whose patch
  grows, moves, tilts or is wet derives from this one, for benchmarks.
- Steps. The velocity of the object is advanced before the bristles, the slider is implicit; a step is at most 0.25
  ms, and 0.25 rad of the fastest oscillation. A finer step or grid moves the onset of slip by less than 1 ms in 0.4
  s, and the energy balance closes within 2 % of the work done.
- Slip. Part of the cells slide before the object does: for Hertz's disc a share s³ of the load at the displacement s
  (1 where the last cell slides), under a load of 3/2 s − 1/2 s³ of the limit. The object slides as a whole when the
  cells that slide have 95 % of the frictional power; those near the pole of a rotation hardly move and may stick for
  long.

It does not model: motion along the normal of the pads, tipping as a motion, bending of the fingers, shear waves in
the pad (bristles do not couple), adhesion, wear, ageing of a resting contact, heat, and the hysteresis of taxels,
which belongs to the emulated sensors. Its damping is viscous, so slow oscillations of a small contact fade too slowly.

All coordinates are in the frame of the left pad. The right pad is the same hardware turned by half a turn about x, so
it sees the mirror image: y, the spin and the moment about y change sign, x does not.
"""
