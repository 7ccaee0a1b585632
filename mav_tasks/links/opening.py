"""Opens the link for a link URL."""

from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES, LinkLimits
from mav_tasks.links.local_port import port_for
from mav_tasks.links.tcp_in import TcpInLink
from mav_tasks.links.tcp_out import TcpOutLink
from mav_tasks.links.udp import UdpLink
from mav_tasks.links.url import LinkUrl, SerialUrl


def open_link(
    url: LinkUrl | SerialUrl, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()
) -> Link:
    """Open a link; raise LinkOpenError if that fails. Only a UDP link uses ``push``.

    A link that dials is open before its peer exists, and tries until it connects.
    """
    if isinstance(url, SerialUrl):
        from mav_tasks.links.serial import SerialLink  # noqa: PLC0415  # only for serial links

        return SerialLink(url, limits=limits)
    if url.kind == "tcpin":
        return TcpInLink(url, limits=limits)
    if url.kind == "tcp":
        return TcpOutLink(url, limits=limits)
    is_rover_dialled = url.kind == "udpout" and limits is TO_VEHICLES
    return UdpLink(
        url, push=push, local_port=port_for(url.host, url.port) if is_rover_dialled else 0
    )
