"""SETUP_SIGNING from a client: the server signs its packets to it, if the key is in the ring.

It gives no rights, adds no key to the ring, and is never forwarded: a rover whose key changed
without the server would accept no STOP from it any more.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavSeverity


class SetupSigning:
    """The handler of SETUP_SIGNING. QGroundControl looks for signed packets or a text."""

    def __init__(self, signatures: Signatures, vehicles: VehicleSide) -> None:
        self._signatures = signatures
        self._vehicles = vehicles

    def receive(self, client: GcsClient, message: m.SetupSigning, *, now: float) -> None:
        """Start or end signing to this client; a text says why not."""
        targets = self._vehicles.addressed_by(message.target_system)
        if not targets:
            return
        why_not = "disabled by signing.setup"
        if targets[0].parts.settings.signing.setup == "known":
            why_not = self._set_up(client, bytes(message.secret_key))
        if why_not:
            words = f"signing refused: {why_not}"
            client.tell(words, MavSeverity.ERROR, targets[0].server_address, now=now)

    def _set_up(self, client: GcsClient, secret: bytes) -> str:
        link, peer = client.key
        if not any(secret):
            if not self._signatures.takes_unsigned(link):
                return "this link requires signed packets"
            self._signatures.sign_to(link, peer, None)
            return ""
        key = self._signatures.key_of_secret(secret)
        if key is None or not key.role:
            return "this server has no such key for clients"
        self._signatures.sign_to(link, peer, key)
        return ""
