"""What the solver hands out: states, histories, loops; and from the steps of a march to the counts asked for."""
