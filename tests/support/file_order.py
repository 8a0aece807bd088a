"""Files whose tests run in one worker, and files that begin first."""

# Files that compile the same programs stay in one worker: the program of a training, and operations on
# arrays of the same sizes.
TRAININGS = (
    *("train/test_cluster.py", "train/test_sweep.py", "train/test_runs.py", "train/test_failure.py"),
    "footfall/test_cli_train.py",
)
UPDATES = ("train/test_ppo.py", "train/test_iteration.py")
TOGETHER = {file: group[0] for group in (TRAININGS, UPDATES) for file in group}

# The files that take longest, in decreasing order. Otherwise one worker would still be busy when the others
# have finished.
OTHERS = """
envs/test_generated_physics envs/test_physics deploy/test_wiring_check deploy/test_bench identify/test_fit
benchmarks/test_fault_table deploy/test_log policies/test_controllers_walk examples/test_examples
train/test_rsl_rl footfall/test_cli_process policies/test_controllers_step envs/test_locomotion
plant/test_sensors robots/importer/test_create deploy/test_sensor_faults identify/test_imported
evaluate/test_weakest policies/test_walks evaluate/test_episodes repository/test_imports
deploy/test_estimator footfall/test_cli_log envs/test_task envs/test_gymnasium
policies/test_made_up_robots robots/test_check deploy/test_battery benchmarks/test_recordings
repository/test_docs pages/test_page footfall/test_cli_can deploy/test_foot_force
train/test_actuator_net plant/test_standing footfall/test_cli_bad_input
"""
LONGEST = (*TRAININGS, *UPDATES, *(f"{name}.py" for name in OTHERS.split()))
