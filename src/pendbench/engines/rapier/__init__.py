"""Rapier as an engine, from the package `rapier3d`: revolute joints between bodies, by impulses or as a multibody.

`multibody` is in joint angles: a link may have no inertia about its centre, so points are points. On by default and
switched off: damping of 0.1 in every joint of a multibody, whether or not anybody asked for it, and sleep. A multibody
starts straight and at rest whatever its bodies' places are, and whatever hangs from a fixed body has six more
coordinates before its first step; it is put into its start by displacements of its coordinates.

`impulse` holds bodies together, which need an inertia: one of 0 is taken for infinite, and the body does not turn. So a
point gets 1e-4 of m l^2, which is what its plateau comes from.

Rapier's solver iterations are small steps, four in a step by default. All numbers are of single precision.
"""
