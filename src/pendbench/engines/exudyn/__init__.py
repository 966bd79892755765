"""Exudyn as an engine: its kinematic tree, in joint angles, under its own solvers.

The tree is in minimal coordinates: no joint is a constraint, so nothing can come apart. A link may have no inertia
about its centre. Nothing has to be switched off: there is no damping by default. Its default solver, generalised alpha,
has a spectral radius of 0.9, which damps what swings within a few steps, and nothing else.

Effects are a user function in Python that is called at every evaluation of the equations, so methods keep their order.
A new call of `SolveDynamic` forgets what the implicit solvers know of the last step; so those with a fixed step are
made once and asked to go on by `SolveSteps`. What that consists of can be called too, and must not be: where Newton's
method begins a step again, it begins at the state that `SolveSteps` alone keeps. DOPRI5, which chooses its steps, is
explicit and knows nothing of the last: each advance is a call of its own, from the state that the one before left.
"""
