"""Files whose tests run in one worker, and files that begin first."""

# Files that compile the same programs stay in one worker: the program of a training, and operations on
# arrays of the same sizes.
TRAININGS = (
    "train/test_cluster.py",
    "train/test_sweep.py",
    "train/test_runs.py",
    "train/test_failure.py",
    "footfall/test_cli_train.py",
)
UPDATES = ("train/test_ppo.py", "train/test_iteration.py", "train/test_networks.py")
TOGETHER = {file: group[0] for group in (TRAININGS, UPDATES) for file in group}

# The files that take longest, in decreasing order. Otherwise one worker would still be busy when the others
# have finished.
LONGEST = (
    *TRAININGS,
    *UPDATES,
    "envs/test_generated_physics.py",
    "envs/test_physics.py",
    "deploy/test_wiring_check.py",
    "deploy/test_bench.py",
    "identify/test_fit.py",
    "benchmarks/test_fault_table.py",
    "deploy/test_log.py",
    "policies/test_controllers_walk.py",
    "examples/test_examples.py",
    "train/test_rsl_rl.py",
    "footfall/test_cli_process.py",
    "policies/test_controllers_step.py",
    "envs/test_locomotion.py",
    "plant/test_sensors.py",
    "robots/importer/test_create.py",
    "deploy/test_sensor_faults.py",
    "identify/test_imported.py",
    "evaluate/test_weakest.py",
    "policies/test_walks.py",
    "evaluate/test_episodes.py",
    "repository/test_imports.py",
    "deploy/test_estimator.py",
    "footfall/test_cli_log.py",
    "envs/test_task.py",
    "envs/test_gymnasium.py",
    "policies/test_made_up_robots.py",
    "robots/test_check.py",
    "deploy/test_battery.py",
    "benchmarks/test_recordings.py",
    "footfall/test_cli_replay.py",
    "repository/test_docs.py",
    "pages/test_page.py",
    "footfall/test_cli_can.py",
    "deploy/test_foot_force.py",
    "train/test_actuator_net.py",
    "plant/test_walking.py",
    "footfall/test_cli_bad_input.py",
)
