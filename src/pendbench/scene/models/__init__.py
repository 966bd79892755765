"""Model files, MJCF and URDF: compiled by MuJoCo, and read from the compiled model as a planar chain.

`source` says what a file may hold before anything compiles it, `compiled` compiles it, `plane` reads the chain,
`beyond` says what else is there, `trial` runs the file as it stands, and `read` puts these together.
"""
