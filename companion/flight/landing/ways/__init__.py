"""Ways to a landing point and away from it: which is flown, where it leads, and what is left of it."""
