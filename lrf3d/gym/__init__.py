"""Environments of Gymnasium for learning to drive: one robot, or a thousand at once.

``import lrf3d.gym`` registers ``lrf3d/Drive-v0``; then ``gymnasium.make("lrf3d/Drive-v0")`` gives a
:class:`DriveEnv`, and ``gymnasium.make_vec("lrf3d/Drive-v0", num_envs=1024)`` a
:class:`DriveVectorEnv`, whose robots' beams are cast together.
"""

from lrf3d.errors import missing_extra

try:
    import gymnasium
except ModuleNotFoundError:
    raise missing_extra("environments need Gymnasium", "gym") from None

from lrf3d.gym.drive import DriveEnv, DriveVectorEnv

__all__ = ["DriveEnv", "DriveVectorEnv"]

ID = "lrf3d/Drive-v0"
"""The identifier of the environment in Gymnasium."""

if ID not in gymnasium.registry:
    gymnasium.register(
        ID,
        entry_point="lrf3d.gym.drive:DriveEnv",
        vector_entry_point="lrf3d.gym.drive:DriveVectorEnv",
    )
