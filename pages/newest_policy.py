"""A policy whose network is replaced by newer ones while it walks."""

from pathlib import Path

from footfall.common.errors import UserError
from footfall.policies.learned import LearnedPolicy, open_network


class NewestPolicy(LearnedPolicy):
    """A learned policy; a later checkpoint can replace its network between two steps.

    Observation history, last action and gait clock are kept, so that the robot does not stumble.
    """

    def replace_network(self, path: Path) -> None:
        """Continue with another network of the same contract.

        Raises:
            UserError: the file is not a policy, or has another contract.
        """
        session, contract = open_network(path)
        if contract != self.contract:
            raise UserError(f"{path} has another contract than the policy that walks: start watching again")
        self._session = session
