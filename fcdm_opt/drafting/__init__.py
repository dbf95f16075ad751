"""A first problem file from two meshes, which solves as it stands.

situation   how the parts lie as drawn, and which contacts are near
choice      goal and motion that solve the case, found by trying
remarks     what is to be said of that, and what is likely to be wrong
asking      the section that all cases share: what is asked, and what else could be
draft       the file: all of this as commented TOML
writing     how numbers, texts and motions are written there
"""
