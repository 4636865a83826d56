"""The results of the solver: states, histories, fretting loops, and the verdict on a history."""
