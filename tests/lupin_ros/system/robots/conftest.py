"""Three robots in one domain, which is theirs alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.lupin_ros.system.robots.three import NAMES, Robot


@pytest.fixture(scope="module")
def robots(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Robot]]:
    """Each is named in another way, and drives."""
    folder, found = tmp_path_factory.mktemp("robots"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        for name in NAMES:
            patch.setenv("LUPIN_ROBOT", name)
            found.append(Robot(name, folder / name))
        patch.setenv("LUPIN_ROBOT", "robot1")
        found[0].bring_up((), ())
        patch.delenv("LUPIN_ROBOT")
        found[1].bring_up(("-r", "__ns:=/robot2"), ())
        found[2].bring_up(("-p", "frame_prefix:=robot3/"), ("--robot", "robot3"))
    try:
        for robot in found:
            robot.operator.in_state("READY")
        yield found
    finally:
        stubborn = [node for robot in found for node in robot.world.stop()]
        for robot in found:
            robot.operator.ros.close()
    assert stubborn == []
