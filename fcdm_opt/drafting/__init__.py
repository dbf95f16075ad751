"""A first problem file from two meshes, which solves as it stands.

situation   how the parts lie as drawn, and which contacts are near
choice      goal and motion that solve the case, found by trying
remarks     what is to be said of that, and what is likely to be wrong
draft       the file: all of this as commented TOML, and what else could be asked
writing     how numbers, texts and motions are written there
"""
