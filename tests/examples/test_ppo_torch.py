"""The example of a training loop in plain torch."""

import re

import pytest
from long_tests import long_test
from user_folder import UserFolder


@long_test
def test_the_return_rises(user_folder: UserFolder) -> None:
    pytest.importorskip("torch")
    user_folder.copy("ppo_torch.py")
    output = user_folder.python("ppo_torch.py", "12")
    returns = [float(number) for number in re.findall(r"mean return (\S+)", output)]
    assert len(returns) == 12
    assert returns[-1] > returns[0] + 0.5
