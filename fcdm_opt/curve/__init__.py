"""The decision curve of two bodies: which scale pairs touch, and by which features."""
