"""Bodies, and the Euclidean queries on them."""
