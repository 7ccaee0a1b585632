"""A server, a rover and the older MAVSDK, whose gRPC port is open on every interface.

Hence run in a network of its own: ``python -m tests.kit.own_network -m tests.interop.older_api
FOLDER LOSS``. Prints what the script said, then what the server did.
"""

import sys
from pathlib import Path

import mavsdk_grpc.bin

from tests.kit.processes import process, stand
from tests.kit.scripts import clients_port, finish

MAVSDK_SERVER = Path(mavsdk_grpc.bin.__file__).with_name("mavsdk_server")


def main(folder: Path, loss: float) -> None:
    with stand(folder) as running, clients_port(running, loss) as port:
        url = f"udpout://127.0.0.1:{port}"
        server = ("-p", "0", url)  # 0: a free one
        with process(*server, folder=folder, name="mavsdk", python=str(MAVSDK_SERVER)) as mavsdk:
            ready = mavsdk.wait_for(r"set to listen on 0\.0\.0\.0:(\d+)")
            address = f"127.0.0.1:{ready[1]}"
            print(finish("older_api", address, persona="ardupilot", loss=loss, running=running))
            assert mavsdk.popen.poll() is None, f"mavsdk_server has ended:\n{mavsdk.text}"
        print(running.server.text)


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]))
