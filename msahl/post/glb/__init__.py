"""Write the motion of a run as animated glTF 2.0 in one binary file (GLB).

One node for each body, with the meshes of its shapes below it, and samplers of its translation and
rotation. The root node rotates the model so that it stands upright where y points up, as glTF has
it. Lengths are in metres.

The file is a header, a description in JSON and the numbers it refers to, which take a hundred lines
to write. ``trimesh`` writes no animations, and ``pygltflib`` has records of the JSON alone: the
numbers would have to be packed here all the same. Tests read the files by ``pygltflib``, and the
validator of Khronos accepts them.
"""
