"""The kinds of study: wear histories, nonlinear modes, missions. Of each its tasks, and how they are computed."""
