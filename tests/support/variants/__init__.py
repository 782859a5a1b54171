"""Designs by formula, and parts that are not the design: what a quality check must not pass as `ok` where the
difference can be seen.

catalogue   : the variants of all families, and of any meshes (`longer`, `mirror`, `other_shape`)
expected    : which answers are right, given the noise
thin_walls  : covers whose wall has two sides that a scan may show alone
"""
