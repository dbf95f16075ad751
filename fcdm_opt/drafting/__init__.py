"""A first problem file from two meshes, which solves as it stands.

situation   how the parts lie as drawn, and which contacts are near
choice      goal and motion that solve the case, found by trying
draft       the file: all of this as commented TOML, what is likely to be wrong, and what else could be asked
"""
