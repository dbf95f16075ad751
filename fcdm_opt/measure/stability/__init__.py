"""Where methods fail: families of hard cases, asked of every method in a process of its own."""
