"""Meshes of solids and beams: nodes and elements become matrices of mass and stiffness.

mesh file (meshio) -> mesh (nodes, elements, named sets) -> elastic model (scikit-fem, or beams)
-> reduction -> error of the mesh in each frequency
"""
