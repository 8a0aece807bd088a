"""A run that another source steers, with a cockpit beside it."""

import numpy as np
from walking_run import WALKING

from footfall.deploy.command_source import Scheduled
from footfall.operate.accompanied import Accompanied
from footfall.operate.inbox import Inbox


def test_operators_see_the_run_and_stop_it_but_do_not_steer_it() -> None:
    inbox = Inbox()
    source = Accompanied(Scheduled(lambda _: np.array([0.3, 0.0, 0.0])), inbox)
    inbox.take_over("page")
    inbox.put("page", velocity=[-0.5, 0.0, 0.0])
    assert source.poll(WALKING).velocity.tolist() == [0.3, 0.0, 0.0]
    assert inbox.status is WALKING
    assert source.stopped is None
    inbox.stop("page")
    assert source.stopped is not None
