"""The DDS domain: which network it uses."""

import os
from collections.abc import Mapping

LOCAL = """<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers><SPDPInterval>1s</SPDPInterval></Discovery>"""
SUBNET = "<Discovery><SPDPInterval>1s</SPDPInterval></Discovery>"
# Types stay untold: rclpy of Kilted refuses what cyclonedds tells of them ("invalid type object").
COMPATIBLE = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"


def configuration(environment: Mapping[str, str]) -> str:
    """Of cyclonedds: this computer alone unless the environment opens ROS to the network."""
    local = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST").upper() in ("LOCALHOST", "OFF")
    return f'<CycloneDDS><Domain Id="any">{LOCAL if local else SUBNET}{COMPATIBLE}</Domain></CycloneDDS>'


def configure() -> int:
    """Set the configuration unless the user has one; returns the domain's id."""
    os.environ.setdefault("CYCLONEDDS_URI", configuration(os.environ))
    return int(os.environ.get("ROS_DOMAIN_ID") or 0)
