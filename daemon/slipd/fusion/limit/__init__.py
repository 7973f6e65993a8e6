"""The kernels of the friction limit: a sum of norms, minimised over a plane of twists, with certified bounds.

**The problem.** A rigid motion of the object over the pad is a twist q = (v_x, v_y, ω). Under it taxel i slides with
u_i = v + ω ẑ × ρ_i. Friction on the taxel is at most w_i = μ F_i, along u_i, so friction dissipates the power
D(q) = Σ w_i |u_i|, a convex function. Friction can carry a load ℓ = (f_x, f_y, m) exactly when ℓ·q ≤ D(q) for every
twist. Two questions follow:

* The largest spin torque beside a given f_t: minimise D(q) − f_t·v over the twists with ω = 1.
* The utilisation λ of a load: 1/λ is the minimum of D(q) over the twists with ℓ·q = 1. A pole at infinity (ω = 0) is
  an ordinary point of that plane.

Paper eq. (5) is the stationarity condition of this sum. Paper eq. (7), the perfect hinge, is its optimality condition
at a taxel, where the norm has a kink. Neither needs a search of its own. Paper eq. (6) as printed compares a torque
about C with a torque about the pole and is not used (docs/decisions.md, 1).

**The method**, one step per module:

=================  ====================================================================================================
`frame`            Scale the contact to its own units; compute 1 − ρ with a bound of its error.
`sweep`            One pass over the taxels: power, friction field, Hessian.
`bounds`           Bracket the minimum: an upper bound from a twist, a lower bound from an admissible friction field.
`newton`           Newton's method with a line search. In most contacts the bounds meet after 3–7 passes.
`path`             Primal-dual central path for kinks: a pole on or beside a taxel, one dominant load, thin contacts.
                   It smooths the kinks by ε and steps in twist and friction field together while ε → 0.
`solve`            Torque limit and utilisation of one contact.
`grip_factor`      The factor on all loads that holds a load with a contact that grows.
`batch`            The same for many frames, and for readings in sequence.
=================  ====================================================================================================

Both `newton` and `path` stop when the bounds meet, or when only their rounding is left.

**Units.** Positions are relative to the load centroid, in mean distances from it (Σ w = 1, Σ w ρ = 0, Σ w |ρ| = 1),
and turned so that f_t points along +x. In these units, with ρ = |f_t| / (μ f_n), |u| = u_x + c with
c = u_y² / (|u| + u_x) ≥ 0, and because Σ w u_x = v_x,

    D(q) − ρ v_x = Σ w c + (1 − ρ) v_x,      Σ w u/|u| = (1 − Σ w c/|u|, Σ w u_y/|u|).

Every term is small where the sum is small: a pole a million mean distances away, where translation nears (1 − ρ → 0),
costs no digit, given 1 − ρ itself. Also D(q) ≥ max(|v|, |ω| − |v|) ≥ (|v| + |ω|)/3.

**Rounding.** With u = 2⁻⁵³, a sum of n terms errs by at most n u Σ|terms| in any order. The terms below add less than
16 u to that, so σ = (n + 16) u (`slack` in the code) covers both.

* Frame: weights and lengths are off by one common factor each, which the units absorb. Σ w ρ misses 0 by at most σ, a
  torque of σ. The turn misses f_t by an angle of 2 u; turning the whole field by it costs 2 u Σ w |ρ|.
* D(q) − ρ v_x: u_i errs by 2 u (|v| + |ω ρ_i|), c by (c + |u_y|)/|u| times that. With g = Σ w c/|u| and
  k = Σ w |u_y|/|u|, the sum errs by at most σ (Σ w c + |(1 − ρ) v_x| + |ω|) + 16 u (|v| (g + k) + |ω|).
* A friction field is exactly what was computed, so errors of u_i do not count. Only the errors of its sums do: σ g and
  σ k for the force, 2 σ for the spin. The field exceeds its friction circles by at most 10 u c/|u|.
* 1 − ρ has a bound of its own (`frame.slip_margin`).
"""
