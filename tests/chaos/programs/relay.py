"""A relay that connects, comes back when it is cut off, and says nothing."""

import os
import socket
import time

while True:
    with socket.socket(socket.AF_UNIX) as wire:
        try:
            wire.connect(os.environ["SCENARIO_SOCKET"])
            wire.recv(1)
        except OSError:
            pass
    time.sleep(0.05)
