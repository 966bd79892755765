"""Files written by others: what is a chain accelerates as in MuJoCo, and what is none is refused in one line."""

from __future__ import annotations

import pytest

from pendbench.base.errors import InputError
from pendbench.scene.models.read import read_model
from support.foreign_models import foreign
from support.model_accelerations import worst_difference

URDF = "share/example-robot-data/robots"
CHAINS = [
    ("brax", "test_data/single_pendulum.xml"),
    ("brax", "test_data/single_pendulum_motor.xml"),
    ("brax", "test_data/double_pendulum.xml"),
    ("brax", "test_data/triple_pendulum.xml"),
    ("brax", "test_data/triple_pendulum_motor.xml"),
    ("dm_control", "suite/acrobot.xml"),
    ("dm_control", "suite/pendulum.xml"),
    ("dm_control", "suite/reacher.xml"),
    ("mujoco_playground", "_src/dm_control_suite/xmls/acrobot.xml"),
    ("mujoco_playground", "_src/dm_control_suite/xmls/pendulum.xml"),
    ("cmeel.prefix", f"{URDF}/asr_twodof_description/urdf/TwoDofs.urdf"),
]
REFUSED = [
    ("brax", "test_data/single_pendulum_position.xml", "actuator number 1 is in use"),
    ("brax", "test_data/single_universal_pendulum.xml", "body 'body1' has 2 joints"),
    ("dm_control", "suite/cartpole.xml", "joint 'slider' is a slide joint"),
    ("dm_control", "suite/finger.xml", "2 chains begin at the world: body 'proximal', body 'spinner'"),
    ("dm_control", "suite/humanoid.xml", "is a free joint"),
    ("cmeel.prefix", f"{URDF}/double_pendulum_description/urdf/double_pendulum_simple.urdf", " touches "),
    ("gymnasium", "envs/mujoco/assets/inverted_double_pendulum.xml", "joint 'slider' is a slide joint"),
    ("gymnasium", "envs/mujoco/assets/reacher.xml", "is a slide joint"),
    ("gymnasium", "envs/mujoco/assets/humanoid.xml", "is a free joint"),
]


@pytest.mark.parametrize(("package", "file"), CHAINS)
def test_chains_of_others_accelerate_as_in_mujoco(package, file):
    assert worst_difference(foreign(package, *file.split("/")), states=20, seed=1) < 1e-9


@pytest.mark.parametrize(("package", "file", "words"), REFUSED)
def test_what_others_wrote_and_is_no_chain(package, file, words):
    with pytest.raises(InputError) as error:
        read_model(foreign(package, *file.split("/")))
    assert words in str(error.value)
