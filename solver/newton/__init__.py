"""Newton's method: iteration, linear solver, Krylov methods, preconditioners, and its use on a balance."""
