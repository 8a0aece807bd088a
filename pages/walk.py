"""Walks the simulated robot under the newest policy of a training, in real time, for a page."""

import time
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.loop import ControlLoop
from footfall.deploy.wiring import wiring_of
from footfall.pages.layers import offer_layers
from footfall.pages.metrics_file import MetricsFile
from footfall.pages.moment import Moment
from footfall.pages.newest_policy import NewestPolicy
from footfall.pages.page import serving
from footfall.pages.panel import Panel
from footfall.pages.snapshots import Snapshot, Snapshots
from footfall.pages.status import Status, as_markdown
from footfall.pages.view import View
from footfall.plant.episode import Episode, run_episode
from footfall.plant.ground_truth import Truth
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model
from footfall.train.runs.folder import Run, open_run
from footfall.train.runs.stop import StopRequest

FRAME_US = 33_000
WAIT_S = 0.1  # between checks of the page while nothing walks
REFRESH_S = 1.0  # between checks of the run folder
EPISODE_S = 60.0  # limits the memory for an episode's trace
SMOOTHING = 0.1  # weight of the newest velocity in the shown one, per frame


def watch(folder: Path, host: str, port: int, stop: StopRequest) -> None:
    """Serve the page of a run until a stop is requested.

    The stop is a flag, since some packages swallow a KeyboardInterrupt during their import.

    Raises:
        UserError: there is no such run, viser is missing, the address is not available, or the run's policy
            does not fit its robot.
    """
    run = open_run(folder)
    robot = load_robot(run.provenance.robot)
    with ExitStack() as resources:
        server = resources.enter_context(serving(host, port, f"footfall: {run.folder.name}"))
        snapshots = Snapshots(run.folder, Path(resources.enter_context(TemporaryDirectory())))
        resources.callback(snapshots.close)
        print(f"showing {run.folder} at http://{host}:{port} until Ctrl-C", flush=True)
        panel = Panel(server)
        view = View(server, robot, plant_model(robot), panel.live_curves)
        offer_layers(server.gui, view.layers)
        view.stand(standing(robot).data)  # until a policy walks
        Walk(run, robot, view, panel, snapshots, stop).run()


def standing(robot: Robot) -> SimulatedRobot:
    """The simulated robot in its default pose on the ground."""
    wiring = wiring_of(robot)
    return SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses))


def true_moment(loop: ControlLoop, truth: Truth, command: np.ndarray) -> Moment:
    """Ground truth of the simulated robot, with its joint readings."""
    return Moment(
        loop.now_us * 1e-6,
        truth.base_position,
        truth.base_quaternion,
        truth.base_velocity,
        command,
        loop.sensed,
        truth.foot_contact.astype(float),
    )


class Pace:
    """Synchronises simulated time with the wall clock. Lost time is not made up."""

    TOLERANCE_S = 0.1

    def __init__(self) -> None:
        self._start_s = time.monotonic()
        self._mark = (0.0, self._start_s)
        self.factor = 1.0  # simulated over wall time, in the last second

    def wait(self, simulated_s: float) -> None:
        """Sleep until the wall clock reaches this simulated time."""
        early_s = self._start_s + simulated_s - time.monotonic()
        if early_s > 0.0:
            time.sleep(early_s)
        elif early_s < -self.TOLERANCE_S:
            self._start_s -= early_s
        simulated_before_s, wall_before_s = self._mark
        now_s = time.monotonic()
        if now_s - wall_before_s >= 1.0:
            self.factor = (simulated_s - simulated_before_s) / (now_s - wall_before_s)
            self._mark = (simulated_s, now_s)

    def resume(self, simulated_s: float) -> None:
        """Continue after a pause."""
        self._start_s = time.monotonic() - simulated_s
        self._mark = (simulated_s, time.monotonic())


class Walk:
    """Runs episodes one after the other. Newer networks replace the current one while the robot walks."""

    def __init__(
        self, run: Run, robot: Robot, view: View, panel: Panel, snapshots: Snapshots, stop: StopRequest
    ) -> None:
        self._robot, self._view, self._panel, self._snapshots = robot, view, panel, snapshots
        self._stop = stop
        self._metrics, self._policy_file = MetricsFile(run.folder / "metrics.jsonl"), run.policy
        self._policy: NewestPolicy | None = None
        self._pushes = np.random.default_rng(0)
        self._refreshed_s = 0.0
        provenance = run.provenance
        preset = Path(provenance.preset).stem
        self._status = Status(
            title=f"{robot.name}, preset {preset}, seed {provenance.seed}, {provenance.trainer}",
            folder=str(run.folder),
            total_steps=run.config.ppo.iterations * run.config.ppo.steps_per_iteration,
            steps_per_iteration=run.config.ppo.steps_per_iteration,
        )

    def run(self) -> None:
        """Show the run until a stop is requested."""
        while not self._stop.requested:
            self._refresh()
            if self._policy is None:
                time.sleep(WAIT_S)
            else:
                self._episode(self._policy)

    def _episode(self, policy: NewestPolicy) -> None:
        """Run one episode: until a fall, the time limit, or a restart from the page."""
        self._status.episodes += 1
        self._pace, self._next_frame_us = Pace(), 0
        self._view.begin()
        episode = Episode(command_source=lambda _: self._panel.command, duration_s=EPISODE_S)
        trace = run_episode(self._robot, policy, episode, self._tick)
        if trace.fell or trace.faults:
            self._status.falls += trace.fell
            self._status.last_fall = trace.fall_reason or trace.faults[0]

    def _tick(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Called by the loop after each joint tick."""
        if self._stop.requested:
            loop.finish()  # damping, then motors off, without waiting for the wall clock
        elif loop.now_us >= self._next_frame_us:
            self._frame(loop, body)

    def _frame(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Carry out requests, draw, check the run folder, and wait for the wall clock."""
        self._next_frame_us += FRAME_US
        self._carry_out(loop, body)
        self._show(loop, body)
        self._refresh()
        self._pace.wait(loop.now_us * 1e-6)

    def _carry_out(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Carry out the page's requests: pause, push, restart."""
        if self._panel.paused:
            while self._panel.paused and not self._stop.requested:
                self._refresh()
                time.sleep(WAIT_S)
            self._pace.resume(loop.now_us * 1e-6)
        if speed := self._panel.take_push():
            direction = self._pushes.uniform(-np.pi, np.pi)
            body.push((speed * np.cos(direction), speed * np.sin(direction), 0.0))
        if self._panel.take_restart():
            loop.finish()

    def _show(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        truth, status = body.truth(), self._status
        moment = true_moment(loop, truth, self._panel.command)
        velocity = np.array([*truth.base_velocity[:2], truth.base_angular_velocity[2]])
        status.velocity = status.velocity + SMOOTHING * (velocity - status.velocity)
        status.command, status.mode = moment.command, loop.state.mode.value
        status.pace, status.restart_s = self._pace.factor, EPISODE_S
        status.walked_s = loop.walking_s if loop.walking else 0.0
        self._view.show(body.data, moment, status.velocity, self._panel.follow)

    def _refresh(self) -> None:
        """Check the run folder for new metrics and policies, at most every `REFRESH_S`."""
        now_s = time.monotonic()
        if now_s - self._refreshed_s < REFRESH_S:
            return
        self._refreshed_s = now_s
        status = self._status
        self._metrics.refresh()
        status.trained_steps, status.metrics_age_s = self._metrics.last_step, self._metrics.age_s()
        training_done = status.metrics_age_s is None or status.trained_steps >= status.total_steps
        status.finished = training_done and self._policy_file.exists()
        self._panel.draw(self._metrics, status.finished)
        self._panel.offer_policies(self._snapshots.names())
        self._snapshots.chosen = self._panel.policy
        # Without a visitor, an export would only slow the training.
        if self._policy is None or self._panel.visited:
            snapshot = self._snapshots.poll()
            if snapshot is not None:
                self._take_over(snapshot)
        status.problem, status.exporting = self._snapshots.problem, self._snapshots.exporting
        self._panel.show_status(as_markdown(status))

    def _take_over(self, snapshot: Snapshot) -> None:
        if self._policy is None:
            self._policy = NewestPolicy(snapshot.path, self._robot)
            self._panel.offer_commands(self._policy.contract.commands)
        else:
            try:
                self._policy.replace_network(snapshot.path)
            except UserError as error:
                self._snapshots.problem = str(error)
                return
        self._status.iteration = snapshot.iteration
        self._status.policies += 1
