"""What it costs: how time grows, and what the models of a scene take.

growth      time by vertices, parts and parameters, with exponents; `growth_picture`
models      size and time of each stage's program, in `scenes`; `models_picture`
"""
