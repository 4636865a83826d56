"""What is to be computed: tasks, what they share, what they cost, what they are known by and what they hand back."""
