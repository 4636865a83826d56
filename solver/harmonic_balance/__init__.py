"""The dynamic Lagrangian frequency-time balance (DLFT), its exact Jacobian, and states taken to other harmonics."""
