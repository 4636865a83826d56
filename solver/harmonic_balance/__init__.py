"""The dynamic Lagrangian frequency-time balance (DLFT), its exact Jacobian, transfer to other harmonics."""
