"""One case: a joint that vibrates and wears. Arrays in, frozen results out; no files, no MPI, no xarray, no study.

The rooms, from the ground up: `structure` (Fourier basis, condensation, penalty), `contact` (Coulomb friction and
unilateral contact through a period), `harmonic_balance` (the DLFT balance and its Jacobian), `newton` (iteration,
linear solvers, preconditioners), `stability`, `continuation` (natural and arc length, homotopies, first state,
transient), `accuracy` (harmonic levels, refinement, error estimates, certificate), `results`, `loading_history` (the
unworn states of a sweep or a ramp), `wear` (the march on slow time). On the ground: `model`, `settings`, `outcome`,
`clock`, `packing`.
"""
