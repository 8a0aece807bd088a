"""Robot of a log."""

from contextlib import suppress

from footfall.common.errors import UserError
from footfall.deploy.log_file import LogFile
from footfall.robots.description import Robot


def logged_robot(log: LogFile) -> Robot:
    """Robot named in a log, by name or folder.

    Raises:
        UserError: it is not available, or has changed since.
    """
    from footfall.robots.description import load_robot

    name, folder, digest = (log.text(part) for part in ("robot", "robot_folder", "robot_digest"))
    for where in (name, folder):
        with suppress(UserError):
            robot = load_robot(where)
            if robot.digest == digest:
                return robot
    raise UserError(
        f"the log was made with robot {name} of {folder},"
        " which is not available or has changed since: give --robot"
    )


def check_joints(log: LogFile, robot: Robot) -> None:
    """Raise UserError if a log's joints are not those of a robot."""
    if log.joints != list(robot.joint_names):
        raise UserError(
            f"{log.path} is from another robot than {robot.name}: its joints are {', '.join(log.joints)}"
        )
