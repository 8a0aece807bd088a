"""The DDS domain: selects the network."""

import os
from collections.abc import Mapping

LOCAL = """<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers><SPDPInterval>1s</SPDPInterval></Discovery>"""
SUBNET = "<Discovery><SPDPInterval>1s</SPDPInterval></Discovery>"
# Type information is not sent: rclpy of Kilted rejects the one from cyclonedds ("invalid type object").
COMPATIBLE = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"


def configuration(environment: Mapping[str, str]) -> str:
    """Configuration of cyclonedds: only this computer unless the environment opens ROS to the network."""
    local = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST").upper() in ("LOCALHOST", "OFF")
    return f'<CycloneDDS><Domain Id="any">{LOCAL if local else SUBNET}{COMPATIBLE}</Domain></CycloneDDS>'


def configure() -> int:
    """Set the configuration unless the user has set one; returns the domain's id."""
    os.environ.setdefault("CYCLONEDDS_URI", configuration(os.environ))
    return int(os.environ.get("ROS_DOMAIN_ID") or 0)
