"""The parts of the page, each with what is around it stood in for: what it reads, draws, says and does."""

import json
import multiprocessing
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("viser")

from footfall.common import colours
from footfall.common.errors import UserError
from footfall.pages import snapshots, walk
from footfall.pages.geometry import visible_shapes
from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.pages.page import serving
from footfall.pages.panel import CURVES, NO_CURVES, Panel
from footfall.pages.scene import Scene, _level
from footfall.pages.snapshots import (
    FINISHED,
    NEWEST,
    Exported,
    Exporter,
    Snapshot,
    Snapshots,
    _export,
    newest_checkpoint,
)
from footfall.pages.status import Status, _age, as_markdown
from footfall.pages.walk import Pace, Walk
from footfall.policies.contract import CommandRange
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = int(probe.getsockname()[1])
    with serving("localhost", port, "test") as server:
        yield server


TILTED = Rotation.from_euler("ZYX", [2.0, -0.4, 0.3])  # a heading of 2 rad, then pitch and roll


class TestScene:
    @pytest.fixture(scope="class")
    @classmethod
    def scene(cls, server: Any, go1: Robot) -> Scene:
        return Scene(server, go1, plant_model(go1))

    @pytest.fixture
    def data(self, go1: Robot) -> mujoco.MjData:
        """The robot somewhere, tilted about all axes."""
        model = plant_model(go1)
        data = mujoco.MjData(model)
        data.qpos[:7] = [3.0, -2.0, 0.5, *TILTED.as_quat()[[3, 0, 1, 2]]]
        mujoco.mj_kinematics(model, data)
        return data

    def test_arrows_are_level_in_the_robots_heading_and_above_it(
        self, scene: Scene, data: mujoco.MjData, go1: Robot
    ) -> None:
        scene.show(data, np.array([0.5, -0.25, 0.9]), np.array([-0.1, 0.3, 0.8]), follow=False)
        height = go1.description.standing_height_m
        turned = Rotation.from_euler("Z", 2.0)
        for name, vector, above in (("command", [0.5, -0.25, 0], 0.75), ("velocity", [-0.1, 0.3, 0], 0.95)):
            arrow = scene._arrows[name]
            assert arrow.visible
            np.testing.assert_allclose(arrow.points, [[np.zeros(3), 0.4 * turned.apply(vector)]], atol=1e-6)
            np.testing.assert_allclose(arrow.position, [3.0, -2.0, 0.5 + above * height], atol=1e-6)

    def test_bodies_are_drawn_by_their_frames_and_not_by_their_centres_of_mass(
        self, scene: Scene, data: mujoco.MjData
    ) -> None:
        scene.show(data, np.zeros(3), np.zeros(3), follow=False)
        for body, frame in scene.bodies.items():
            np.testing.assert_allclose(frame.position, data.xpos[body], atol=1e-6)
            np.testing.assert_allclose(frame.wxyz, data.xquat[body], atol=1e-6)
        bodies = list(scene.bodies)
        assert np.abs(data.xpos[bodies] - data.xipos[bodies]).max() > 0.01

    def test_an_arrow_of_nothing_is_not_there(self, scene: Scene, data: mujoco.MjData) -> None:
        scene.show(data, np.array([0.04, 0.0, 0.9]), np.array([0.0, 0.06, 0.0]), follow=False)
        assert [scene._arrows[name].visible for name in ("command", "velocity")] == [False, True]

    def test_the_view_catches_up_with_the_robot_by_tenths_where_it_follows(
        self, scene: Scene, data: mujoco.MjData
    ) -> None:
        scene.begin()
        for follow, way in ((False, 0.0), (True, 0.1), (True, 0.19)):
            scene.show(data, np.zeros(3), np.zeros(3), follow)
            if follow:
                np.testing.assert_allclose(scene._world.position, [-3.0 * way, 2.0 * way, 0.0], atol=1e-6)
        scene.begin()
        scene.show(data, np.zeros(3), np.zeros(3), follow=True)
        np.testing.assert_allclose(scene._world.position, [-0.3, 0.2, 0.0], atol=1e-6)

    def test_a_narrow_view_is_from_further_away_with_the_same_target(self, scene: Scene, go1: Robot) -> None:
        height, moved = go1.description.standing_height_m, []

        class Camera:
            aspect, look_at = 0.45, "target"

            def __setattr__(self, name: str, value: Any) -> None:
                moved.append((name, value))

        scene._step_back(SimpleNamespace(camera=Camera()))  # type: ignore[arg-type]
        (first, position), last = moved
        assert (first, last) == ("position", ("look_at", "target"))
        np.testing.assert_allclose(position, 2.0 * height * np.array([2.2, -3.4, 1.9]))
        moved.clear()
        Camera.aspect = 0.9
        scene._step_back(SimpleNamespace(camera=Camera()))  # type: ignore[arg-type]
        assert moved == []

    def test_the_first_view_is_on_the_lower_body(self, scene: Scene, server: Any, go1: Robot) -> None:
        height = go1.description.standing_height_m
        np.testing.assert_allclose(server.initial_camera.look_at, [0.0, 0.0, 0.6 * height])
        np.testing.assert_allclose(server.initial_camera.position, height * np.array([2.2, -3.4, 1.9]))

    def test_shapes_hang_on_their_bodies_in_their_colours(self, go1: Robot) -> None:
        """With a server that only notes what it is given."""
        given: dict[str, Any] = {}

        def note(name: str, *args: Any, **named: Any) -> Any:
            given[name] = (args, named)
            return SimpleNamespace(name=name)

        drawing = SimpleNamespace(
            add_frame=note, add_grid=note, add_arrows=note, add_mesh_simple=note,
            configure_default_lights=lambda **_: None,
        )  # fmt: skip
        camera, connected = SimpleNamespace(), []
        model = plant_model(go1)
        shapes = visible_shapes(model)
        model_rgba = model.geom_rgba
        model_rgba[shapes[1].geom] = [0.2, 0.4, 0.6, 0.25]
        server: Any = SimpleNamespace(
            scene=drawing, initial_camera=camera, on_client_connect=connected.append
        )
        scene = Scene(server, go1, model)
        assert connected == [scene._step_back]
        for shape in visible_shapes(model):
            (vertices, faces), named = given[f"/world/body_{shape.body}/geom_{shape.geom}"]
            np.testing.assert_array_equal(vertices, shape.vertices)
            np.testing.assert_array_equal(faces, shape.faces)
            np.testing.assert_array_equal(named["position"], shape.position)
            np.testing.assert_array_equal(named["wxyz"], shape.quaternion)
            assert named["color"] == tuple(round(255 * part) for part in shape.rgba[:3])
            edged = model.geom_type[shape.geom] in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER)
            assert named["flat_shading"] == edged
        assert given[f"/world/body_{shapes[1].body}/geom_{shapes[1].geom}"][1]["opacity"] == 0.25
        assert given[f"/world/body_{shapes[0].body}/geom_{shapes[0].geom}"][1]["opacity"] is None
        for name, colour in (("command", colours.COMMAND), ("velocity", colours.VELOCITY)):
            (_, drawn), _ = given[f"/world/{name}"]
            assert drawn == tuple(round(255 * part) for part in colour[:3])

    def test_a_heading_is_what_is_left_of_a_rotation_without_its_tilt(self) -> None:
        np.testing.assert_allclose(
            _level(TILTED.as_matrix()), Rotation.from_euler("Z", 2.0).as_matrix(), atol=1e-12
        )


class TestGeometry:
    @pytest.mark.parametrize(
        ("geom", "extent"),
        [
            ('type="box" size=".1 .2 .3"', (0.2, 0.4, 0.6)), ('type="sphere" size=".1"', (0.2, 0.2, 0.2)),
            ('type="ellipsoid" size=".1 .2 .3"', (0.2, 0.4, 0.6)), ('type="capsule" size=".1 .3"', (0.2,
            0.2, 0.8)),
            ('type="cylinder" size=".1 .3"', (0.2, 0.2, 0.6)),
        ],
    )  # fmt: skip
    def test_each_kind_has_its_size_about_its_middle(self, geom: str, extent: tuple[float, ...]) -> None:
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><body><geom {geom} pos="1 2 3" euler="10 20 30" rgba=".1 .2 .3 .4"/>'
            '<geom size="1" group="3"/></body><geom type="plane" size="1 1 1"/></worldbody></mujoco>'
        )
        (shape,) = visible_shapes(model)
        np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), extent, rtol=0.02)
        middle = (shape.vertices.max(axis=0) + shape.vertices.min(axis=0)) / 2
        np.testing.assert_allclose(middle, np.zeros(3), atol=1e-6)
        np.testing.assert_allclose(shape.position, [1, 2, 3])
        turned = Rotation.from_euler("XYZ", [10, 20, 30], degrees=True)
        np.testing.assert_allclose(shape.quaternion, turned.as_quat()[[3, 0, 1, 2]], atol=1e-12)
        np.testing.assert_allclose(shape.rgba, [0.1, 0.2, 0.3, 0.4], atol=1e-6)
        assert (shape.geom, shape.body) == (1, 1)  # the first is the ground

    def test_what_is_drawn_stays_as_it_was_when_the_model_changes(self, go1: Robot) -> None:
        model = plant_model(go1)
        shapes = visible_shapes(model)
        before = [(s.position.copy(), s.quaternion.copy(), s.rgba.copy()) for s in shapes]
        model.geom_pos[:], model.geom_quat[:], model.geom_rgba[:], model.mat_rgba[:] = 7.0, 7.0, 7.0, 7.0
        for shape, values in zip(shapes, before, strict=True):
            for now, then in zip((shape.position, shape.quaternion, shape.rgba), values, strict=True):
                np.testing.assert_array_equal(now, then)

    def test_a_material_colours_what_has_no_colour_of_its_own(self) -> None:
        model = mujoco.MjModel.from_xml_string(
            '<mujoco><asset><material name="m" rgba="1 0 0 1"/></asset><worldbody><body>'
            '<geom size=".1" material="m"/><geom size=".1" material="m" rgba="0 1 0 1"/><geom size=".1"/>'
            "</body></worldbody></mujoco>"
        )
        colours_of = [shape.rgba.tolist() for shape in visible_shapes(model)]
        assert colours_of == [[1, 0, 0, 1], [0, 1, 0, 1], [0.5, 0.5, 0.5, 1]]

    def test_meshes_are_not_mixed_up(self) -> None:
        corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3))
        box = f'<mesh name="box" vertex="{corners}"/>'
        shapes = " ".join(
            f'<mesh name="m{k}" vertex="0 0 0 {k} 0 0 0 {2 * k} 0 0 0 {3 * k}"/>' for k in (1, 2)
        )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><asset>{box}{shapes}</asset><worldbody><body><geom type="mesh" mesh="box"/>'
            '<geom type="mesh" mesh="m2"/>'
            '<geom type="mesh" mesh="m1"/></body></worldbody></mujoco>'
        )
        edged, two, one = visible_shapes(model)
        assert len(edged.faces) == 12
        for shape, size in ((one, 1.0), (two, 2.0)):
            turned = Rotation.from_quat(shape.quaternion[[1, 2, 3, 0]]).apply(shape.vertices)
            np.testing.assert_allclose(np.ptp(turned, axis=0), [size, 2 * size, 3 * size], rtol=1e-5)
            assert shape.faces.max() == len(shape.vertices) - 1


class TestPanel:
    @pytest.fixture
    def panel(self, server: Any) -> Panel:
        return Panel(server)

    def test_sliders_span_the_ranges_and_begin_ahead_or_as_near_as_they_may(self, panel: Panel) -> None:
        assert not panel._commands.visible
        panel.offer_commands(CommandRange((-1.0, 0.3), (0.1, 0.7), (-1.4, -0.2)))
        assert panel._commands.visible
        assert [(s.min, s.max) for s in panel._sliders] == [(-1.0, 0.3), (0.1, 0.7), (-1.4, -0.2)]
        np.testing.assert_allclose(panel.command, [0.3, 0.1, -0.2])
        assert [s.label for s in panel._sliders] == ["Forward, m/s", "Left, m/s", "Yaw, rad/s"]

    def test_within_wide_ranges_it_walks_ahead_at_half_a_metre_per_second(self, panel: Panel) -> None:
        panel.offer_commands(CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0)))
        np.testing.assert_allclose(panel.command, [0.5, 0.0, 0.0])

    def test_a_number_typed_beyond_a_range_is_clipped_to_it(self, panel: Panel) -> None:
        panel.offer_commands(CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0)))
        for slider, value in zip(panel._sliders, (9.0, -9.0, 0.25), strict=True):
            slider.value = value
        np.testing.assert_allclose(panel.command, [1.5, -0.5, 0.25])

    def test_a_push_is_from_a_nudge_to_a_shove(self, panel: Panel) -> None:
        slider = panel._push_m_s
        assert (slider.min, slider.max, slider.value) == (0.2, 4.0, 1.0)
        slider.value, panel._push_asked = 9.0, True
        assert panel.take_push() == 4.0

    def test_each_chart_is_of_its_own_metric(self, panel: Panel, tmp_path: Path) -> None:
        """The names are those that a training writes."""
        names = {
            "Reward per second": "reward/total",
            "Velocity error, m/s": "tracking/linear_error_m_s",
            "Yaw-rate error, rad/s": "tracking/yaw_error_rad_s",
            "Episode length, s": "episode/length_s",
            "Learning rate, thousandths": "learning/learning_rate",
            "Steps per second, thousands": "speed/steps_per_s",
        }
        units = {"learning/learning_rate": 1e3, "speed/steps_per_s": 1e-3}
        path = tmp_path / "metrics.jsonl"
        rows = [{"step": k} | {name: k + place for place, name in enumerate(names.values())} for k in (1, 2)]
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
        metrics = MetricsFile(path)
        metrics.refresh()
        panel.draw(metrics)
        charts = {chart.title: chart for chart in panel._charts.values()}
        assert set(charts) == set(names)
        for place, (title, name) in enumerate(names.items()):
            expected = units.get(name, 1.0) * np.array([1.0 + place, 2.0 + place])
            np.testing.assert_allclose(charts[title].data[1], expected)

    def test_policies_are_offered_and_one_is_chosen(self, panel: Panel) -> None:
        assert panel.policy == NEWEST
        panel.offer_policies([NEWEST, FINISHED, "iteration 7"])
        assert panel._policy.options == (NEWEST, FINISHED, "iteration 7")
        panel._policy.value = "iteration 7"
        assert panel.policy == "iteration 7"

    def test_wishes_are_taken_once(self, panel: Panel) -> None:
        assert (panel.take_push(), panel.take_restart()) == (0.0, False)
        panel._push_m_s.value = 1.7
        panel._push_asked = panel._restart_asked = True
        assert (panel.take_push(), panel.take_restart()) == (1.7, True)
        assert (panel.take_push(), panel.take_restart()) == (0.0, False)
        panel._push_m_s.value, panel._push_asked = 0.05, True
        assert panel.take_push() == 0.2

    def test_it_is_paused_on_request_and_while_nobody_looks(
        self, server: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        panel = Panel(server)
        visitors: dict[int, Any] = {}
        monkeypatch.setattr(server, "get_clients", lambda: visitors)
        assert (panel.seen, panel.paused) == (False, True)
        visitors[1] = "somebody"
        assert (panel.seen, panel.paused) == (True, False)
        panel._pause.value = True
        assert panel.paused
        assert panel.follow
        panel._follow.value = False
        assert not panel.follow

    def test_buttons_ask_for_what_they_say(self, server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        clicked: dict[str, Any] = {}

        def button(label: str, **_: Any) -> Any:
            return SimpleNamespace(on_click=lambda action: clicked.setdefault(label, action))

        monkeypatch.setattr(server.gui, "add_button", button)
        panel = Panel(server)
        clicked["Push it"](None)
        assert (panel._push_asked, panel._restart_asked) == (True, False)
        clicked["Start again"](None)
        assert panel.take_restart()

    def test_charts_are_in_their_units_and_follow_the_run(self, panel: Panel, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        metric = {"learning/learning_rate": 0.002, "speed/steps_per_s": 500.0}
        rows = [
            json.dumps({"step": 1_000_000 * k} | {name: k * unit for name, unit in metric.items()}) + "\n"
            for k in (1, 2, 4)
        ]
        metrics = MetricsFile(path)
        path.write_text(rows[0])
        metrics.refresh()
        panel.draw(metrics)
        assert (panel._charts, panel._axis.content) == ({}, NO_CURVES)  # one point is no curve
        path.write_text("".join(rows[:2]))
        metrics.refresh()
        panel.draw(metrics)
        charts = dict(panel._charts)
        assert set(charts) == {"learning/learning_rate", "speed/steps_per_s"}
        assert "million" in panel._axis.content
        path.write_text("".join(rows))
        metrics.refresh()
        panel.draw(metrics)
        assert panel._charts == charts  # the same charts, with more in them
        rate, speed = (charts[name].data for name in ("learning/learning_rate", "speed/steps_per_s"))
        np.testing.assert_allclose(rate, [[1, 2, 4], [2, 4, 8]])
        np.testing.assert_allclose(speed, [[1, 2, 4], [0.5, 1.0, 2.0]])
        titles = {curve.metric: curve.title for curve in CURVES}
        assert all(chart.title == titles[name] for name, chart in charts.items())

    def test_a_long_curve_is_thinned_along_both_axes(self, panel: Panel, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        rows = [json.dumps({"step": 1_000_000 * k, "reward/total": 3.0 * k}) for k in range(1001)]
        path.write_text("\n".join(rows) + "\n")
        metrics = MetricsFile(path)
        metrics.refresh()
        panel.draw(metrics)
        steps, values = panel._charts["reward/total"].data
        assert len(steps) == len(values) == 400
        np.testing.assert_allclose(values, 3.0 * steps)

    def test_the_status_is_sent_when_it_changes(self, panel: Panel) -> None:
        panel.say("one")
        panel.say("one")
        assert panel._status.content == "one"
        panel.say("two")
        assert panel._status.content == "two"


class TestStatus:
    def status(self, **changes: Any) -> Status:
        plain = Status(
            "go1, smoke",
            "runs/mine",
            2000,
            16,
            trained_steps=500,
            metrics_age_s=3.0,
            iteration=30,
            policies=1,
        )
        for name, value in changes.items():
            setattr(plain, name, value)
        return plain

    def test_all_of_it_in_order(self) -> None:
        status = self.status(
            mode="WALKING", pace=0.987, episodes=5, falls=2, last_fall="it tilted", problem="a bad file",
            metrics_age_s=180.0, command=np.array([0.5, -0.25, 0.125]), velocity=np.array([0.1, 0.2, -0.3]),
        )  # fmt: skip
        assert as_markdown(status) == (
            "**go1, smoke**\n\n| | |\n| --- | --- |\n"
            "| Training | 500 of 2,000 steps (25%), nothing new for 3 min |\n"
            "| Policy | of iteration 30, 480 steps |\n"
            "| Robot | walking, 0.99 × real time |\n"
            "| Falls | 2 in 5 starts: it tilted |\n"
            "| Forward | +0.10 of +0.50 m/s |\n"
            "| Left | +0.20 of -0.25 m/s |\n"
            "| Yaw | -0.30 of +0.12 rad/s |\n\n"
            "Not usable: a bad file\n\n"
            "If the training was stopped, it goes on with `footfall train --resume runs/mine`"
        )

    def test_what_there_is_nothing_of_is_left_out(self) -> None:
        text = as_markdown(self.status(episodes=1))
        assert "| Falls | 0 in 1 starts |" in text
        assert "Not usable" not in text
        assert "goes on with" not in text
        assert "| Training | 500 of 2,000 steps (25%) |" in text
        assert "the run's policy.onnx" in as_markdown(self.status(iteration=None))
        assert "2,500 of 2,000 steps (100%)" in as_markdown(self.status(trained_steps=2500))

    def test_what_is_waited_for(self) -> None:
        nothing = self.status(policies=0, iteration=None, metrics_age_s=None)
        assert "**waiting for the first checkpoint**" in as_markdown(nothing)
        assert "| Training | no metrics yet |" in as_markdown(nothing)
        assert "| Policy |" not in as_markdown(nothing)
        for iteration, told in ((0, "0"), (1200, "1,200")):
            nothing.exporting = iteration
            assert f"**preparing the policy of iteration {told}**" in as_markdown(nothing)

    def test_a_training_is_quiet_after_two_minutes_unless_it_is_finished(self) -> None:
        def told(age_s: float, finished: bool) -> bool:
            return "train --resume runs/mine" in as_markdown(
                self.status(metrics_age_s=age_s, finished=finished)
            )

        assert [told(120.0, False), told(120.1, False), told(999.0, True)] == [False, True, False]
        done = as_markdown(self.status(finished=True, trained_steps=2000, metrics_age_s=7300.0))
        assert "| Training | **finished** after 2,000 steps, 2 h ago |" in done

    @pytest.mark.parametrize(
        ("seconds", "said"),
        [
            (-1.0, "0 s"), (119.4, "119 s"), (120.0, "2 min"), (7199.0, "120 min"), (7200.0, "2 h"),
            (172_799.0, "48 h"), (172_800.0, "2 days"),
        ],
    )  # fmt: skip
    def test_ages_are_in_the_unit_that_a_reader_wants(self, seconds: float, said: str) -> None:
        assert _age(seconds) == said


class TestMetricsFile:
    def test_its_age_is_since_it_grew(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = tmp_path / "metrics.jsonl"
        metrics = MetricsFile(path)
        assert metrics.age_s() is None
        path.write_text('{"step": 1}\n')
        os.utime(path, (1000.0, 2000.0))
        monkeypatch.setattr("footfall.pages.metrics_file.time.time", lambda: 2042.0)
        assert metrics.age_s() == pytest.approx(42.0)

    def test_rows_are_in_the_order_of_their_steps_whenever_they_were_written(self, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        path.write_text(
            '{"step": 20, "a": 2}\n{"step": 10, "a": 1}\n{"step": 20, "a": 5}\n{"step": 5, "b": 7}\n'
        )
        metrics = MetricsFile(path)
        metrics.refresh()
        assert [part.tolist() for part in metrics.curve("a")] == [[10, 20], [1, 5]]
        assert metrics.last_step == 20

    @pytest.mark.parametrize("line", ["", "{", "[1]", "7", '{"a": 1}', '{"step": null}', '{"step": "x"}'])
    def test_a_line_that_is_no_row_is_passed_over(self, tmp_path: Path, line: str) -> None:
        path = tmp_path / "metrics.jsonl"
        path.write_text(f'{{"step": 1, "a": 3}}\n{line}\n{{"step": 2, "a": 4}}\n')
        metrics = MetricsFile(path)
        assert metrics.refresh()
        assert [part.tolist() for part in metrics.curve("a")] == [[1, 2], [3, 4]]

    def test_a_shorter_file_is_read_from_its_beginning(self, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        metrics = MetricsFile(path)
        path.write_text('{"step": 10, "a": 1}\n{"step": 20, "a": 2}\n')
        metrics.refresh()
        path.write_text('{"step": 10, "a": 3}\n')
        assert metrics.refresh()
        assert (metrics.curve("a")[1].tolist(), metrics.last_step) == ([3], 10)
        assert not metrics.refresh()

    def test_thinning_keeps_the_ends_and_even_steps(self) -> None:
        assert thinned(np.arange(11), 6).tolist() == [0, 2, 4, 6, 8, 10]
        assert thinned(np.arange(6), 6).tolist() == list(range(6))


class TestSnapshots:
    @pytest.fixture
    def run(self, tmp_path: Path) -> Path:
        (tmp_path / "run" / "checkpoints").mkdir(parents=True)
        (tmp_path / "out").mkdir()
        return tmp_path / "run"

    def write(self, path: Path, at_s: int) -> Path:
        path.write_text("x")
        os.utime(path, (at_s, at_s))
        return path

    def found(self, run: Path) -> tuple[Snapshots, SimpleNamespace]:
        """With an exporter that is asked and answers when told to."""
        exporter = SimpleNamespace(asked=[], woken=0, answer=None)
        exporter.start = lambda *given: exporter.asked.append(given)
        exporter.poll = lambda: exporter.answer
        exporter.wake = lambda: setattr(exporter, "woken", exporter.woken + 1)
        snapshots = Snapshots(run, run.parent / "out")
        snapshots._exporter = exporter  # type: ignore[assignment]
        return snapshots, exporter

    def test_the_exporter_is_made_ready_while_there_is_nothing(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.poll() is None
        assert (exporter.woken, exporter.asked) == (1, [])

    def test_a_checkpoint_is_exported_once_and_handed_out_when_it_is_ready(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        checkpoint = self.write(run / "checkpoints" / "00000012.ckpt", 100)
        out = run.parent / "out" / "00000012.onnx"
        assert snapshots.poll() is None
        assert exporter.asked == [(checkpoint, out)]
        assert snapshots.exporting == 12
        assert snapshots.poll() is None  # not yet
        exporter.answer = Exported(out)
        assert snapshots.poll() == Snapshot(out, 12)
        assert snapshots.exporting is None
        assert snapshots.poll() is None
        assert len(exporter.asked) == 1

    def test_a_problem_is_told_and_its_checkpoint_is_not_tried_again(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        snapshots.poll()
        exporter.answer = Exported(None, "it is damaged")
        assert snapshots.poll() is None
        assert snapshots.problem == "it is damaged"
        assert snapshots.poll() is None
        assert len(exporter.asked) == 1
        done = self.write(run / FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        assert snapshots.problem == ""

    def test_the_newest_is_what_was_written_last(self, run: Path) -> None:
        snapshots, _ = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        done = self.write(run / FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        later = self.write(run / "checkpoints" / "00000013.ckpt", 300)
        assert snapshots.poll() is None
        assert snapshots.exporting == 13
        assert newest_checkpoint(run) == later
        self.write(run / "checkpoints" / "00000009.ckpt", 400)  # the number counts, not the time
        self.write(run / "checkpoints" / "99999999.ckpt", 500)
        self.write(run / "checkpoints" / "100000000.ckpt", 50)
        assert newest_checkpoint(run) == run / "checkpoints" / "100000000.ckpt"
        assert newest_checkpoint(run.parent) is None

    def test_what_was_exported_of_an_older_file_is_exported_anew(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        exported = self.write(run.parent / "out" / "00000012.onnx", 99)
        assert snapshots.poll() is None
        assert len(exporter.asked) == 1
        other, exporter = self.found(run)
        self.write(exported, 100)
        assert other.poll() == Snapshot(exported, 12)
        assert exporter.asked == []

    def test_names_are_from_the_newest_on_and_a_choice_is_found_by_its_own(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.names() == [NEWEST]
        kept = self.write(run / "checkpoints" / "00001200.ckpt", 100)
        self.write(run / "checkpoints" / "00000090.ckpt", 100)
        self.write(run.parent / "out" / "00000090.onnx", 100)
        dropped = self.write(run.parent / "out" / "00000007.onnx", 100)
        done = self.write(run / FINISHED, 200)
        names = [NEWEST, FINISHED, "iteration 1,200", "iteration 90", "iteration 7"]
        assert snapshots.names() == names
        snapshots.chosen = "iteration 7"
        assert snapshots.poll() == Snapshot(dropped, 7)
        snapshots.chosen = FINISHED
        assert snapshots.poll() == Snapshot(done, 1200)
        snapshots.chosen = "iteration 1,200"
        assert snapshots.poll() is None
        assert exporter.asked == [(kept, run.parent / "out" / "00001200.onnx")]
        snapshots.chosen = "iteration 5"
        exporter.answer = Exported(None)
        assert snapshots.poll() is None

    def test_what_was_asked_for_before_another_choice_is_not_handed_out(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000090.ckpt", 100)
        done = self.write(run / FINISHED, 50)
        assert snapshots.poll() is None
        snapshots.chosen = FINISHED
        exporter.answer = Exported(run.parent / "out" / "00000090.onnx")
        assert snapshots.poll() == Snapshot(done, 90)

    def test_a_checkpoint_that_was_written_again_is_exported_again(self, run: Path) -> None:
        """A resumed run computes iterations anew."""
        snapshots, exporter = self.found(run)
        kept = self.write(run / "checkpoints" / "00000090.ckpt", 200)
        out = self.write(run.parent / "out" / "00000090.onnx", 100)
        snapshots.chosen = "iteration 90"
        assert snapshots.poll() is None
        assert exporter.asked == [(kept, out)]

    def test_an_exporter_that_dies_is_a_problem_and_another_is_started(self, run: Path) -> None:
        exporter, ended = Exporter(run), []
        ours, theirs = multiprocessing.Pipe()
        process = SimpleNamespace(
            terminate=lambda: ended.append("terminate"), join=lambda: ended.append("join")
        )
        exporter._connection, exporter._process = ours, process  # type: ignore[assignment]
        exporter.start(Path("a.ckpt"), Path("a.onnx"))
        assert theirs.recv() == (run, Path("a.ckpt"), Path("a.onnx"))
        assert exporter.poll() is None
        theirs.send(Exported(Path("a.onnx")))
        assert exporter.poll() == Exported(Path("a.onnx"))
        theirs.close()
        exporter.start(Path("b.ckpt"), Path("b.onnx"))  # nobody is there to be told
        assert exporter.poll() == Exported(None, "the process that exports it died")
        assert ended == ["terminate", "join"]
        assert ours.closed
        assert exporter._process is None

    def test_an_export_tells_what_went_wrong_of_the_file_that_it_was_asked_for(
        self, run: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("footfall.train.entry.learning_libraries", nullcontext)
        checkpoint = self.write(run / "checkpoints" / "00000003.ckpt", 100)
        out = run.parent / "out" / "00000003.onnx"

        def fail(_: Path, __: Path, copy: Path) -> None:
            raise UserError(f"{copy} is\n damaged")

        monkeypatch.setattr("footfall.train.api.export_run", fail)
        assert _export(run, checkpoint, out) == Exported(None, f"{checkpoint} is damaged")
        assert list(out.parent.iterdir()) == []
        assert _export(run, run / "checkpoints" / "gone.ckpt", out) == Exported(None)
        given: list[Any] = []
        monkeypatch.setattr(
            "footfall.train.api.export_run", lambda *each: given.append(each) or ("made", 0.0)
        )
        assert _export(run, checkpoint, out) == Exported("made")  # type: ignore[arg-type]
        assert given == [(run, out, out.with_name(checkpoint.name))]


def test_the_exporting_process_leaves_the_accelerator_the_cores_and_ctrl_c_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("JAX_PLATFORMS", "cuda")
    monkeypatch.setattr("footfall.train.entry.learning_libraries", nullcontext)
    done: list[Any] = []
    monkeypatch.setattr(snapshots.signal, "signal", lambda *given: done.append(given))
    monkeypatch.setattr(snapshots.os, "nice", lambda by: done.append(by) or 3)

    def recv() -> Any:
        done.append(os.environ["JAX_PLATFORMS"])
        raise EOFError

    snapshots._export_on_demand(SimpleNamespace(recv=recv, send=done.append))  # type: ignore[arg-type]
    assert done == [(signal.SIGINT, signal.SIG_IGN), 0, 7, "cpu"]  # from a niceness of 3 to 10


class TestPace:
    def test_time_that_was_lost_or_paused_is_not_caught_up_on_and_the_factor_is_of_late(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        now, slept = [50.0], []

        def sleep(time_s: float) -> None:
            slept.append(time_s)
            now[0] += time_s

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
        pace = Pace()
        assert pace.factor == 1.0
        pace.wait(0.5)
        now[0] += 0.55  # 50 ms late: within tolerance, caught up on by sleeping less
        pace.wait(1.0)
        pace.wait(1.5)
        assert slept == pytest.approx([0.5, 0.45])
        assert pace.factor == pytest.approx(1.0 / 1.05)
        now[0] += 2.0
        pace.wait(1.7)  # 1.8 s late: lost
        assert pace.factor == pytest.approx(0.7 / 2.45, rel=1e-3)
        now[0] += 100.0
        pace.resume(1.7)
        pace.wait(2.0)
        assert slept[2:] == pytest.approx([0.3])
        now[0] += 1.0
        pace.wait(3.0)
        assert pace.factor == pytest.approx(1.3 / 1.3)

    def test_a_fifth_of_a_second_is_lost_for_good(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now, slept = [50.0], []

        def sleep(time_s: float) -> None:
            slept.append(time_s)
            now[0] += time_s

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
        pace = Pace()
        now[0] += 0.7
        pace.wait(0.5)  # 0.2 s late
        for simulated_s in (0.9, 1.3):
            pace.wait(simulated_s)
        assert slept == pytest.approx([0.4, 0.4])

    def test_a_pause_does_not_count_as_slowness(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now = [50.0]
        time = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s))
        monkeypatch.setattr(walk, "time", time)
        pace = Pace()
        now[0] += 100.0
        pace.resume(0.0)
        pace.wait(0.4)
        assert pace.factor == 1.0
        pace.wait(1.2)
        assert pace.factor == pytest.approx(1.0)


class TestWalk:
    @pytest.fixture
    def made(self, go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A walk in a world of stand-ins; `log` says what it did."""
        log: list[Any] = []
        now = SimpleNamespace(s=1000.0)

        def sleep(time_s: float) -> None:
            log.append(("sleep", time_s))
            now.s += time_s
            if now.s > 2000.0:
                stop.requested = True

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: now.s, sleep=sleep))
        stop = SimpleNamespace(requested=False)
        panel = SimpleNamespace(
            command=np.array([0.3, -0.2, 0.1]), paused=False, follow=True, seen=False, policy="chosen",
            push=0.0,
            restart=False, offer_commands=lambda ranges: log.append(("commands", ranges)),
            offer_policies=lambda names: log.append(("policies", names)),
            say=lambda text: log.append(("say", text)),
            draw=lambda metrics: log.append(("draw", metrics)),
        )  # fmt: skip
        panel.take_push = lambda: panel.push
        panel.take_restart = lambda: panel.restart
        snapshots = SimpleNamespace(
            problem="a problem",
            exporting=8,
            chosen="",
            next=None,
            names=lambda: ["a name"],
            poll=lambda: snapshots.next,
        )
        scene = SimpleNamespace(
            show=lambda *given: log.append(("show", *given)), begin=lambda: log.append(("begin",))
        )
        made = SimpleNamespace(robot="go1", preset="presets/mine.yaml", seed=4, trainer="brax")
        ppo = SimpleNamespace(iterations=10, steps_per_iteration=16)
        run: Any = SimpleNamespace(
            folder=tmp_path, policy=tmp_path / "policy.onnx", provenance=made, config=SimpleNamespace(ppo=ppo)
        )
        walking = Walk(run, go1, scene, panel, snapshots, stop)  # type: ignore[arg-type]
        return SimpleNamespace(
            walk=walking,
            log=log,
            panel=panel,
            snapshots=snapshots,
            stop=stop,
            now=now,
            run=run,
            status=walking._status,
        )

    def done(self, made: SimpleNamespace) -> list[str]:
        return [each[0] for each in made.log]

    def test_it_knows_what_it_shows(self, made: SimpleNamespace, tmp_path: Path) -> None:
        status = made.status
        assert status.title == "go1, preset mine, seed 4, brax"
        assert (status.folder, status.total_steps, status.steps_per_iteration) == (str(tmp_path), 160, 16)

    def test_it_looks_at_most_once_a_second_and_tells_what_it_saw(
        self, made: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "metrics.jsonl").write_text('{"step": 160}\n')
        monkeypatch.setattr(made.walk._metrics, "age_s", lambda: 42.0)
        made.walk._look()
        assert ("policies", ["a name"]) in made.log
        assert made.snapshots.chosen == "chosen"
        assert [each[0] for each in made.log if each[0] == "draw"] == ["draw"]
        assert (made.status.trained_steps, made.status.finished) == (160, False)
        assert made.status.metrics_age_s == 42.0
        assert (made.status.problem, made.status.exporting) == ("a problem", 8)
        assert made.log[-1] == ("say", as_markdown(made.status))
        made.log.clear()
        made.now.s += 0.99
        made.walk._look()
        assert made.log == []
        made.now.s += 0.02
        made.run.policy.touch()
        made.walk._look()
        assert self.done(made) == ["policies", "say"]  # nothing new to draw
        assert made.status.finished

    def test_the_first_policy_brings_its_commands_and_the_next_replaces_its_network(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        policies: list[Any] = []

        def newest(path: str, robot: Robot) -> Any:
            policies.append((path, robot.name))
            contract = SimpleNamespace(commands="ranges")
            return SimpleNamespace(contract=contract, replace_network=policies.append)

        monkeypatch.setattr(walk, "NewestPolicy", newest)
        for path, iteration in (("a.onnx", 3), ("b.onnx", 5)):
            made.snapshots.next = Snapshot(path, iteration)  # type: ignore[arg-type]
            made.panel.seen = True
            made.now.s += 2.0
            made.walk._look()
        assert policies == [("a.onnx", "go1"), "b.onnx"]
        assert [each for each in made.log if each[0] == "commands"] == [("commands", "ranges")]
        assert (made.status.iteration, made.status.policies) == (5, 2)

    def test_a_policy_is_looked_for_until_there_is_one_and_then_while_somebody_looks(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[str] = []
        made.snapshots.poll = lambda: asked.append("asked")
        for policy, seen, times in ((None, False, 1), ("policy", False, 1), ("policy", True, 2)):
            made.walk._policy, made.panel.seen = policy, seen
            made.now.s += 2.0
            made.walk._look()
            assert len(asked) == times

    def test_a_training_is_finished_after_its_last_step_alone(self, made: SimpleNamespace) -> None:
        """A policy.onnx may be one that was exported on the way."""
        made.run.policy.touch()
        metrics = made.run.folder / "metrics.jsonl"
        for step, finished in ((159, False), (160, True)):
            metrics.write_text(f'{{"step": {step}}}\n')
            made.walk._metrics = MetricsFile(metrics)
            made.now.s += 2.0
            made.walk._look()
            assert made.status.finished is finished

    def test_a_network_that_is_refused_changes_nothing_but_what_is_said(self, made: SimpleNamespace) -> None:
        def refuse(_: Path) -> None:
            raise UserError("another contract")

        made.walk._policy = SimpleNamespace(replace_network=refuse)
        made.status.iteration, made.status.policies = 3, 1
        made.panel.seen, made.snapshots.next = True, Snapshot(Path("b.onnx"), 5)
        made.walk._look()
        assert (made.status.iteration, made.status.policies) == (3, 1)
        assert made.status.problem == "another contract"

    def test_an_episode_is_walked_as_the_page_commands_and_its_fall_is_counted(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given: list[Any] = []
        traces = [
            SimpleNamespace(fell=True, fall_reason="it tilted", faults=("x",)),
            SimpleNamespace(fell=False, fall_reason="", faults=("motor 3",)),
            SimpleNamespace(fell=False, fall_reason="", faults=()),
        ]
        monkeypatch.setattr(walk, "run_episode", lambda *each: given.append(each) or traces[len(given) - 1])
        ends = []
        for _ in traces:
            made.walk._next_frame_us = 7_000_000  # of an episode before
            made.walk._episode("policy")
            assert made.walk._next_frame_us == 0
            assert isinstance(made.walk._pace, Pace)
            ends.append((made.status.episodes, made.status.falls, made.status.last_fall))
        assert ends == [(1, 1, "it tilted"), (2, 1, "motor 3"), (3, 1, "motor 3")]
        robot, policy, episode, tick = given[0]
        assert (robot.name, policy, episode.duration_s) == ("go1", "policy", 60.0)
        assert episode.command_source(0.0) is made.panel.command
        made.panel.command = np.array([0.7, 0.1, -0.2])  # moved meanwhile
        assert episode.command_source(5.0) is made.panel.command
        assert tick == made.walk._tick
        assert self.done(made) == ["begin"] * 3

    @pytest.fixture
    def walking(self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """In the middle of an episode, at 2 s."""
        monkeypatch.setattr(made.walk, "_look", lambda: made.log.append(("look",)))
        made.walk._pace = SimpleNamespace(
            factor=0.75,
            wait=lambda at: made.log.append(("wait", at)),
            resume=lambda at: made.log.append(("resume", at)),
        )
        made.walk._next_frame_us = 2_000_000
        made.loop = SimpleNamespace(
            now_us=2_000_000, state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
            finish=lambda: made.log.append(("finish",)),
        )  # fmt: skip
        truth = SimpleNamespace(
            base_velocity=np.array([0.4, 0.2, 9.0]), base_angular_velocity=np.array([7.0, 8.0, -1.0])
        )
        made.body = SimpleNamespace(
            data="data", truth=lambda: truth, push=lambda change: made.log.append(("push", change))
        )
        return made

    def test_a_frame_comes_when_it_is_due(self, walking: SimpleNamespace) -> None:
        walking.loop.now_us = 1_999_999
        walking.walk._tick(walking.loop, walking.body)
        assert walking.log == []
        walking.loop.now_us = 2_000_000
        walking.walk._tick(walking.loop, walking.body)
        assert self.done(walking) == ["show", "look", "wait"]
        assert walking.log[-1] == ("wait", 2.0)
        assert walking.walk._next_frame_us == 2_033_000
        walking.loop.now_us = 2_040_000  # a late one leaves the rhythm as it is
        walking.walk._tick(walking.loop, walking.body)
        assert walking.walk._next_frame_us == 2_066_000
        walking.stop.requested = True
        walking.log.clear()
        walking.walk._tick(walking.loop, walking.body)
        assert walking.log == [("finish",)]

    def test_it_shows_the_true_velocity_smoothed_beside_the_command(self, walking: SimpleNamespace) -> None:
        for share in (0.1, 0.19):
            walking.log.clear()
            walking.walk._show(walking.loop, walking.body)
            ((_, data, command, velocity, follow),) = walking.log
            assert (data, follow) == ("data", True)
            assert command is walking.panel.command
            np.testing.assert_allclose(velocity, share * np.array([0.4, 0.2, -1.0]))
        assert (walking.status.mode, walking.status.pace) == ("WALKING", 0.75)

    def test_a_push_has_the_speed_that_was_asked_for_and_a_direction_of_its_own(
        self, walking: SimpleNamespace
    ) -> None:
        walking.panel.push = 1.5
        for _ in range(40):
            walking.walk._do_as_asked(walking.loop, walking.body)
        pushes = np.array([change for _, change in walking.log])
        np.testing.assert_allclose(np.hypot(pushes[:, 0], pushes[:, 1]), 1.5)
        assert not pushes[:, 2].any()
        angles = np.arctan2(pushes[:, 1], pushes[:, 0])
        assert angles.min() < -2.0
        assert angles.max() > 2.0

    def test_a_restart_ends_the_episode(self, walking: SimpleNamespace) -> None:
        walking.panel.restart = True
        walking.walk._do_as_asked(walking.loop, walking.body)
        assert walking.log == [("finish",)]

    def test_while_it_is_paused_it_looks_on_and_then_keeps_its_time(
        self, walking: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        walking.panel.paused = True

        def look() -> None:
            walking.log.append(("look",))
            walking.panel.paused = len(walking.log) < 5

        monkeypatch.setattr(walking.walk, "_look", look)
        walking.walk._do_as_asked(walking.loop, walking.body)
        assert walking.log == [("look",), ("sleep", 0.1)] * 3 + [("resume", 2.0)]

    def test_until_there_is_a_policy_it_waits_and_it_ends_when_told_to(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        walked: list[Any] = []

        def look() -> None:
            made.log.append(("look",))
            if len(made.log) > 4:
                made.walk._policy = "policy"

        def episode(policy: Any) -> None:
            walked.append(policy)
            made.stop.requested = len(walked) > 1

        monkeypatch.setattr(made.walk, "_look", look)
        monkeypatch.setattr(made.walk, "_episode", episode)
        made.walk.go_on()
        assert made.log[:4] == [("look",), ("sleep", 0.1)] * 2
        assert walked == ["policy", "policy"]


def test_a_page_is_made_of_the_runs_own_robot_and_ends_with_its_exporter(
    tmp_path: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log: list[Any] = []
    run = SimpleNamespace(folder=tmp_path / "mine", provenance=SimpleNamespace(robot="go1"))

    @contextmanager
    def serving(*given: Any) -> Iterator[str]:
        log.append(("serving", *given))
        yield "server"
        log.append(("served",))

    def show(data: Any, command: np.ndarray, velocity: np.ndarray, follow: bool) -> None:
        log.append(("show", data, command.tolist(), velocity.tolist(), follow))

    scene = SimpleNamespace(show=show)
    snapshots = SimpleNamespace(close=lambda: log.append(("closed",)))
    monkeypatch.setattr(walk, "open_run", lambda _: run)
    monkeypatch.setattr(walk, "serving", serving)
    monkeypatch.setattr(
        walk, "Snapshots", lambda folder, own: log.append(("snapshots", folder, own.is_dir())) or snapshots
    )
    monkeypatch.setattr(
        walk, "Scene", lambda server, robot, _: log.append(("scene", server, robot.name)) or scene
    )
    monkeypatch.setattr(walk, "Panel", lambda server: f"panel of {server}")
    monkeypatch.setattr(walk, "standing", lambda robot: SimpleNamespace(data=f"{robot.name} standing"))
    monkeypatch.setattr(
        walk,
        "Walk",
        lambda *given: (
            log.append(("walk", given[0], given[1].name, *given[2:]))
            or SimpleNamespace(go_on=lambda: log.append(("on",)))
        ),
    )
    walk.watch(tmp_path, "there", 123, "stop")  # type: ignore[arg-type]
    assert log == [
        ("serving", "there", 123, "footfall: mine"), ("snapshots", tmp_path / "mine", True), ("scene",
        "server", "go1"),
        ("show", "go1 standing", [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], False),
        ("walk", run, "go1", scene, "panel of server", snapshots, "stop"), ("on",),
        ("closed",), ("served",),
    ]  # fmt: skip
    assert capsys.readouterr().out == f"showing {tmp_path / 'mine'} at http://there:123 until Ctrl-C\n"
