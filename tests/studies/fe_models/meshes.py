"""Meshes in Gmsh's formats, written after its manual. A helper of the tests."""

GMSH_22 = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
2 1 "under"
3 2 "Block"
2 3 "top"
$EndPhysicalNames
$Nodes
13
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 0 0 1
6 1 0 1
7 1 1 1
8 0 1 1
9 0.5 0.5 2
10 9 9 9
11 0 0 3
12 1 0 3
13 0 1 3
$EndNodes
$Elements
6
1 3 2 1 1 1 2 3 4
2 3 2 3 2 5 6 7 8
3 5 2 2 1 1 2 3 4 5 6 7 8
4 4 2 2 1 5 6 7 9
5 4 2 2 1 5 7 8 9
6 15 2 0 1 10
$EndElements
"""

GMSH_41 = """\
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "under"
3 2 "Block"
$EndPhysicalNames
$Entities
0 0 1 1
1 0 0 0 1 1 0 1 1 0
1 0 0 0 1 1 1 1 2 0
$EndEntities
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
2 3 1 3
2 1 2 1
1 1 2 3
3 1 4 2
2 1 2 3 4
3 2 3 4 5
$EndElements
"""
