"""Sources, settings and missions that `--from` accepts."""

import pytest

from footfall.common.errors import UserError
from footfall.operate.sources import check_source, is_mission


@pytest.mark.parametrize(
    ("name", "mission"),
    [("tour.yaml", True), ("my/tour.YML", True), ("gamepad", False), ("gamepad:mine.yaml", False)],
)
def test_a_yaml_file_is_a_mission_unless_it_holds_a_sources_settings(name: str, mission: bool) -> None:
    assert is_mission(name) is mission
    check_source(name)


def test_a_source_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UserError, match="gamepda"):
        check_source("gamepda")
