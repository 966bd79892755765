"""The rows of a system's scratch, (rows, n), by name: what the recursions keep of each link on their way.

Rows are shared where no recursion needs both at once. One thread, one system.
"""

from __future__ import annotations

#: Of the bends or, for momenta, of the rods' directions.
COSINE, SINE = 0, 1

#: Of massless rods: the mean `own + passed T` and its divisor. Outwards, tensions take the place of the cosines.
OWN, PASSED, WHOLE = 2, 3, 4
ACROSS, TENSION = SINE, COSINE

#: All that a chain under gravity alone needs.
BARE_ROWS = 5

#: What forces on the masses do across the rods.
HELD = 5

#: Of rods with mass, beside own and passed.
TURNED, WHIRL = 4, 5

#: For momenta: the masses' velocities; and for the way back, the forces across and what is passed on.
SPEED_X, SPEED_Y = 2, 3
PUSHED, CARRIED = 2, 3

#: The forces on the masses, in the frames of their own rods, and the torques on the rods.
FORCE_ALONG, FORCE_ACROSS, TORQUE = 6, 7, 8

#: With rotors in the joints. The torques are forces by then.
DRIVEN = TORQUE

ROWS = 9
